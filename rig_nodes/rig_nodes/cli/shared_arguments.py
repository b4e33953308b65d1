# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The arguments that many verbs share: the rig, changed values, and a result as JSON."""

from __future__ import annotations

import argparse

from ..base import DEFAULT_RIG, RigError
from .output_files import OutputFile


def add_dark(parser: argparse.ArgumentParser) -> None:
    """Add --dark, the ground of --picture."""
    parser.add_argument("--dark", action="store_true", help="draw --picture on a dark ground")


def check_dark(args: argparse.Namespace) -> None:
    """Refuse --dark without a picture."""
    if args.dark and args.picture is None:
        raise RigError("--dark is the ground of --picture; give --picture too")


def add_rig(parser: argparse.ArgumentParser, what: str = "rig, its folder or .yaml file") -> None:
    """Add --rig with the default rig; ``what`` says what is named."""
    parser.add_argument("--rig", default=DEFAULT_RIG, metavar="NAME", help=f"{what} (default: {DEFAULT_RIG})")


def add_list(parser: argparse.ArgumentParser, option: str, metavar: str, name: str, what: str) -> None:
    """Add an option that may be repeated, whose texts are the list ``name``; ``what`` says what one of them does."""
    parser.add_argument(option, action="append", default=[], metavar=metavar, dest=name, help=f"{what} (may be repeated)")


def add_set(parser: argparse.ArgumentParser, what: str = "change one value of the rig, as for run") -> None:
    """Add --set; ``what`` says what one of its texts does."""
    add_list(parser, "--set", "KEY=VALUE", "settings", what)


def add_json(parser: argparse.ArgumentParser, what: str) -> None:
    """Add --json FILE, where - is stdout; ``what`` says what is written."""
    parser.add_argument("--json", type=OutputFile("json", to_stdout=True), metavar="FILE", help=what)
