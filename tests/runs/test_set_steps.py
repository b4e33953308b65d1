# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Steps of a sequence that change settings while the rig runs: the same names, ranges and events as everywhere."""

import numpy as np
import pytest

from rig_nodes.bags.reader import Bag
from rig_nodes.base.errors import RigError
from rig_nodes.controllers.load import load_controller
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.sequence import load_sequence
from rig_nodes.runs.simulation import simulate

SEQUENCE = """
description: gear I, settings, gear II
parameters:
  oil: 80 degC
steps:
  - oil: {pressure: 4 MPa}
  - wait: {for: 200 ms}
  - shift: {to: I}
  - wait: {for: 100 ms}
  - set: {oil_supply.temperature: "${oil}", instruments.noise: off, alfa46.t12: 300 ms}
  - wait: {for: 100 ms}
  - shift: {to: II}
"""
CHANGES = [("oil_supply.temperature = 80 degC", 80.0), ("instruments.noise = false", 0.0), ("alfa46.t12 = 0.3 s", 0.3)]


def run(folder, text=SEQUENCE, controller=None):
    """Returns end and bag of a simulation of this sequence."""
    (folder / "sequence.yaml").write_text(text)
    config = load_rig("hydmag")
    plug = load_controller(controller, config) if controller else None
    record = simulate(config, load_sequence(folder / "sequence.yaml", default="hydmag"), folder / "run", controller=plug)
    return record["end"], Bag(folder / "run")


@pytest.mark.parametrize("controller", [None, "alfa46"], ids=["embedded", "plugged"])
def test_each_acts_from_its_event_on(tmp_path, controller):
    end, bag = run(tmp_path, controller=controller)
    assert end["state"] == "ended", end["reason"]
    events = [(time, name, text, value) for time, _, name, text, value in bag.events()]
    changed = {text: (time, value) for time, name, text, value in events if name == "setting_changed"}
    assert [(text, value) for text, (_, value) in changed.items()] == CHANGES
    t, oil = bag.series("T_oil")
    at = changed[CHANGES[0][0]][0]
    assert np.all(np.abs(oil[t < at] - 40.0) < 2.0) and np.all(np.abs(oil[t > at + 0.02] - 80.0) < 2.0)
    t, load = bag.series("p_po")  # of a load that is off
    assert np.ptp(load[t < at]) > 0.0 and np.ptp(load[t > at + 0.02]) == 0.0
    second = next(time for time, name, text, _ in events if text == "shift to II ordered")
    t, asked = bag.series("I_set_zr_p2")
    assert t[asked > 0.0][0] - second == pytest.approx(0.3, abs=0.003), "the engaging output waits for t12"


@pytest.mark.parametrize(
    "step, sentence",
    [
        ("set: {oil_supply.temperature: 200 degC}", "set.oil_supply.temperature is 200 degC, outside -30 to 150 degC"),
        ("set: {oil_supply.temperature: 80 bar}", "set.oil_supply.temperature: '80 bar' is a pressure, expected a temperature"),
        ("set: {instruments.noise: loud}", "set.instruments.noise is 'loud', expected one of on, off"),
        ("set: {oil_supply.temp: 80 degC}", "did you mean .*temperature"),
        ("set: {gearbox.z5: 40}", "set: .*'gearbox"),
        ("set: {w0.inertia: 1 kg m2}", "w0.inertia cannot be set while the rig runs; give --set w0.inertia=... to the run"),
        ("set: {motor.speed: 300 rpm}", "motor.speed is a setpoint; the step 'motor' sets it"),
        ("set: {alfa46.output_1.times: 1 s}", "alfa46.output_1.times has 6 numbers; a sequence sets single values"),
        ("set: {}", "set takes names of settings and their values"),
        ("set: 5", "set takes names of settings and their values"),
    ],
)
def test_what_cannot_be_set_is_refused_with_its_line(tmp_path, step, sentence):
    (tmp_path / "sequence.yaml").write_text(f"description: wrong\nsteps:\n  - {step}\n")
    with pytest.raises(RigError, match=f"sequence.yaml:3: .*{sentence}"):
        load_sequence(tmp_path / "sequence.yaml", default="hydmag")


def test_gains_of_a_loop_that_the_rig_closes_end_the_sequence(tmp_path):
    text = "description: wrong\nsteps:\n  - set: {alfa46.gain_p: 10 ohm}\n"
    (tmp_path / "sequence.yaml").write_text(text)
    config = load_rig("hydmag")
    plug = load_controller("alfa46", config, "current")
    record = simulate(config, load_sequence(tmp_path / "sequence.yaml", default="hydmag"), tmp_path / "run", controller=plug)
    assert record["end"]["state"] == "failed"
    assert "sequence.yaml:3: gain_p refused: at level current" in record["end"]["reason"]


def test_a_controller_of_ones_own_reads_its_settings_when_it_starts(tmp_path):
    (tmp_path / "own.py").write_text(
        "from rig_nodes.controllers.examples.alfa46 import Alfa46\n\n\nclass Own(Alfa46):\n    levels = ('duty',)\n"
    )
    end, _ = run(tmp_path, controller=f"python:{tmp_path / 'own.py'}:Own")
    assert end["state"] == "failed" and "only the built-in alfa46 takes new ones while it runs" in end["reason"]
