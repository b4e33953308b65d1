# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""``rig controller check PLUG`` tests whether a controller fits the rig; ``rig controller new KIND DIR`` writes a template."""

from __future__ import annotations

import json
import re
from collections import Counter
from typing import TYPE_CHECKING

from ..base import DEFAULT_RIG, ProgressLine, RigError, atomic_write, optional
from .output_files import OutputFile
from .run_arguments import StepTimeout, add_in_process, controller_of, step_timeout
from .shared_arguments import add_rig

if TYPE_CHECKING:
    import argparse

    from ..controllers import Plug
    from ..rig import RigConfig

COME = 20.0  # s within which a controller that is a separate program must connect
MARKS, NOT_RUN = {True: "ok", False: "FAILED", None: "-"}, "not run"
HELP = "check a shift controller of your own, or start one from a template"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the verb."""
    from ..controllers import TEMPLATES

    verbs = parser.add_subparsers(dest="what", required=True, metavar="WHAT", parser_class=type(parser))
    check = verbs.add_parser("check", help="run a controller through the conformance set", allow_abbrev=False)
    check.add_argument("spec", metavar="PLUG", help="as for --controller, e.g. c:my_controller.c (docs/how_to/controllers.md)")
    check.add_argument("--level", choices=("duty", "current"), help="what it returns, if it can return both")
    add_rig(check)
    check.add_argument(
        "--step-timeout",
        type=step_timeout,
        default=StepTimeout(5.0, COME),
        metavar="S",
        help=f"seconds that it may take for one sample, and to come, or none (default: 5, and {COME:.0f} to come)",
    )
    add_in_process(check)
    check.add_argument(
        "--faults",
        action="store_true",
        help="shift with each fault of the rig instead: tripped in time, shifted well, shifted badly, did harm or failed itself",
    )
    check.add_argument("--only", metavar="NAMES", help="with --faults: those with these names, e.g. 'motor.*,messages.late'")
    check.add_argument(
        "--html", type=OutputFile("page"), metavar="FILE", help="with --faults: write the table as one self-contained page"
    )
    check.add_argument("--json", action="store_true", help="print the table as JSON")
    new = verbs.add_parser("new", help="write a template that shifts", allow_abbrev=False)
    new.add_argument("kind", choices=sorted(TEMPLATES), help="what it is: " + ", ".join(TEMPLATES))
    new.add_argument("folder", metavar="DIR", help="new or empty folder for it")
    add_rig(new, "rig, its folder or .yaml file, that it is for")


def main(args: argparse.Namespace) -> int:
    """Run the sub-verb; return 0 when everything passed, 1 when something failed."""
    return check(args) if args.what == "check" else new(args)


def check(args: argparse.Namespace) -> int:
    """Run the set of tests and print its table."""
    from ..rig import load_gearbox_rig
    from ..runs import Check

    quiet = args.json
    say = (lambda text: None) if quiet else (lambda text: print(f"        {text}", flush=True))
    if args.only is not None and not args.faults:
        raise RigError("--only names faults, so it goes with --faults")
    if args.html is not None and not args.faults:
        raise RigError("--html is the page of the shifts with faults; give --faults too")
    config = load_gearbox_rig(args.rig, None, "controller check")
    if args.faults:
        return check_faults(args, config)
    items = []
    step_timeout, come_timeout = args.step_timeout
    for item in Check(controller_of(args.spec, args.in_process), config, args.level, step_timeout, come_timeout, say).items():
        items.append(item)
        if not quiet:
            print(f"{MARKS[item.ok] if item.run else NOT_RUN:<8}{item.name:<15}{item.text}", flush=True)
    failed, aside = (sum(item.ok is found and item.run for item in items) for found in (False, None))
    not_run = sum(not item.run for item in items)
    if quiet:
        table = [item._asdict() for item in items]
        print(json.dumps({"controller": args.spec, "ok": not failed, "items": table}, indent=1))
    else:
        asked = len(items) - aside
        not_for_it = f", {aside} do not apply to a controller with its own clock" if aside else ""
        print(f"{asked - failed - not_run} of {asked} passed{f', {not_run} not run' if not_run else ''}{not_for_it}")
    return 1 if failed else 0


def check_faults(args: argparse.Namespace, config: RigConfig) -> int:
    """Shift with each fault, print what became of it and write its page; the table is no verdict, so the exit code is 0."""
    from ..controllers import load_controller
    from ..runs import check_under_faults

    if args.html is not None:
        optional("jinja2")  # a page that cannot be made is refused before the shifts
    spec, rows = controller_of(args.spec, args.in_process), []

    def load(rig: RigConfig) -> Plug:
        controller = load_controller(spec, rig, args.level)
        controller.pace(args.step_timeout.step)
        controller.wait(args.step_timeout.come)
        return controller

    line = ProgressLine() if args.json else None
    for one in check_under_faults(load, config, "*" if args.only is None else args.only):
        rows.append(one)
        if line is not None:
            line.show(len(rows), f"shift {len(rows)}: {one.fault or 'no fault'}")
        else:
            print(f"{one.outcome:<17}{one.fault or 'no fault':<27}{one.text}", flush=True)
    if line is not None:
        line.leave()
    counts = Counter(one.outcome for one in rows[1:])
    if args.json:
        print(json.dumps({"controller": args.spec, "counts": counts, "faults": [one._asdict() for one in rows]}, indent=1))
    else:
        print(f"{len(rows) - 1} faults: {', '.join(f'{outcome} {count}' for outcome, count in counts.most_common())}")
    if args.html is not None:
        from ..view import faults_page

        atomic_write(args.html, faults_page(args.spec, config, rows))
    return 0


def new(args: argparse.Namespace) -> int:
    """Write the template and print the next steps."""
    from ..base import quoted
    from ..controllers import record_of, write_template
    from ..rig import load_gearbox_rig

    record = record_of(load_gearbox_rig(args.rig, None, "controller new"))
    files, commands = write_template(args.kind, args.folder, record)
    print("\n".join(f"wrote {path}" for path in files))
    print("next:")
    given = "" if args.rig == DEFAULT_RIG else f" --rig {quoted(args.rig)}"
    for command in commands:
        print(
            "    " + re.sub(r"^(\./rig (?:controller check|simulate demo|export [\w-]+))", lambda found: found[1] + given, command)
        )
    return 0
