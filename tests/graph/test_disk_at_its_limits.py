# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A disk that becomes full at any moment of a run: a sentence, and a bag that verbs read.

`./rig test -m campaign tests/graph/test_disk_at_its_limits.py` prints the figures.
"""

import os
import random
import time

import pytest
from running_graph import SHORT, RigRun, Traces

from rig_nodes.bags.reader import Bag
from rig_nodes.base import RigError
from rig_nodes.cli.main import main

pytestmark = [pytest.mark.against_the_clock, pytest.mark.campaign]

MOMENTS = 10
WHOLE = 900  # kB, less than what a run takes in any layout
# s after the nodes are connected within which the disk becomes full, which is before the end of the run
LONGEST = {"1": 3.0, "max": 0.5}
LAYOUTS: tuple[tuple[str, ...], ...] = ((), (), ("--max-bag-size", "100000"), ("--compression-mode", "file"), ("--keep-last", "2"))


def sealed(folder) -> bool:
    """Returns True when the bag in a folder is whole without recovery."""
    try:
        return Bag(folder).end is not None
    except RigError:
        return False


def check(code, output, folder, capsys, fitted=False):
    """Asserts that a run ended with one sentence, and that verbs read what it left; returns whether its bag is sealed.

    ``fitted`` is True where the run may have had room enough.
    """
    assert "Traceback" not in output, output
    if fitted and code == 0:
        assert "messages lost: 0" in output
    else:
        said = [line for line in output.splitlines() if line.startswith("rig: ")]
        assert code == 1 and len(said) == 1 and said[0] == output.splitlines()[-1], output
    if not list(folder.glob("*.mcap*")):
        return None
    for verb in (["report"], ["bag", "check"], ["bag", "hash"]):
        assert main([*verb, str(folder)]) in (0, 1, 2, 3), verb
    said = capsys.readouterr()
    assert "Traceback" not in said.out + said.err
    return sealed(folder)


def fill(disk):
    """Takes all that is left of a disk, as another program may do at once."""
    with open(disk / "others", "ab", buffering=0) as file:
        for size in (1 << 16, 1 << 12, 1):
            try:
                while True:
                    file.write(os.urandom(size))
            except OSError:
                continue


@pytest.mark.parametrize("speed", ["1", "max"])
def test_a_disk_on_which_a_run_has_too_little_room_is_named(small_disk, speed, capsys):
    found = []
    for number in range(MOMENTS):
        room = round(WHOLE * number / MOMENTS)
        with small_disk(room) as disk:
            run = RigRun(disk / "run", "--speed", speed, *LAYOUTS[number % len(LAYOUTS)])
            code, output = run.end()
            found.append((room, check(code, output, run.folder, capsys, fitted=True)))
    with capsys.disabled():
        print(f"\nroom [kB] and whether the bag is sealed, at speed {speed}: {found}")
    assert all(whole is not False for _, whole in found)


@pytest.mark.parametrize("speed", ["1", "max"])
def test_a_disk_that_another_program_fills_at_once_is_named(small_disk, speed, capsys):
    draw, found = random.Random(f"full {speed}"), []
    for number in range(MOMENTS):
        with small_disk(20_000) as disk:
            run = RigRun(
                disk / "run", "--speed", speed, *LAYOUTS[number % len(LAYOUTS)], sequence=SHORT if speed == "1" else "demo"
            )
            run.until("all nodes are connected")
            traces = Traces(run)
            time.sleep(draw.uniform(0.0, LONGEST[speed]))  # the moment is the condition of the test
            fill(disk)
            code, output = run.end()
            traces.wait_gone()
            # the rest of a short run may fit into the room that is kept for a bag
            found.append(check(code, output, run.folder, capsys, fitted=True))
    with capsys.disabled():
        print(f"\nwhether the bag is sealed after the disk became full at once, at speed {speed}: {found}")
    assert all(whole is not False for whole in found)
