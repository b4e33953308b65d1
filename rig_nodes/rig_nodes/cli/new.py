# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""``rig new rig FOLDER``: a folder of a new rig that runs and shifts, as a starting point."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import argparse

HELP = "write the folder of a rig of your own to begin with"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the verb."""
    verbs = parser.add_subparsers(dest="what", required=True, metavar="WHAT", parser_class=type(parser))
    rig = verbs.add_parser("rig", help="a two-speed gearbox with comments that explain each part", allow_abbrev=False)
    rig.add_argument("folder", metavar="FOLDER", help="new or empty folder for it")


def main(args: argparse.Namespace) -> int:
    """Write the files and print the next steps."""
    import shutil

    from ..base import TEMPLATE_DIR, RigError, no_file, not_written, quoted

    folder = Path(args.folder)
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        why = "it is not empty" if folder.is_dir() else "it is a file"
        raise RigError(f"{folder}: {why}, expected a new or empty folder")
    if not TEMPLATE_DIR.is_dir():
        raise RigError(f"{TEMPLATE_DIR}: {no_file(TEMPLATE_DIR)}")
    try:
        for path in sorted(TEMPLATE_DIR.rglob("*.yaml")):
            into = folder / path.relative_to(TEMPLATE_DIR)
            into.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, into)
            print(f"wrote {into}")
    except OSError as error:
        raise not_written(folder, error) from None
    print("next:")
    for what in (f"./rig {verb} {quoted(folder)}" for verb in ("check", "simulate demo --rig", "run demo --rig")):
        print(f"    {what}")
    return 0
