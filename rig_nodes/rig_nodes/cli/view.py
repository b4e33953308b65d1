# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rig view`: a recorded run or a running rig in Rerun, as a picture, or as a layout for another program."""

from __future__ import annotations

import argparse
import ctypes
import math
import os
import signal
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from ..base import number_within
from .output_files import KINDS, OutputFile, may_write

if TYPE_CHECKING:
    from ..controllers import Domain
    from ..view import View

HELP = "show a run or a running rig in Rerun, or make a picture"
TOOLS = ("plotjuggler", "foxglove")
PR_SET_PDEATHSIG = 1
LOST = 3  # exit code: shown, but the bag is damaged or was cut off


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument("run", metavar="RUN", nargs="?", help="folder of a run, or its .mcap file")
    parser.add_argument(
        "--no-open", action="store_true", help="only write view.rrd; with --live: open no viewer, only print the address"
    )
    parser.add_argument("--picture", metavar="FILE.png", type=OutputFile("png"), help="make a picture instead of opening a window")
    parser.add_argument(
        "--tab",
        metavar="NAME",
        help="tab to make the picture of: shifts, valve, coast_down, run, other, controller, or a page of the rig's own "
        "(default: the one that the view opens with)",
    )
    parser.add_argument("--window", metavar="T0,T1", type=_window, help="time in s to read and to show (default: the whole run)")
    parser.add_argument(
        "--shift",
        metavar="N",
        type=_shifts,
        help="shifts to show close up: a number of the report's table, several as 2,5, or all, laid over each other at their "
        "orders (default: the first up and the first down)",
    )
    parser.add_argument(
        "--theme",
        choices=("dark", "light"),
        help="ground of a picture (default: dark) or of the window (default: as chosen in the viewer's settings)",
    )
    live = parser.add_argument_group("a running rig")
    live.add_argument("--live", action="store_true", help="show a rig that runs now, until Ctrl-C")
    live.add_argument("--domain", metavar="N", type=_domain, help="its ROS domain (default: ROS_DOMAIN_ID, or the only one in use)")
    live.add_argument("--viewer", action="store_true", help="open a viewer though no display is found")
    live.add_argument("--port", metavar="P", type=_port, help="port for viewers on 127.0.0.1 (default: 9876, or a free one)")
    live.add_argument("--seconds", metavar="S", type=_seconds, default=10.0, help="seconds that the plots show (default: 10)")
    live.add_argument("--parent", type=int, help=argparse.SUPPRESS)
    other = parser.add_argument_group("another program")
    other.add_argument("--layout", choices=TOOLS, help="write a layout for this program")
    other.add_argument("--rig", metavar="NAME", help="rig or .yaml file whose signals it shows (default: hydmag)")
    other.add_argument(
        "--out", metavar="FILE", type=OutputFile(lambda args: args.layout), help="its file (default: rig.xml or rig.json)"
    )


def main(args: argparse.Namespace) -> int:
    """Show a run, show a running rig, or write a layout."""
    from ..base import RigError

    given = [args.run is not None, args.live, args.layout is not None]
    if sum(given) != 1:
        raise RigError("give one of these: the folder of a run, --live, or --layout (see 'rig view --help')")
    wrong = [
        flag
        for flag, value, fits in (
            ("--picture", args.picture, args.run),
            ("--tab", args.tab, args.picture),
            ("--window", args.window, args.run),
            ("--shift", args.shift, args.run),
            ("--theme", args.theme, args.run or args.live),
            ("--domain", args.domain is not None, args.live),
            ("--viewer", args.viewer, args.live),
            ("--port", args.port, args.live),
            ("--out", args.out, args.layout),
            ("--rig", args.rig, args.layout),
            ("--no-open", args.no_open, args.run or args.live),
        )
        if value and not fits
    ]
    if wrong:
        needed = {
            "--tab": "--picture",
            "--out": "--layout",
            "--rig": "--layout",
            "--picture": "a run",
            "--window": "a run",
            "--shift": "a run",
            "--no-open": "a run or --live",
            "--theme": "a run or --live",
        }.get(wrong[0], "--live")
        raise RigError(f"{wrong[0]} goes with {needed} only")
    if args.live:
        return _live(args)
    return _layout(args) if args.layout else _recorded(args)


def _recorded(args: argparse.Namespace) -> int:
    """Write the view, then show it, draw it, or print its place."""
    from ..base import RigError, quoted
    from ..view import command_for, has_display, make_view, open_window
    from .report_of_runs import is_folder_of_runs

    if is_folder_of_runs(Path(args.run)):
        figure = f"their figures are made by ./rig report {quoted(args.run)} --html FILE"
        raise RigError(f"{args.run}: is a folder of runs; {figure}, and one run is looked at by ./rig view {quoted(args.run)}/RUN")
    if args.picture and not args.window and (drawn := _draw_close(args)):
        return _tell_notes(drawn)
    view = make_view(args.run, args.window, args.shift)
    path, code = view.path, _tell_notes(view)
    print(f"{path} {'written' if view.written else 'is up to date'}", flush=True)
    if args.picture:
        _draw(args, path, args.picture)
    elif args.no_open:
        pass
    elif has_display():
        print(f"the viewer runs as process {open_window(path, args.theme)}")
    else:
        print(f"no display here; copy {path} to a machine with one and open it there with: {command_for(path.name)}", flush=True)
        try:
            _draw(args, path, path.with_suffix(".png"))
        except RigError as error:
            # the view itself is written, so a picture that was not requested is no reason to fail
            print(f"rig: {error}", file=sys.stderr)
    return code


