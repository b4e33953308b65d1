# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A rig runs for long beside a program that sends much on topics of its own: nothing is lost, and no process grows.

`./rig test -m campaign tests/graph/test_long_beside_others.py` prints the figures.
"""

import json
import subprocess
import sys
import time
from pathlib import Path

import pytest
from campaigns import PART, show, size_of
from running_graph import RigRun, Traces

from rig_nodes.bags.opened import OpenedBags
from rig_nodes.controllers.ros.domain import Domain, environment
from rig_nodes.nodes.processes.supervisor import LONGEST_END

pytestmark = [pytest.mark.against_the_clock, pytest.mark.campaign]

MINUTES = 30 * PART
TOPICS, RATE = 20, 100.0  # and messages per second on each
SETTLED = 120.0 * PART  # s after which what a process needs at its start is there
SAMPLE = 10.0  # s between two looks at the sizes
MORE = 20.0  # s for which the run goes on after the others
# s in which a run is over once the others are: its own end, all its processes, and its report, which is made at least five times
# as fast as the run went
END = MORE + LONGEST_END + 60.0 * MINUTES / 5.0
GROWTH = 20.0  # MB
SEQUENCE = """
description: gear I, a motor that turns
ready: {{timeout: 20 s}}
steps:
  - oil: {{pressure: 4 MPa}}
  - shift: {{to: I, timeout: 5 s}}
  - motor: {{speed: 600 rpm}}
  - wait: {{for: {seconds} s}}
"""


def test_nothing_is_lost_beside_two_thousand_messages_a_second_of_others(tmp_path, capsys):
    sequence = tmp_path / "long.yaml"
    sequence.write_text(SEQUENCE.format(seconds=60 * MINUTES + MORE))
    run = RigRun(tmp_path / "run", sequence=sequence)
    domain = int(run.until("ROS_DOMAIN_ID=").rpartition("=")[2])
    run.until("step 4 of 4")
    traces = Traces(run)
    words = [str(Path(__file__).with_name("many_senders.py")), str(TOPICS), str(RATE), str(60 * MINUTES)]
    others = subprocess.Popen([sys.executable, *words], env=environment(Domain(domain)), stdout=subprocess.PIPE, text=True)
    try:
        assert others.stdout.readline() == "received\n"
        began, sizes = time.monotonic(), {}
        while others.poll() is None:
            time.sleep(SAMPLE)  # the course of the sizes is what is tested
            if run.process.poll() is not None:
                others.terminate()
                break
            for name, pid in traces.children.items():
                sizes.setdefault(name, []).append((time.monotonic() - began, *size_of(pid)))
            shown = ", ".join(f"{name} {rows[-1][1]:.1f} MB" for name, rows in sizes.items())
            show(capsys, f"{time.monotonic() - began:.0f} s: {shown}")
        sent = int(others.stdout.read() or 0)
    finally:
        others.kill()
        others.wait()
    rest, _ = run.process.communicate(timeout=END)
    code, output = run.process.returncode, "".join(run.output) + rest
    traces.wait_gone()
    part = json.loads((run.folder / "report.json").read_text())["run"]
    with OpenedBags(sorted(run.folder.glob("*.mcap"))) as bag:
        stored = [bag.counts.get(f"/many/topic_{k}", 0) for k in range(TOPICS)]
    growth = {}
    for name, rows in sizes.items():
        settled = [row for row in rows if row[0] >= SETTLED]
        growth[name] = (settled[-1][1] - settled[0][1], settled[-1][2] - settled[0][2])
    with capsys.disabled():
        print(f"\nsent {sent} on each of {TOPICS} topics, stored {min(stored)} to {max(stored)}; of the rig lost {part['lost']}")
        print(f"growth [MB, files]: {growth}; lateness {part['lateness_ms']}; {part['ticks']} ticks, overruns {part['overruns']}")
        print(f"exit code {code}: {output.splitlines()[-1]}")
    assert part["lost"] == 0 and stored == [sent] * TOPICS
    assert all(memory < GROWTH and files <= 0 for memory, files in growth.values())
    assert code == 0, output
