# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rig run --speed`: the graph in lockstep gives the same bits as `simulate`, with any controller."""

import json
import os
import signal
from pathlib import Path

import pytest
from running_graph import BRIEF, SHORT, RigRun, Traces, rig_run

import rig_nodes.controllers
from rig_nodes.bags.reader import Bag
from rig_nodes.cli.main import main
from rig_nodes.controllers import load_controller
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.sequence import load_sequence
from rig_nodes.runs.simulation import simulate

EXAMPLES = Path(rig_nodes.controllers.__file__).parent / "examples"
# orders of the sequencer reach the box over ROS, so the time of its events may differ
NOT_THE_PLANTS = {"/controller/events", "all"}


PYTHON = f"python:{EXAMPLES / 'alfa46.py'}:Alfa46"


@pytest.fixture(scope="module")
def simulated(tmp_path_factory):
    """Returns canonical_hash of `simulate` for a sequence and the level and the delay of the controller."""
    hashes = {}

    def get(sequence, level, delay):
        if (sequence, level, delay) not in hashes:
            config, folder = load_rig("hydmag"), tmp_path_factory.mktemp("simulated")
            plug = load_controller("alfa46", config, level) if (level, delay) != ("duty", 1) else None
            simulate(config, load_sequence(sequence, default="hydmag"), folder, controller=plug, delay=delay)
            hashes[sequence, level, delay] = Bag(folder).canonical_hash()
        return hashes[sequence, level, delay]

    return get


@pytest.mark.parametrize(
    "arguments",
    [
        pytest.param(("--speed", "max"), marks=pytest.mark.against_the_clock),  # its factor holds on an idle machine only
        ("--speed", "max", "--controller", f"c:{EXAMPLES / 'alfa46.c'}"),
        ("--speed", "2", "--delay", "3", "--controller", PYTHON, "--level", "current"),
    ],
    ids=["max", "c", "late python-current at twice"],
)
def test_same_bits_as_simulate(tmp_path, simulated, arguments):
    folder, sequence = tmp_path / "run", BRIEF if "2" in arguments else SHORT
    code, output = rig_run(folder, *arguments, sequence=sequence)
    assert code == 0, output
    part = json.loads((folder / "report.json").read_text())["run"]
    assert part["lost"] == 0
    if arguments == ("--speed", "max"):
        assert part["speed_factor"] > 0.5
    if "2" in arguments:
        assert part["speed_factor"] <= 2.01
    bag = Bag(folder)
    assert bag.check() == []
    level = "current" if arguments[-1].endswith("current") else "duty"
    assert part["controller"]["level"] == level
    hashes, expected = bag.canonical_hash(), simulated(sequence, level, 3 if "--delay" in arguments else 1)
    assert {topic for topic in expected if hashes.get(topic) != expected[topic]} <= NOT_THE_PLANTS


SETS = """
description: settings of the oil, the transducers and the box while it runs
steps:
  - oil: {pressure: 4 MPa}
  - shift: {to: I}
  - set: {oil_supply.temperature: 80 degC, instruments.noise: off, alfa46.t12: 50 ms}
  - wait: {for: 50 ms}
  - shift: {to: II}
"""


def test_settings_of_a_sequence_act_at_the_same_sample_as_in_simulate(tmp_path):
    sequence = tmp_path / "sets.yaml"
    sequence.write_text(SETS)
    code, output = rig_run(tmp_path / "run", "--speed", "max", sequence=sequence)
    assert code == 0, output
    simulate(load_rig("hydmag"), load_sequence(sequence, default="hydmag"), tmp_path / "simulated")
    hashes, expected = (Bag(tmp_path / name).canonical_hash() for name in ("run", "simulated"))
    assert {topic for topic in expected if hashes.get(topic) != expected[topic]} <= NOT_THE_PLANTS
    texts = [text for _, _, name, text, _ in Bag(tmp_path / "run").events() if name == "setting_changed"]
    assert sorted(texts) == ["alfa46.t12 = 0.05 s", "instruments.noise = false", "oil_supply.temperature = 80 degC"]


def test_a_controller_that_dies_in_lockstep_trips_at_once(tmp_path):
    run = RigRun(tmp_path / "run", "--speed", "1")
    run.until("shift to II")
    traces = Traces(run)
    os.kill(traces.children["alfa46"], signal.SIGKILL)
    code, _ = run.end()
    assert code == 1
    bag = Bag(run.folder)
    (trip,) = [t for t, _, name, text, _ in bag.events() if name == "rig_tripped" and "process has ended" in text]
    age = next(m.command_age for _, m in bag.messages("/valve_zr_p1/state") if m.safe)
    assert age <= 0.007, "nothing is held from a dead controller"  # two samples, and up to a tick until the message
    newest = max(m.header.stamp.sec + m.header.stamp.nanosec * 1e-9 for _, m in bag.messages("/controller/command"))
    # a tap is emptied every 20 ms of real time, in which a run that was held up catches up by ten times as much
    assert trip - newest < 0.3, "the recorder had all but the last moment of what it said"


@pytest.mark.parametrize(
    "arguments, sentence",
    [
        (("--speed", "0"), "expected a number above 0 or max"),
        (("--speed", "fast"), "expected a number above 0 or max"),
        (("--step-timeout", "-1"), "expected seconds above 0, e.g. 0.2, or none"),
        (("--step-timeout", "200 ms"), "expected seconds above 0"),
        (("--controller", "c:none.so"), "none.so"),
        (("--delay", "0"), "in real time time passes while the controller computes"),
    ],
)
def test_wrong_options_are_refused(tmp_path, arguments, sentence, capsys):
    assert main(["run", str(SHORT), "--out", str(tmp_path / "run"), *arguments]) == 2
    assert sentence in capsys.readouterr().err and not (tmp_path / "run").exists()
