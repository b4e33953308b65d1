# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""``rig validate``: every number and trend that the laboratory printed, compared with the rig; for another rig its own rows."""

from __future__ import annotations

import contextlib
import platform
import sys
import time
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from ..base import ProgressLine
from .output_files import OutputFolder
from .shared_arguments import add_json, add_rig, add_set

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable

HELP = "compare a rig with its validation rows, the HydmAG with all printed results"
STARTING = 2.0  # cost of starting the processes, in the unit of a programme's runs_of


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument(
        "--rows", nargs="+", default=[], metavar="PATTERN", help="only these rows; * matches any text, e.g. 'up_t_*'"
    )
    parser.add_argument(
        "--procedures", nargs="+", default=[], metavar="NAME", help="only rows of these procedures, e.g. grid_up delay_series"
    )
    add_json(parser, "write rows, summary and versions as JSON; - for stdout")
    parser.add_argument("--pictures", type=OutputFolder(), metavar="FOLDER", help="write the figures of chapters 7 to 9 as SVG")
    parser.add_argument("--jobs", type=int, default=2, metavar="N", help="processes that run series (default: 2)")
    add_rig(parser, "rig, its folder or .yaml file: whose validation.yaml")
    add_set(parser, "change one value of the rig")


def _progress(runs: dict[str, tuple[int, float]]) -> Callable[[str, int, int], None]:
    """Return the callback of programme.validate; ``runs`` holds for each procedure the number of runs and the length of one."""
    line = ProgressLine(STARTING + sum(count * size for count, size in runs.values()))
    done = STARTING

    def progress(procedure: str, count: int, of: int) -> None:
        nonlocal done
        done += runs[procedure][1]
        line.show(done, f"{procedure:<15} {count:>3} of {of} runs", count == of)

    return progress


def main(args: argparse.Namespace) -> int:
    """Run what the rows need, print and write the comparison; return 1 when a run tripped."""
    from ..base import RigError
    from ..runs import Workers, start_server

    began = time.monotonic()
    if args.jobs < 1:
        raise RigError(f"--jobs is {args.jobs}, expected at least 1")
    from ..studies import programme_of, rows_file

    path = rows_file(args.rig)
    package = programme_of(path)
    if package is None:
        return _own_rows(args, path)
    if args.jobs > 1:
        start_server(f"{package}.programme", rigs=[args.rig])

    from ..controllers import embedded_line
    from ..rig import load_gearbox_rig
    from ..runs import parse_settings
    from ..studies import terminal
    from .json_output import write_json

    document, pictures, programme, time_courses = (
        import_module(f"{package}.{name}") for name in ("document", "pictures", "programme", "time_courses")
    )
    targets = programme.choose(args.rows, args.procedures)
    settings = parse_settings(args.settings)
    load_gearbox_rig(args.rig, settings, "validate --rig")  # errors in the rig are reported before anything runs
    procedures = programme.needed(targets)
    programme.check_settings(procedures, settings)
    if args.pictures:
        _make_folder(args.pictures)
    runs = programme.runs_of(procedures)
    if runs:
        print(embedded_line(), file=sys.stderr, flush=True)
    drawn = []
    # rows that only inform need no processes
    with Workers(args.jobs) if procedures else contextlib.nullcontext() as workers:
        result = programme.validate(targets, workers, args.rig, settings, _progress(runs))
        if args.pictures and procedures:
            drawn = time_courses.time_courses(procedures, workers, args.rig, settings)
    print(
        f"{sum(count for count, _ in runs.values())} runs with their metrics in {time.monotonic() - began:.1f} s", file=sys.stderr
    )

    if args.json != "-":
        print(terminal(result.rows, document.of_holds(result.rows)))
    if args.json:
        write_json(
            args.json,
            {
                "rows": [row.as_dict() for row in result.rows],
                "summary": programme.summary(result),
                "versions": _versions(),
                "rig": args.rig,
                "settings": settings,
                "procedures": list(result.procedures),
            },
        )
    if args.pictures:
        from ..view import write_charts

        count = len(write_charts([*pictures.figures(result.records), *drawn], args.pictures))
        print(f"{count} figures written to {args.pictures}", file=sys.stderr)
    if result.trips:
        print(f"rig: {len(result.trips)} of the runs tripped, the first one {result.trips[0]}", file=sys.stderr)
        return 1
    return 0


def _own_rows(args: argparse.Namespace, path: Path) -> int:
    """Validate the rows of a rig's folder."""
    from ..base import RigError
    from ..runs import Workers, start_server

    if given := next((flag for flag, value in (("--pictures", args.pictures), ("--procedures", args.procedures)) if value), None):
        raise RigError(f"{given} belongs to the laboratory's programme; the rows of {path} have none")
    if args.jobs > 1:
        start_server("rig_nodes.studies.validation.own_rows", rigs=[args.rig])

    from ..rig import load_rig
    from ..runs import parse_settings
    from ..studies import check_settings, chosen_rows, counts, load_rows, rows_by_run, terminal, validate_rows
    from .json_output import write_json

    settings = parse_settings(args.settings)
    rows = chosen_rows(load_rows(path, args.rig, load_rig(args.rig, settings)), args.rows)
    check_settings(rows, settings)
    line = ProgressLine(len(rows_by_run(rows)))
    with Workers(args.jobs) as workers:
        found = validate_rows(
            rows, args.rig, settings, workers, lambda done, of: line.show(done, f"{done} of {of} runs", done == of)
        )
    if args.json != "-":
        print(terminal(found))
    if args.json:
        write_json(
            args.json,
            {
                "rows": [row.as_dict() for row in found],
                "summary": counts(found),
                "versions": _versions(),
                "rig": args.rig,
                "settings": settings,
                "procedures": [],
            },
        )
    return 0


def _make_folder(folder: Path) -> None:
    from ..base import RigError

    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RigError(f"--pictures {folder}: the folder cannot be made ({error.strerror})") from None


def _versions() -> dict[str, str]:
    from importlib.metadata import version

    import rig_nodes

    return {
        "rig_nodes": rig_nodes.__version__,
        "python": platform.python_version(),
        **{name: version(name) for name in ("numpy", "scipy", "numba")},
    }
