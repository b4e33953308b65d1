# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rig compare`: runs, bags and loggers' CSV files side by side on one clock, with differences in measuring errors."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import argparse
    from collections.abc import Mapping

    from ..analysis.side_by_side import Comparison, Source
    from ..catalogue import Signal
    from ..testbench.configuration import RigConfig
    from ..transmission import Transmission

HELP = "lay runs, bags and loggers' files over each other, with differences in measuring errors"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument("runs", nargs="+", metavar="RUN", help="folder of a run, its .mcap file, or a logger's .csv; two or more")
    parser.add_argument("--align", choices=("events", "correlation"), help="how (default: events where all hold the same orders)")
    parser.add_argument("--orders", metavar="LIST", help="for the CSV files: when (s) which gear was ordered, e.g. '3.845:I-II'")
    parser.add_argument("--period", metavar="TIME", help="for CSV files without times: between rows, e.g. '0.1 ms'")
    parser.add_argument("--rig", metavar="NAME", help="for the CSV files: rig with its inertias and instruments (default: hydmag)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write offsets, metrics and signals as JSON")
    parser.add_argument("--html", type=Path, metavar="FILE", help="write one self-contained page")
    parser.add_argument("--rrd", type=Path, metavar="FILE", help="write a file for Rerun, with its layout")


INTERMIXED = True


def main(args: argparse.Namespace) -> int:
    """Compare, print, and write what was asked for."""
    from ..analysis.side_by_side import compare
    from ..atomic_write import atomic_write
    from ..catalogue import catalogue
    from ..config.names import DEFAULT_RIG
    from ..errors import RigError
    from ..testbench.configuration import load_gearbox_rig

    if len(args.runs) < 2:
        raise RigError(f"{args.runs[0]} alone cannot be compared; name two or more runs, bags or .csv files")
    config = load_gearbox_rig(args.rig or DEFAULT_RIG, None, "a logger's file")
    sources = [_source(run, args, config) for run in args.runs]
    found = compare(sources, args.align)
    box = sources[0].recording.transmission
    signals = catalogue(sources[0].record).signals
    print("\n".join(_lines(found, box, signals)))
    if args.json:
        atomic_write(args.json, json.dumps(found.as_dict(), indent=2) + "\n")
    if args.html:
        from ..view.compare_page import compare_page

        atomic_write(args.html, compare_page(found, signals, box))
    if args.rrd:
        from ..view.compare_file import write_compare_file

        write_compare_file(found, signals, args.rrd)
    return 0


def _source(run: str, args: argparse.Namespace, config: RigConfig) -> Source:
    from ..analysis.logger_csv import parse_orders, read_logger_csv
    from ..analysis.report import recording_of
    from ..analysis.side_by_side import Source
    from ..bags.reader import Bag
    from ..config.units import quantity
    from ..errors import RigError

    if run.lower().endswith(".csv"):
        period = None if args.period is None else quantity(args.period, "time", "--period")
        box = config.transmission
        orders = None if args.orders is None else parse_orders(args.orders, box)
        return Source(run, read_logger_csv(run, period, orders, box, config.catalogue.signals), config.as_dict())
    bag = Bag(run)
    bag.check_began()
    if not bag.structure.gears:
        raise RigError(f"{run}: is of a rig without gears; runs with shifts can be compared")
    return Source(run, recording_of(bag, bag.transmission), bag.record)


def _lines(found: Comparison, box: Transmission, signals: Mapping[str, Signal]) -> list[str]:
    from ..analysis.report import columns_of
    from ..errors import printable

    lines = []
    for name, clock in list(zip(found.names, found.clocks))[1:]:
        lines.append(f"{name}: offset {clock.offset * 1e3:+.2f} ms, drift {clock.drift * 1e6:+.1f} ppm, by {clock.by}")
        if clock.rest > 1e-3:
            lines.append(f"  the times between orders differ by up to {clock.rest * 1e3:.1f} ms, by which later shifts lie apart")
    shown = {key: (heading, factor) for heading, key, factor, _ in columns_of(box)}
    lines += ["", "shift  metric            first       other  difference   in errors  recording"]
    for row in found.metrics:
        if row["metric"] in shown:
            heading, factor = shown[row["metric"]]
            cells = [_cell(row[key], factor) for key in ("first", "other", "difference")] + [_cell(row["in_errors"])]
            lines.append(f"{row['shift']:>5}  {heading:<14}" + "".join(f"{cell:>12}" for cell in cells) + f"  {row['run'] + 1}")
    lines += ["", "signal                 rms   in errors  recording"]
    for row in found.signals:
        if one := signals.get(row["signal"]):
            name = f"{one.name} {one.display_unit}"
            lines.append(f"{name:<14}{_cell(row['rms'], one.scale):>12}{_cell(row['in_errors']):>12}  {row['run'] + 1}")
    return [printable(line) for line in lines]


def _cell(value: float | None, factor: float = 1.0) -> str:
    return "-" if value is None else f"{value * factor:.4g}"
