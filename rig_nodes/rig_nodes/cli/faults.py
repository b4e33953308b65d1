# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""``rig faults bench``: detectors of faults on a public set of healthy and ill runs, with their scores."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from ..base import ProgressLine, RigError, number_text
from .shared_arguments import add_json, add_rig

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable
    from typing import Any

    from ..plant import Size

PAGE = """# Types of faults

How they are ordered: [faults](../faults.md). FMI is the failure mode of SAE J1939-73; sizes are assumed, within what such devices
can have.

"""
HELP = "score a detector of faults on healthy and ill runs"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the verb."""
    verbs = parser.add_subparsers(dest="what", required=True, metavar="WHAT")
    bench = verbs.add_parser("bench", help="score a detector; without one the rig's own baseline", allow_abbrev=False)
    bench.add_argument(
        "--detector",
        metavar="FILE.py:FUNCTION",
        help="function of a run's Course (docs/faults.md) that returns None, or the time of its alarm [s] and names of faults",
    )
    add_rig(bench)
    bench.add_argument("--seed", type=int, default=1, help="seed of the runs (default: 1)")
    bench.add_argument("--healthy", type=int, default=200, metavar="N", help="healthy runs (default: 200)")
    bench.add_argument("--repeats", type=int, default=1, metavar="N", help="runs for each fault and size (default: 1)")
    bench.add_argument("--sizes", default="0.25,0.5,1,2", metavar="A,B", help="sizes over the usual one (default: 0.25,0.5,1,2)")
    bench.add_argument("--jobs", type=int, default=os.cpu_count() or 1, metavar="N", help="processes (default: one for each core)")
    add_json(bench, "write the scores as JSON; - for stdout, without tables")


def main(args: argparse.Namespace) -> int:
    """Run the benchmark and print its scores."""
    from ..api import bench_faults
    from ..studies import lines_of_faults
    from .json_output import write_json

    try:
        sizes = tuple(float(size) for size in args.sizes.split(","))
    except ValueError:
        raise RigError(f"--sizes {args.sizes}: expected numbers above 0 with commas between them, e.g. 0.5,1,2") from None
    detector = detector_of(args.detector) if args.detector else None
    line = ProgressLine()
    try:
        result = bench_faults(
            args.rig,
            detector,
            seed=args.seed,
            healthy=args.healthy,
            repeats=args.repeats,
            sizes=sizes,
            jobs=args.jobs,
            watch=lambda what, done, of: line.show(done, f"{what}: run {done} of {of}"),
        )
    finally:
        line.leave()
    result = {"detector": args.detector or "baseline", **result}
    if args.json != "-":
        head = f"{result['runs']} runs of '{result['rig']}' by seed {result['seed']}, {result['healthy']} of them healthy"
        print("\n".join([f"detector {result['detector']} on {head}", *lines_of_faults(result)]))
    if args.json:
        write_json(args.json, result)
    return 0


def page() -> str:
    """Return the content of docs/made/faults.md."""
    from ..plant import faults
    from ..rig import shown_unit

    def size_of(size: Size | None) -> str:
        if size is None:
            return "-"
        unit, factor = shown_unit(size.quantity)
        low, high, usual = (number_text(value / factor, apart=" ") for value in (size.low, size.high, size.usual))
        return f"{size.text}: {usual} {unit} ({low} to {high})"

    rows = ["| fault | what | size: usual one (range) | onset | one sees | FMI |", "| --- | --- | --- | --- | --- | --- |"]
    for name, one in faults().items():
        rows.append(f"| `{name}` | {one.text} | {size_of(one.size)} | {one.onset} | {one.sign} | {one.fmi} |")
    return PAGE + "\n".join(rows) + "\n"


def detector_of(spec: str) -> Callable[[Any], Any]:
    """Return the function that FILE.py:FUNCTION names; RigError when there is none."""
    import importlib.util

    path, _, name = spec.rpartition(":")
    if not path or not Path(path).is_file():
        raise RigError(f"--detector {spec}: expected FILE.py:FUNCTION, and there is no file '{path}'")
    found = importlib.util.spec_from_file_location(Path(path).stem, path)
    if found is None or found.loader is None:
        raise RigError(f"--detector {spec}: '{path}' is no Python file")
    module = importlib.util.module_from_spec(found)
    try:
        found.loader.exec_module(module)
    except Exception as error:  # whatever a user's file raises
        raise RigError(f"--detector {spec}: the file cannot be loaded ({type(error).__name__}: {error})") from None
    if not callable(function := getattr(module, name, None)):
        raise RigError(f"--detector {spec}: '{path}' has no function '{name}'")

    def called(course: Any) -> Any:
        try:
            return function(course)
        except Exception as error:  # whatever a user's function raises
            raise RigError(f"--detector {spec}: it raised {type(error).__name__}: {error}") from None

    return called
