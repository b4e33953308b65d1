#!/usr/bin/env python3
# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks that all bags below a folder, those of other programs, are read whole and copied byte for byte (README.md beside it).

Exit code 0 when all are, 1 when one is not, 2 when there is none.
"""

import contextlib
import io
import sys
import tempfile
from pathlib import Path

from rig_nodes.bags.opened import BAG_SUFFIXES, OpenedBags
from rig_nodes.cli.main import main


def bags_below(root):
    """Returns the bags: folders with metadata.yaml or numbered files, and single files elsewhere."""
    files = sorted(path for path in Path(root).rglob("*") if path.suffix in BAG_SUFFIXES)
    stems = {file: file.stem.rstrip("0123456789") for file in files}
    alone = {
        file.parent for file in files if len({(stems[other], other.suffix) for other in files if other.parent == file.parent}) > 1
    }
    return sorted({file if file.parent in alone else file.parent for file in files})


def rig(*arguments):
    """Returns exit code and output of a verb."""
    output = io.StringIO()
    with contextlib.redirect_stdout(output), contextlib.redirect_stderr(output):
        code = main([*map(str, arguments)])
    return code, output.getvalue()


def content(path):
    """Returns the messages with their channels, and how many the bag says it holds."""
    with OpenedBags([path]) as bags:
        rows = [(time, name, data, bags.channel(name)[:2]) for time, (name, data) in bags.timeline(bags.types)]
        return rows, sum(bags.stated.values()) or len(rows)


def faults_of(bag):
    """Returns what is wrong with the reading of a bag."""
    rows, stated = content(bag)
    code, said = rig("bag", "check", bag)
    faults = [f"check: {said}"] * bool(code) + [f"{len(rows)} messages of {stated}"] * (len(rows) != stated)
    for verb in ("recover", "cut", "merge") if rows else ():
        with tempfile.TemporaryDirectory() as folder:
            code, said = rig("bag", verb, bag, "--out", Path(folder, "out"))
            if code or content(Path(folder, "out"))[0] != rows:
                faults.append(f"{verb}: {said}")
    for verb in (["bag", "info", bag], ["report", bag], ["view", "--no-open", bag]):
        said = rig(*verb)[1]
        faults += [f"{verb[0]}: {said}"] * ("Traceback" in said)
    return faults


def work(root):
    """Checks all bags and returns the exit code."""
    bags = bags_below(root)
    found = {bag: faults_of(bag) for bag in bags}
    for bag, faults in found.items():
        for fault in faults:
            print(f"{bag}: {fault.strip()}")
    failed = sum(map(bool, found.values()))
    print(f"foreign bags: {'passed' if bags and not failed else 'failed'}: {len(bags)} bags, {failed} at fault")
    return 2 if not bags else 1 if failed else 0


if __name__ == "__main__":
    sys.exit(work(sys.argv[1]))
