# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""``rig check RIG``: the content of a rig's folder, its errors with their place, and its driveline as a picture."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ..base import RIG_FILE, find_config
from .output_files import KINDS, OutputFile, may_write

if TYPE_CHECKING:
    import argparse

PICTURE = "picture.svg"  # which rig list rigs names, too
HELP = "check the folder of a rig and draw its driveline"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument("rig", metavar="RIG", help="folder of a rig, its file, or the name of an installed one")
    parser.add_argument(
        "--picture",
        type=OutputFile("svg"),
        metavar="FILE.svg",
        help="where the picture goes, an .svg file (default: picture.svg in the rig's folder)",
    )


def main(args: argparse.Namespace) -> int:
    """Check a rig and return 0 when a run can begin; an error is one sentence with file and line."""
    from ..api import checked, load

    rig = load(args.rig)
    for line in checked(rig.source, rig.config):
        print(line)
    picture = args.picture or _beside(args.rig)
    may_write("--picture", picture, KINDS["svg"], args)
    print(f"picture of the driveline: {picture}{' (written)' if rig.draw(picture) else ''}")
    return 0


def _beside(rig: str) -> Path:
    """Return where the picture of a rig lies: in its folder, by the name of its file where that is not the folder's only one."""
    path = find_config("rigs", rig)
    return path.with_name(PICTURE) if path.name == RIG_FILE else path.with_suffix(".svg")
