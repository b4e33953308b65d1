"""`rig report`: shift metrics and energy balance of a recorded run, computed anew from its bag, or of a logger's CSV.

Keeps what only the run itself knew (lateness, end) from the report that lies beside the bag. Writes nothing for a CSV.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from ..analysis.annex_a import FACTOR_B
from ..analysis.logger_csv import parse_orders, read_logger_csv
from ..analysis.report import build_report, format_report, read_report, report_of_recording, write_report
from ..bags.reader import Bag
from ..catalogue import kind_of_topics
from ..config.units import quantity
from ..errors import BagError, RigError
from ..graph.result import end_of, facts_of, run_part

HELP = "print the shift metrics of a run"


def add_arguments(parser) -> None:
    """The arguments of the verb."""
    parser.add_argument("run", metavar="RUN", help="folder of a run, its .mcap file, or a logger's .csv file")
    parser.add_argument("--json", action="store_true", help="print the report as JSON instead of a table")
    parser.add_argument("--annex-a", action="store_true",
                        help="also by the recipe of the laboratory's program (Annex A), with the difference")
    parser.add_argument("--factor", type=float, metavar="B",
                        help=f"Annex A's factor of the settled torque ({FACTOR_B})")
    parser.add_argument("--truth", action="store_true", help="also what the plant's states in the bag say")
    parser.add_argument("--orders", metavar="LIST",
                        help="for a CSV: when (s) which gear was ordered, e.g. '3.845:I-II, 8.32:II-I'")
    parser.add_argument("--period", metavar="TIME", help="for a CSV without times: between its rows, e.g. '0.1 ms'")


def main(args) -> int:
    """Compute the report, write it beside the bag, print it."""
    if args.factor is not None and not args.annex_a:
        raise RigError("--factor is Annex A's; give --annex-a too")
    if args.factor is not None and not args.factor > 1.0:
        raise RigError(f"--factor is {args.factor:g}; it is the upper edge of a band around the settled torque, e.g. "
                       f"{FACTOR_B}")
    annex = (FACTOR_B if args.factor is None else args.factor) if args.annex_a else None
    report = _report_of_csv(args, annex) if args.run.lower().endswith(".csv") else _report_of_bag(args, annex)
    print(json.dumps(report, indent=2, ensure_ascii=False) if args.json else format_report(report))
    return 0


def _report_of_csv(args, annex: float | None) -> dict:
    if args.truth:
        raise RigError(f"{args.run}: a logger's CSV holds no states of a plant; --truth is for bags")
    period = None if args.period is None else quantity(args.period, "time", "--period")
    orders = None if args.orders is None else parse_orders(args.orders)
    return report_of_recording(read_logger_csv(args.run, period, orders), annex)


def _report_of_bag(args, annex: float | None) -> dict:
    for option in ("orders", "period"):
        if getattr(args, option) is not None:
            raise RigError(f"--{option} is for a logger's .csv; a bag has its own")
    bag = open_bag(args.run)
    bag.check_began()
    if bag.recovered:
        print(f"rig: {bag.recovered}", file=sys.stderr)
    path = Path(args.run)
    folder = path if path.is_dir() else path.parent
    old = read_report(folder)
    report = build_report(bag, old["run"] if old else _run_of(bag, folder), annex, args.truth)
    write_report(folder, report)
    return report


def open_bag(run: str) -> Bag:
    """The bag of a run; of a damaged one, what is whole."""
    try:
        return Bag(run)
    except BagError:
        return Bag(run, recover=True)


def _run_of(bag, folder: Path) -> dict:
    """What bag and logs say about a run without a report: by a launch file, or with a killed supervisor."""
    info = bag.run_info()
    known = info if "configuration" in info else {"configuration": info or None}
    if facts := facts_of(folder):
        return run_part(bag, folder, known, end_of(facts, kind_of_topics(bag.counts)))
    return {**known, "end": {"reason": "the run left no report"}}