def _tell_notes(view: View) -> int:
    """Print what the bag of a view lacks; return 3 for one that was cut off or is damaged."""
    from ..base import printable

    for note in view.notes:
        print(f"rig: {printable(note)}", file=sys.stderr)
    return LOST if view.faulty else 0


def _draw(args: argparse.Namespace, view: Path, picture: Path) -> None:
    from ..view import make_tab_view, require_driver

    require_driver()
    with tempfile.TemporaryDirectory(prefix="rig-view-") as folder:
        one_tab = Path(folder, "picture.rrd")
        make_tab_view(view, args.run, args.window, one_tab, args.tab, args.shift)
        _take(args, one_tab, picture)


def _take(args: argparse.Namespace, view: Path, picture: Path) -> None:
    from ..view import take_picture

    for sentence in take_picture(view, picture, light=args.theme == "light"):
        print(f"rig: the viewer reports {sentence}", file=sys.stderr)
    print(f"picture: {picture}")


def _draw_close(args: argparse.Namespace) -> View | None:
    """Draw the tab of the shifts from their own stretches of the bag; return None for another tab."""
    from ..view import make_close_view, require_driver

    with tempfile.TemporaryDirectory(prefix="rig-view-") as folder:
        path = Path(folder, "picture.rrd")
        view = make_close_view(args.run, path, args.tab, args.shift)
        if view is not None:
            require_driver()
            _take(args, path, args.picture)
    return view


def _live(args: argparse.Namespace) -> int:
    """Show a running rig until the verb is ended, then return 0, because this is its normal end."""
    from ..base import need_ros
    from ..controllers import environment
    from ..view import import_rerun

    if args.parent is not None:
        # a live view that a run started must not outlive the run
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGTERM, 0, 0, 0)
        if os.getppid() != args.parent:
            return 0
    import_rerun()
    need_ros("rig view without a run")
    domain = _find_domain(args.domain)
    wanted = environment(domain)
    for name in set(os.environ) - set(wanted):
        del os.environ[name]
    os.environ.update(wanted)
    # ROS reads the environment above when it is loaded or started.
    from ..nodes import LiveSession

    LiveSession(domain.number, _say).run(args.port, args.seconds, lambda url: _greet(args, domain.number, url))
    return 0


def _say(text: str) -> None:
    print(text, flush=True)


def _find_domain(number: int | None) -> Domain:
    """Return the domain to show; RigError when it is not clear which."""
    from ..base import RigError
    from ..controllers import Domain, busy_domains, from_environment

    if number is not None:
        return Domain(number)
    if os.environ.get("ROS_DOMAIN_ID"):
        return from_environment()
    busy = sorted(busy_domains())
    if len(busy) == 1:
        return Domain(busy[0])
    if busy:
        raise RigError(
            f"ROS domains {', '.join(map(str, busy))} are in use on this machine; "
            f"choose one with --domain N ('rig run' prints its own)"
        )
    raise RigError("no ROS domain is in use on this machine; start './rig run SEQUENCE' first, or choose a domain with --domain N")


def _greet(args: argparse.Namespace, domain: int, url: str) -> None:
    """Print where viewers connect, and open one when there is a display."""
    from ..base import RigError
    from ..view import command_for, has_display, open_window

    _say(f"live view of ROS domain {domain}; viewers on this machine connect with: {command_for(url)}")
    if args.viewer or (has_display() and not args.no_open):
        try:
            _say(f"a viewer runs as process {open_window(url, args.theme)}")
        except RigError as error:
            # others may still connect
            print(f"rig: {str(error).partition('; ')[0]}", file=sys.stderr, flush=True)


def _layout(args: argparse.Namespace) -> int:
    from ..base import DEFAULT_RIG
    from ..rig import load_rig
    from ..view import Pages, write_layout

    pages = Pages(load_rig(args.rig or DEFAULT_RIG).as_dict())
    path = args.out
    if path is None:
        path = Path("rig.xml" if args.layout == "plotjuggler" else "rig.json")
        may_write("--out", path, KINDS[args.layout], args)
    write_layout(args.layout, path, pages)
    print(f"{path} written")
    return 0


def _shifts(text: str) -> str | list[int]:
    if text == "all":
        return text
    parts = text.split(",")
    if not all(part.isdecimal() and 0 < int(part) < 10**6 for part in parts):
        raise argparse.ArgumentTypeError(f"{text} is no shift; give a number from 1, several as 2,5, or all")
    return list(dict.fromkeys(int(part) for part in parts))


def _window(text: str) -> tuple[float, float]:
    try:
        start, end = (float(part) for part in text.split(","))
    except ValueError:
        start = end = math.nan
    if not (math.isfinite(start) and math.isfinite(end) and start < end):
        raise argparse.ArgumentTypeError(f"{text} is no window; write its start and end in s, e.g. 3.6,5.4")
    return start, end


def _domain(text: str) -> int:
    return _whole(text, "ROS domain", 0, 232)


def _port(text: str) -> int:
    return _whole(text, "port", 1, 65535)


def _whole(text: str, what: str, low: int, high: int) -> int:
    if not text.isdecimal() or not low <= int(text) <= high:
        raise argparse.ArgumentTypeError(f"{text} is no {what}; give a number from {low} to {high}")
    return int(text)


def _seconds(text: str) -> float:
    return number_within(text, "span of a plot; give 0.1 to 600 s", 0.1, 600.0)
