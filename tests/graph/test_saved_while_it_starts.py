# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A rig's file and a sequence that are saved while a run starts change nothing of it: all its processes read run.json."""

import json
import subprocess
import sys

from rig_nodes.bags.reader import Bag
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.run_file import RUN_FILE, Ordered, read_run, write_run
from rig_nodes.runs.sequence import load_sequence

RIG = "base: hydmag\ndescription: mine\ncontroller_values:\n  t12: [{} ms, own]\n"


def test_a_run_is_of_the_files_as_they_were_when_it_was_ordered(tmp_path):
    rig, out = tmp_path / "mine", tmp_path / "out"
    (rig / "sequences").mkdir(parents=True)
    sequence = rig / "sequences" / "short.yaml"
    sequence.write_text("description: short\nsteps:\n  - wait: {for: 100 ms}\n")
    (rig / "rig.yaml").write_text(RIG.format(100))
    order = [sys.executable, "-P", "-m", "rig_nodes", "run", str(sequence), "--out", str(out), "--speed", "max"]
    with subprocess.Popen(order, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as run:
        first = run.stdout.readline()
        (rig / "rig.yaml").write_text(RIG.format(333))
        sequence.write_text("description: another\nsteps:\n  - wait: {for: 200 ms}\n")
        text = first + run.stdout.read()
    assert run.returncode == 0, text
    report, written = (json.loads((out / name).read_text()) for name in ("report.json", RUN_FILE))
    recorded = Bag(out).run_info()
    assert [one["configuration"]["alfa46"]["t12"] for one in (report["run"], recorded, written)] == [0.1, 0.1, 0.1]
    assert recorded["description"] == "short" and Bag(out).events()[-1][0] < 0.2
    assert load_rig(rig).alfa46.values.t12 == 0.333, "the file was saved in time"


def test_what_is_written_is_read_again(tmp_path):
    config, sequence = load_rig("three_speed", {"motor.ramp": "500 rpm/s"}), load_sequence("demo", None, "three_speed")
    ordered = Ordered(config, "three_speed", sequence, 7, 2, "udp:9000@current")
    again = read_run(write_run(tmp_path, ordered))
    assert again.config.as_dict() == config.as_dict() and again[1:] == ordered[1:]
