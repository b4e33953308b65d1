# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A disk that becomes full, and a bag that is cut or made read-only, at any moment of a run: a sentence, and a bag that verbs read.

`./rig test -m campaign tests/graph/test_disk_at_its_limits.py` prints the figures.
"""

import contextlib
import os
import random
import tempfile
import time
from pathlib import Path

import pytest
from campaigns import Left, length_of, line_of_the_end, part_of, read_by_verbs, show
from running_graph import SHORT, RigRun

from rig_nodes.bags.reader import Bag
from rig_nodes.base import RigError

pytestmark = [pytest.mark.against_the_clock, pytest.mark.campaign]

MOMENTS = 10
WHOLE = 900  # kB, less than what a run takes in any layout
LAST = 0.8  # of the length of a run, before which something is done to its disk
ENOUGH = 20_000  # kB
LAYOUTS: tuple[tuple[str, ...], ...] = ((), (), ("--max-bag-size", "100000"), ("--compression-mode", "file"), ("--keep-last", "2"))
REAL_TIME, LOCKSTEP = ((), SHORT), (("--speed", "max"), "demo")
both = pytest.mark.parametrize("how", [REAL_TIME, LOCKSTEP], ids=["real time", "lockstep"])


def sealed(folder) -> bool:
    """Returns True when the bag in a folder is whole without recovery."""
    try:
        return Bag(folder).end is not None
    except RigError:
        return False


def check(code, output, folder, made, capsys):
    """Asserts that a run ended with one sentence or had room enough, and that verbs read what it left.

    Returns
    -------
    bool or None
        Whether its bag is sealed; None without a bag.
    """
    if code in (0, 3):  # 3: this machine did not keep time
        assert "messages lost: 0" in output and "did not reach the bag" not in output, output
    else:
        line_of_the_end(output)
        assert code == 1, output
    if not list(folder.glob("*.mcap*")):
        return None
    read_by_verbs(folder, made, capsys)
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


def at_moments(how, disks, tmp_path, act, capsys):
    """Runs several times, each in a place of its own to which ``act`` does something; returns how each ended, as check does."""
    arguments, sequence = how
    count, draw, found = part_of(MOMENTS), random.Random(f"{act.__name__} {how}"), []
    longest = LAST * length_of(RigRun(tmp_path / "whole", *arguments, sequence=sequence))
    for number in range(3 * count):
        if len(found) == count:
            break
        with disks(ENOUGH) as disk:
            run = RigRun(disk / "run", *arguments, *LAYOUTS[number % len(LAYOUTS)], sequence=sequence)
            run.until("all nodes are connected")
            left = Left(run.process.pid)
            moment = draw.uniform(0.0, longest)
            time.sleep(moment)  # it is the condition of the test
            over = "recorder" not in run.children()
            if not over:
                act(run.folder)
            code, output = run.end()
            left.check()
            if over:  # of the run, before anything was done
                continue
            found.append((code, check(code, output, run.folder, tmp_path / f"{number}_made", capsys)))
            show(capsys, f"{act.__name__} after {moment:.2f} s: exit code {code}, sealed {found[-1][1]}: {output.splitlines()[-1]}")
    assert len(found) == count, "too many runs were over before"
    return found


@both
def test_a_disk_on_which_a_run_has_too_little_room_is_named(small_disk, tmp_path, how, capsys):
    (arguments, sequence), found = how, []
    for number in range(0, MOMENTS, max(1, MOMENTS // part_of(MOMENTS))):
        room = round(WHOLE * number / MOMENTS)
        with small_disk(room) as disk:
            run = RigRun(disk / "run", *arguments, *LAYOUTS[number % len(LAYOUTS)], sequence=sequence)
            code, output = run.end()
            found.append(check(code, output, run.folder, tmp_path / f"{number}_made", capsys))
            show(capsys, f"{room} kB: exit code {code}, sealed {found[-1]}: {output.splitlines()[-1]}")
    assert False not in found


@both
def test_a_disk_that_another_program_fills_at_once_is_named(small_disk, tmp_path, how, capsys):
    def filled(folder):
        fill(folder.parent)

    # the rest of a short run may fit into the room that is kept for a bag
    assert all(whole is not False for _, whole in at_moments(how, small_disk, tmp_path, filled, capsys))


@both
def test_a_bag_that_is_cut_from_outside_ends_the_run_with_a_sentence(small_disk, tmp_path, how, capsys):
    def cut(folder):
        newest = max(folder.glob("*.mcap"), key=lambda path: path.stat().st_mtime)
        os.truncate(newest, newest.stat().st_size // 2)

    ends = at_moments(how, small_disk, tmp_path, cut, capsys)
    assert all(code == 1 or whole for code, whole in ends), "what is called whole is it"


@both
def test_a_folder_that_becomes_read_only_ends_the_run_with_a_sealed_bag(tmp_path, how, read_only, capsys):
    def folders(_size):
        return contextlib.nullcontext(Path(tempfile.mkdtemp(dir=tmp_path)))

    def made_read_only(folder):
        read_only(folder)

    assert all(whole for _, whole in at_moments(how, folders, tmp_path, made_read_only, capsys))
