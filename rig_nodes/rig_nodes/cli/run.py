# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""``rig run SEQUENCE``: a sequence on the node graph over real ROS 2, in real time, recorded to a bag."""

from __future__ import annotations

import argparse
import contextlib
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from ..base import STARTING, BagError, RigError, ended_by, optional, printable, quoted, waiting
from .run_arguments import above_zero, add_recording_arguments, add_shared_arguments, controller_of, exit_code, settings_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from ..nodes import End

HELP = "run a sequence on the ROS 2 node graph and record it"
NEEDS = ("ros",)
LIVE_VIEW_END = 2.0  # s within which the live view must end after the run


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the verb."""
    add_shared_arguments(parser, by_hand=True)
    add_recording_arguments(parser)
    parser.add_argument(
        "--speed",
        type=speed,
        metavar="FACTOR",
        help="lockstep at so many times real time, or max: every process waits for all the others "
        "(default: real time, no process waits)",
    )
    parser.add_argument(
        "--keep-domain", action="store_true", help="use the ROS domain of this terminal even when ROS_DOMAIN_ID is not set"
    )
    parser.add_argument("--view", action="store_true", help="show the run live in Rerun, in a process that the rig never waits for")
    parser.add_argument("--drop", metavar="TOPIC:N", help=argparse.SUPPRESS)


def speed(text: str) -> float:
    """Return the factor of --speed, inf for max."""
    return above_zero(text, "max")


def main(args: argparse.Namespace) -> int:
    """Check, warm up, run and report; return 0 only when the sequence was completed."""
    if args.view:
        optional("rerun", "view")  # before anything is written
    try:
        return run(args)
    except KeyboardInterrupt as stop:
        what, code = ended_by(stop)
        print(f"rig: {what} before the rig started; nothing was recorded", file=sys.stderr)
        return code


def run(args: argparse.Namespace) -> int:
    """Run as :func:`main` does; a KeyboardInterrupt before the first process starts is passed on."""
    from ..base import DEFAULT_RIG, rig_of
    from ..controllers import from_environment, level_line, load_controller, split_level
    from ..nodes import Order, Supervisor, parse_drop, processes_of, start_server, words
    from ..rig import load_rig
    from ..runs import (
        BY_HAND,
        Ordered,
        Rig,
        check_controller,
        check_delay,
        check_level,
        load_sequence,
        parse_parameters,
        run_folder,
        run_record,
        unless_empty,
        write_run,
    )

    args.controller = controller_of(args.controller, args.in_process)
    parameters = parse_parameters(args.parameters)
    if parameters and not args.sequence:
        raise RigError("--with gives values to a sequence's parameters; name the sequence too")
    rig = args.rig or rig_of(args.sequence, DEFAULT_RIG)
    config = load_rig(rig, settings_of(args, rig))
    sequence = load_sequence(args.sequence, parameters, rig, DEFAULT_RIG, config) if args.sequence else BY_HAND
    sequence.check_rig(config)
    parse_drop(args.drop, config.catalogue)
    recording = words(args)
    plug = None
    if config.structure.shifts:
        check_delay(args.delay, args.speed)
        # without the current loop the Alfa46 passes on its setpoints, which are also what simulate takes from it
        level = args.level or (None if args.controller or config.effects.current_loop else "current")
        controller = load_controller(args.controller, config, level)
        controller.close()
        check_level(config, controller.level)
        print(level_line(controller), flush=True)
        spec, level = split_level(args.controller or "alfa46", level)
        plug = spec if level is None else f"{spec}@{level}"
    else:
        if args.controller or args.level or args.delay != 1:
            check_controller(config)
        if args.view:
            raise RigError(
                f"--view: the live view shows a rig with gears; look at a run of '{config.name}' afterwards with ./rig view"
            )
    start_server()
    folder = run_folder(args.out, sequence.name if args.sequence else "by-hand")
    ordered = Ordered(config, rig, sequence if args.sequence else None, args.seed, args.delay, plug)
    with unless_empty(folder), waiting(STARTING):
        Rig(config, args.seed, "external" if args.speed is None else "plugged", level=None).advance_samples(1)
    with unless_empty(folder), from_environment(args.keep_domain) as domain:
        domain.lead()
        for device in config.cut_out:
            show(None, f"{device} is cut out; start it with: ./rig device {device} --domain {domain.number}")
        step_timeout, come_timeout = args.step_timeout
        order = Order(
            args.sequence,
            drop=args.drop,
            speed=args.speed,
            step_timeout=step_timeout,
            come_timeout=come_timeout,
            processes=processes_of(config.structure.shifts),
            recording=recording,
            run=write_run(folder, ordered),
        )
        supervisor = Supervisor(order, folder, domain, show)
        with live_view(domain.number) if args.view else contextlib.nullcontext():
            end = supervisor.run()
            # all processes have ended and the bag is complete; a late signal must not prevent the report
            for number in (signal.SIGINT, signal.SIGTERM):
                signal.signal(number, signal.SIG_IGN)
        record = run_record(config, sequence, args.seed, args.delay)
        code = finish(folder, record, end, supervisor.restarts, args.strict, args.allow_loss)  # `rig stop` waits for it
    return code if end.by == 0 else 128 + end.by


@contextlib.contextmanager
def live_view(domain: int) -> Iterator[None]:
    """Run `rig view --live` beside the run; its failures do not affect the run."""
    command = [sys.executable, "-P", "-m", "rig_nodes", "view", "--live", "--domain", str(domain), "--parent", str(os.getpid())]
    view = subprocess.Popen(command, stdin=subprocess.DEVNULL, start_new_session=True)
    try:
        yield
    finally:
        view.terminate()
        try:
            view.wait(LIVE_VIEW_END)
        except subprocess.TimeoutExpired:
            view.kill()
            view.wait()


def finish(folder: Path, record: dict, end: End, restarts: list[dict], strict: bool, allow_loss: bool) -> int:
    """Write and print the report of an ended run; return its exit code."""
    from ..analysis import build_report, format_report, gather, what_was_lost, write_report
    from ..nodes import join_pieces, run_part

    last = [] if end.state == "ended" else [end.reason]
    try:
        join_pieces(folder)
        bag = gather(folder, record, recover=True)
        report = build_report(bag, run_part(bag, folder, record, end, restarts))
    except BagError as error:
        return _say([*last, f"there is no report: {error}"], 1)
    try:
        write_report(folder, report)
    except RigError as error:
        last.append(str(error))
    print(format_report(report))
    if report["run"]["speed_factor"]:
        print(f"speed: {report['run']['speed_factor']:.2f} times real time")
    look = f"; look at it with: ./rig view {quoted(folder)}" if bag.began else ""
    print(f"written to {folder}{look}", flush=True)
    lost = what_was_lost(report["run"])
    if lost:
        last.append(f"warning: {lost}" if allow_loss else f"not whole: {lost}")
    code = exit_code(end.state, report, strict, "" if allow_loss else lost)
    return _say(last, 1 if end.state == "ended" and not (folder / "report.json").exists() else code)


def _say(clauses: list[str], code: int) -> int:
    """Print one sentence for all that went wrong, because all but the first clause usually follow from that."""
    if clauses:
        print(f"rig: {printable('; '.join(clauses))}", file=sys.stderr)
    return code


def show(t: float | None, text: str) -> None:
    """Print one line of progress, with simulated time when it is known."""
    print(f"{t:8.2f} s  {printable(text)}" if t is not None else f"            {printable(text)}", flush=True)
