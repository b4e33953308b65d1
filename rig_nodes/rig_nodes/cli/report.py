"""`rig report`: shift metrics and energy balance of a recorded run, computed anew from its bag.

Keeps what only the run itself knew (lateness, end) from the report that lies beside the bag.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from ..analysis.report import build_report, format_report, read_report, write_report
from ..bags.reader import Bag
from ..errors import BagError
from ..graph.result import end_of, facts_of, run_part

HELP = "print the shift metrics of a run"


def add_arguments(parser) -> None:
    """The arguments of the verb."""
    parser.add_argument("run", metavar="RUN", help="folder of a run, or its .mcap file")
    parser.add_argument("--json", action="store_true", help="print the report as JSON instead of a table")


def main(args) -> int:
    """Compute the report from the bag, write it beside the bag, print it."""
    bag = open_bag(args.run)
    if bag.recovered:
        print(f"rig: {bag.recovered}", file=sys.stderr)
    path = Path(args.run)
    folder = path if path.is_dir() else path.parent
    old = read_report(folder)
    report = build_report(bag, old["run"] if old else _run_of(bag, folder))
    write_report(folder, report)
    print(json.dumps(report, indent=2, ensure_ascii=False) if args.json else format_report(report))
    return 0


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
        return run_part(bag, folder, known, end_of(facts))
    return {**known, "end": {"reason": "the run left no report"}}
