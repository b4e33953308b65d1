# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Every process of a run is killed at random moments: one sentence, a bag that verbs read, and nothing left on the machine.

`./rig test -m campaign tests/graph/test_killed_at_random.py` prints the figures.
"""

import os
import random
import signal
import time

import pytest
from running_graph import SHORT, RigRun, Traces

from rig_nodes.bags.reader import Bag
from rig_nodes.cli.main import main

pytestmark = [pytest.mark.against_the_clock, pytest.mark.campaign]

TAIL = 0.2  # s: what a killed recorder may not have written
ENDED = "rig: the shift controller's process has ended"
# sequence, and s after the nodes are connected within which the kill comes, which is before its end
LONGEST = {"1": (SHORT, 3.0), "max": ("demo", 2.0)}


@pytest.mark.parametrize("speed", ["1", "max"])
@pytest.mark.parametrize(("name", "count"), [("container", 20), ("alfa46", 20), ("sequencer", 20), ("recorder", 50)])
def test_a_process_killed_at_a_random_moment_is_named_and_leaves_nothing(tmp_path, name, speed, count, capsys):
    draw, tails, read = random.Random(f"{name} {speed}"), [], 0
    for number in range(count):
        sequence, longest = LONGEST[speed]
        run = RigRun(tmp_path / str(number), "--speed", speed, sequence=sequence)
        run.until("all nodes are connected")
        began, traces = time.time(), Traces(run)
        assert traces.shared_memory() == [], "killed processes would leave segments behind"
        time.sleep(draw.uniform(0.0, longest))  # the moment is the condition of the test
        at = time.time()
        os.kill(traces.children[name], signal.SIGKILL)
        code, output = run.end()
        assert "Traceback" not in output, output
        if code == 0:
            continue  # the run was over before
        # in lockstep the rig itself may notice first that the controller's process has ended
        told = output.splitlines()[-1]
        assert code == 1 and (f"{name} killed by signal 9" in told or (name, told) == ("alfa46", ENDED)), output
        traces.wait_gone()
        files = sorted(run.folder.glob("*.mcap"))
        if name == "recorder" and speed == "1":
            tails.append(at - max(began, files[-1].stat().st_mtime))
        bag = Bag(run.folder, recover=True)
        times = bag.series("n_wej")[0] if bag.counts.get("/motor/n_wej", 0) > 1 else []  # killed before anything was written
        assert len(times) == 0 or abs(len(times) - 1 - round((times[-1] - times[0]) / (times[1] - times[0]))) <= 1, "it has no gap"
        codes = (0, 1, 3) if bag.began else (0, 1, 2, 3)  # of a bag without anything after time 0, there is no report
        for verb in (["report"], ["bag", "check"], ["bag", "hash"]):
            assert main([*verb, str(run.folder)]) in codes, verb
            read += 1
        said = capsys.readouterr()
        assert "Traceback" not in said.out + said.err
    with capsys.disabled():
        tail = f", at most {max(tails):.3f} s of the bag lost" if tails else ""
        print(f"\n{name} killed {count} times at speed {speed}: {read} readings of what was left{tail}")
    assert all(tail <= TAIL for tail in tails)
