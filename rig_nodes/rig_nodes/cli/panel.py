# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""``rig panel [RIG]``: the operator's page of a rig in the browser."""

from __future__ import annotations

import contextlib
import ipaddress
import os
import webbrowser
from typing import TYPE_CHECKING

from .by_hand import add_domain
from .shared_arguments import add_set

if TYPE_CHECKING:
    import argparse

HELP = "work a rig in the browser: start it, or join one that runs"
NEEDS = ("ros",)
PORT = 8460  # Alfa46


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument(
        "rig", nargs="?", help="rig, its folder or .yaml file, which is started (default: the rig that runs, else hydmag)"
    )
    add_domain(parser)
    parser.add_argument(
        "--port", type=int, metavar="N", help=f"port of the page, 0 for any free one (default: {PORT}, else a free one)"
    )
    parser.add_argument(
        "--address",
        default="127.0.0.1",
        metavar="IP",
        help="address on which the page listens (default: 127.0.0.1; with another one, e.g. 0.0.0.0, whoever has the printed "
        "address works the rig, and nothing is encrypted)",
    )
    parser.add_argument("--no-open", action="store_true", help="print the address and open no browser")
    add_set(parser, 'change one value of the rig that is started, e.g. alfa46.t12="200 ms"')
    parser.add_argument("--faults", action="store_true", help="enable faults of the rig that is started, as switches on the page")
    parser.add_argument("--controller", metavar="SPEC", help="your controller in place of the Alfa46, as for `rig run`")


def main(args: argparse.Namespace) -> int:
    """Serve the page until Ctrl-C; return 0."""
    from ..base import DEFAULT_RIG, RigError, find_config, optional
    from ..controllers import environment, from_environment, of_running_rig, running_rigs

    optional("tornado", "panel")
    try:
        ipaddress.ip_address(args.address)
    except ValueError:
        raise RigError(f"--address {args.address}: expected an IP address, e.g. 127.0.0.1") from None
    if args.port is not None and not 0 <= args.port <= 65535:
        raise RigError(f"--port {args.port}: expected a number from 0 to 65535")
    rigs = running_rigs()
    there = from_environment().number in rigs if os.environ.get("ROS_DOMAIN_ID") else rigs
    join = args.domain is not None or (args.rig is None and there)
    options = ["--faults"] * args.faults + (["--controller", args.controller] if args.controller else [])
    if join and (args.rig or args.settings or options):
        raise RigError("a rig that runs is joined as it is: leave away --domain, or the rig and its options")
    with of_running_rig(args.domain) if join else from_environment() as domain:
        wanted = environment(domain)
        for name in set(os.environ) - set(wanted):
            del os.environ[name]
        os.environ.update(wanted)
        # ROS reads the environment above when it is loaded or started.
        from ..nodes import OwnRig, PanelServer, listening

        try:
            sockets = listening(args.address, PORT if args.port is None else args.port)
        except RigError:
            if args.port is not None:
                raise
            sockets = listening(args.address, 0)
        if not join:
            find_config("rigs", args.rig or DEFAULT_RIG)
        own = None if join else OwnRig(args.rig or DEFAULT_RIG, args.settings, options, domain)
        server = PanelServer(domain.number, own, sockets)

        def greet(url: str) -> None:
            print(f"the page of the rig in ROS domain {domain.number}: {url}", flush=True)
            if not args.no_open:
                with contextlib.suppress(webbrowser.Error):
                    webbrowser.open(url)

        try:
            server.run(greet)
        finally:
            if own is not None:
                own.stop()
    return 0
