# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Every process of a run is killed at random moments: one sentence, a bag that verbs read, and nothing left on the machine.

`./rig test -m campaign tests/graph/test_killed_at_random.py` prints the figures.
"""

import json
import os
import random
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest
from campaigns import Left, family, kill, length_of, line_of_the_end, part_of, read_by_verbs, server_of, show
from running_graph import SHORT, RigRun

from rig_nodes.bags.reader import Bag

pytestmark = [pytest.mark.against_the_clock, pytest.mark.campaign]

TAIL = 0.2  # s: what a killed recorder may not have written
LAST = 0.9  # of the length of a run, before which the kill comes
REAL_TIME, LOCKSTEP = ((), SHORT), (("--speed", "max"), "demo")
CONTROLLER = "python:rig_nodes.controllers.examples.alfa46:Alfa46"
GONE = "rig: the shift controller's process has ended"
SENTENCES = {  # what the last line of a run tells, where that is not that the process was killed by signal 9
    "alfa46": rf"alfa46 killed by signal 9|^{GONE}$",  # in lockstep the rig itself may notice first
    "forkserver": "the server of the rig's processes",
    "controller": "was ended by SIGKILL",
}
RECORDER_KILLED = re.compile(r"^ *([\d.]+) s +the rig is tripped: recorder killed", re.MULTILINE)


def pid_of(name, run):
    """Returns the process of a run that has a name; None where the run was over before."""
    children = run.children()
    if name == "supervisor":
        return run.process.pid
    if name == "forkserver":
        return server_of(children) if children else None
    if name == "controller":
        found = [pid for pid in family(children["alfa46"]) if comm_of(pid) == "rig-python\n"] if "alfa46" in children else []
        return found[-1] if found else None
    return children.get(name)


def comm_of(pid):
    try:
        return Path(f"/proc/{pid}/comm").read_text()
    except OSError:  # it has ended
        return ""


class Kills:
    """Runs whose process of one name is killed, each after a part of its length."""

    def __init__(self, name, how, folder, capsys):
        self.name, (self.arguments, self.sequence), self.folder, self.capsys = name, how, folder, capsys
        self.tails, self.over = [], 0

    def begin(self, number, temporary):
        more = ("--controller", CONTROLLER) if self.name == "controller" else ()
        return RigRun(self.folder / str(number), *self.arguments, *more, sequence=self.sequence, env={"TMPDIR": temporary})

    def one(self, number, moment):
        """Kills a process ``moment`` s after the nodes are connected; returns whether the run was still on."""
        with tempfile.TemporaryDirectory(prefix="kill") as temporary:  # a short name, as it holds the name of a socket
            run = self.begin(number, temporary)
            run.until("all nodes are connected")
            time.sleep(moment)  # it is the condition of the test
            try:
                pid, left = pid_of(self.name, run), Left(run.process.pid)
            except (FileNotFoundError, ProcessLookupError):  # they end meanwhile
                pid = None
            if pid is None or not kill(pid):
                self.over += 1
                run.end()
                return False
            code, output = run.end()
            left.check()
            if code in (0, 3):  # it had nothing more to do
                self.over += 1
                return False
            self.check_end(code, output)
            self.check_bag(run.folder, output)
            read_by_verbs(run.folder, self.folder / f"{number}_made", self.capsys)
            # what a killed command has put aside is removed by the next one
            next_one = [sys.executable, "-P", "-m", "rig_nodes", "list", "rigs"]
            subprocess.run(next_one, env=os.environ | {"TMPDIR": temporary}, check=True, capture_output=True)
            assert list(Path(temporary).iterdir()) == [], "temporary files"
        return True

    def check_end(self, code, output):
        if self.name == "supervisor":
            assert code == -9 and "Traceback" not in output, output
            return
        assert code == 1, output
        sentence = SENTENCES.get(self.name, f"{self.name} killed by signal 9")
        assert re.search(sentence, line_of_the_end(output)), output

    def check_bag(self, folder, output):
        bag = Bag(folder, recover=True)
        assert bag.gaps() == {}, "what is in the bag has no gap"
        if self.name != "recorder":
            assert bag.damage == [], "its recorder has ended it in order"
        elif not self.arguments and (told := RECORDER_KILLED.search(output)):
            self.tails.append(float(told[1]) - bag.last / 1e9)
        if self.name not in ("supervisor", "controller") and bag.began:
            end = json.loads((folder / "report.json").read_text())["run"]["end"]
            assert end["state"] in ("failed", "tripped"), end


@pytest.mark.parametrize("how", [REAL_TIME, LOCKSTEP], ids=["real time", "lockstep"])
@pytest.mark.parametrize(
    ("name", "count"),
    [*((name, 20) for name in ("container", "alfa46", "sequencer", "supervisor", "forkserver", "controller")), ("recorder", 50)],
)
def test_a_process_killed_at_a_random_moment_is_named_and_leaves_nothing(tmp_path, name, how, count, capsys):
    draw, kills, done, count = random.Random(f"{name} {how}"), Kills(name, how, tmp_path, capsys), 0, part_of(count)
    with tempfile.TemporaryDirectory(prefix="kill") as temporary:
        longest = LAST * length_of(kills.begin("whole", temporary))
    for number in range(3 * count):
        if done < count:
            done += kills.one(number, draw.uniform(0.0, longest))
            show(capsys, f"{name} killed {done} times, {kills.over} runs were over before")
    tails = f", at most {max(kills.tails):.3f} s of the bag lost" if kills.tails else ""
    show(capsys, f"{name} killed {done} times within {longest:.1f} s, {' '.join(how[0])}{tails}")
    assert done == count, "too many runs were over before the kill"
    assert all(tail <= TAIL for tail in kills.tails)
