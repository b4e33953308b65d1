# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Each process of a run in real time stands still for a while: a moment costs nothing, seconds are named in time and trip the rig.

`./rig test -m campaign tests/graph/test_stopped_processes.py` prints the table.
"""

import contextlib
import json
import os
import signal
import threading
import time

import pytest
from campaigns import Left, line_of_the_end, read_by_verbs, server_of, show
from running_graph import RigRun

from rig_nodes.bags.reader import Bag

pytestmark = [pytest.mark.against_the_clock, pytest.mark.campaign]

MOMENTS, SECONDS = (0.05, 0.2), (5.0, 10.0)
NAMED = 2.5  # s from the beginning of a stop within which a person reads of it: 1 s, and how often a process looks and tells
BEHIND, LOST = "the rig fell behind real time by more than 100 ms", "did not reach the bag"
SILENT, STOOD = "controller_silent", "stood_still"
# name of the trip of a process that stands still for seconds, what is told first, and in the last line
TRIPS = {
    "container": (STOOD, "the container stands still for 1.", "still for"),
    # 1.0 s at the trip; a run that has not ended by then is ended at 10.0 s, which is as long as the longest stop
    "recorder": (STOOD, "the recorder stands still for 1.", "the recorder stands still for 1"),
    "sequencer": (STOOD, "the sequencer stands still for 1.", "the sequencer stands still for 1"),
    "alfa46": (SILENT, *2 * ("valve commands older than 100 ms",)),
}
BESIDE = ("supervisor", "forkserver")  # the rig goes on without them
SEQUENCE = """
description: gear I, a motor that turns
ready: {{timeout: 20 s}}
steps:
  - oil: {{pressure: 4 MPa}}
  - wait: {{until: {{signal: p_p, above: 3.9 MPa}}, timeout: 3 s}}
  - shift: {{to: I, timeout: 3 s}}
  - motor: {{speed: 600 rpm}}
  - wait: {{for: {seconds} s}}
"""


class Watched:
    """A run whose lines are read as they come, with the times at which they come."""

    def __init__(self, folder, sequence):
        self.run, self.lines = RigRun(folder, sequence=sequence), []
        self._in_gear = threading.Event()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        assert self._in_gear.wait(60.0), self.output

    def _read(self):
        for line in self.run.process.stdout:
            self.lines.append((time.monotonic(), line))
            if "motor speed 600 rpm" in line:
                self._in_gear.set()

    @property
    def output(self):
        return "".join(line for _, line in self.lines)

    def said_at(self, text):
        """Returns when a line with a text came; None when none did."""
        return next((at for at, line in self.lines if text in line), None)

    def end(self):
        """Returns the exit code."""
        code = self.run.process.wait(60.0)
        self._reader.join(10.0)
        return code


def stopped(watched, name, seconds):
    """Stops a process for some seconds; returns when it began."""
    children = watched.run.children()
    pid = {"supervisor": watched.run.process.pid, "forkserver": server_of(children), **children}[name]
    began = time.monotonic()
    os.kill(pid, signal.SIGSTOP)
    try:
        time.sleep(seconds)  # it is the condition of the test
    finally:
        with contextlib.suppress(ProcessLookupError):  # a run that has tripped goes on with its end
            os.kill(pid, signal.SIGCONT)
    return began


def expected(name, seconds):
    """Returns the exit code, and the name of the trip."""
    if name in BESIDE:
        return 0, ""
    if seconds in SECONDS:
        return 1, TRIPS[name][0]
    if seconds > 0.1 and name == "alfa46":
        return 1, SILENT  # as any controller that gives no command for 100 ms
    return 3 * (seconds > 0.1 and name == "container"), ""  # nothing is lost, but time, and that is said


@pytest.mark.parametrize("seconds", [*MOMENTS, *SECONDS])
@pytest.mark.parametrize("name", [*TRIPS, *BESIDE])
def test_a_process_that_stands_still_is_named_or_costs_nothing(tmp_path, name, seconds, capsys):
    sequence = tmp_path / "turning.yaml"
    sequence.write_text(SEQUENCE.format(seconds=seconds + 2.0))
    watched = Watched(tmp_path / "run", sequence)
    left = Left(watched.run.process.pid)
    began = stopped(watched, name, seconds)
    code = watched.end()
    left.check()
    part = json.loads((watched.run.folder / "report.json").read_text())["run"]
    trip, (_, first, last) = part["end"].get("trip", ""), TRIPS.get(name, ("", "stands still", ""))
    at = watched.said_at(first)
    bag = Bag(watched.run.folder)
    named = "not" if at is None else f"{at - began:.2f} s"
    line = f"{name:>10} for {seconds:5.2f} s: exit code {code}, trip {trip or 'none':<17}, named {named:>6}, "
    show(capsys, f"{line}{part['lost']} lost, behind {part['behind']['longest_s']:.2f} s")
    output = watched.output
    assert (code, trip) == expected(name, seconds), output
    assert bag.end == part["end"] and sum(bag.gaps().values()) <= part["lost"], "its bag is sealed, and what it lacks is counted"
    assert part["lost"] == 0 or (name == "recorder" and trip and LOST in line_of_the_end(output)), output
    if trip:
        assert last in line_of_the_end(output) and at is not None and at - began < NAMED, output
    else:
        assert at is None and (BEHIND in output) == (code == 3), output
    read_by_verbs(watched.run.folder, tmp_path / "made", capsys)
