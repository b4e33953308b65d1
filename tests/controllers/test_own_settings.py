# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Settings that a controller names as its own, set from a sequence: they act from the next sample on."""

import numpy as np
import pytest

from rig_nodes.bags.reader import Bag
from rig_nodes.base.errors import RigError
from rig_nodes.controllers import load_controller
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.sequence import load_sequence
from rig_nodes.runs.sequence_runner import SequenceRunner
from rig_nodes.runs.simulation import simulate

from .conftest import ask

HOLDING = """
from rig_nodes.controllers import ControllerOutputs

class Mine:
    levels = ("current",)
    settings = {"held": 0.25, "other": 1}

    def initialize(self, info):
        pass

    def step(self, inputs):
        return ControllerOutputs([inputs.settings["held"], 0.0, 0.0], gear=inputs.gear_request)

    def terminate(self):
        pass
"""
SEQUENCE = """
description: hold 250 mA, then 500 mA, then as the parameter says
parameters: {last: "0.125"}
steps:
  - wait: {for: 100 ms}
  - controller: {held: 0.5, other: 2}
  - wait: {for: 100 ms}
  - controller: {held: "${last}"}
  - wait: {for: 100 ms}
"""


@pytest.fixture
def run(tmp_path, config):
    """Simulates a sequence of this text; returns (end of the run, bag)."""

    def go(text=SEQUENCE, spec=None):
        (tmp_path / "mine.py").write_text(HOLDING)
        (tmp_path / "sequence.yaml").write_text(text)
        plug = load_controller(spec or f"python:{tmp_path / 'mine.py'}:Mine", config)
        end = simulate(config, load_sequence(tmp_path / "sequence.yaml", default="hydmag"), tmp_path / "run", controller=plug)[
            "end"
        ]
        return end, Bag(tmp_path / "run")

    return go


def test_a_step_of_a_sequence_sets_it(run):
    end, bag = run()
    assert end["state"] == "ended", end["reason"]
    t, asked = bag.series("I_set_zr_p1")
    changes = [(round(t[k], 3), asked[k]) for k in np.flatnonzero(np.diff(asked, prepend=-1.0))]
    began = changes[1][0]
    assert changes == [(0.0, 0.25), (began, 0.5), (round(began + 0.1, 3), 0.125)]
    assert [(text, value) for _, _, name, text, value in bag.events() if name == "setting_changed"] == [
        ("alfa46.controller.held = 0.5", 0.5),
        ("alfa46.controller.other = 2", 2.0),
        ("alfa46.controller.held = 0.125", 0.125),
    ]


def test_a_setting_that_it_does_not_have_ends_the_sequence(run):
    end, _ = run(SEQUENCE.replace("other: 2", "gain: 2"))
    assert end["state"] == "failed"
    assert "sequence.yaml:6: controller python:" in end["reason"]
    assert "setting of its own 'gain'; " in end["reason"] and end["reason"].endswith("held, other")


def test_the_alfa46_has_none_of_its_own(run):
    end, _ = run(spec="alfa46")
    assert "controller alfa46: there is no setting of its own 'held'; there is none" in end["reason"]


@pytest.mark.parametrize(
    ("step", "sentence"),
    [
        ("controller: {held: fast}", "controller.held is 'fast', expected a number"),
        ("controller: {held: true}", "controller.held is True, expected a number"),
        ("controller: {}", "controller takes names of its settings"),
        ("controller: 5", "controller takes names of its settings"),
    ],
)
def test_steps_that_set_nothing_are_refused(tmp_path, step, sentence):
    (tmp_path / "sequence.yaml").write_text(f"description: wrong\nsteps:\n  - {step}\n")
    with pytest.raises(RigError, match=sentence):
        load_sequence(tmp_path / "sequence.yaml", default="hydmag")


def test_the_clutch_bench_has_no_controller_to_set(tmp_path):
    (tmp_path / "sequence.yaml").write_text("description: wrong\nrig: clutch_bench\nsteps:\n  - controller: {held: 1}\n")
    with pytest.raises(RigError, match="sequence.yaml:4: .*'controller'"):
        load_sequence(tmp_path / "sequence.yaml", default="hydmag")


def test_a_setting_that_is_not_answered_yet_is_looked_at_with_every_tick(tmp_path):
    """Its value, 900, must not be taken as a time to wait for."""

    class Late:
        def ready(self):
            return True

        def event(self, *_):
            pass

        def change(self, name, value):
            self.given = name, value

        def changed(self):
            return False

    (tmp_path / "sequence.yaml").write_text("description: late\nsteps:\n  - controller: {held: 900}\n")
    runner = SequenceRunner(load_sequence(tmp_path / "sequence.yaml", default="hydmag"), Late(), load_rig("hydmag"))
    assert not runner.poll(0.25) and runner.bench.given == ("alfa46.controller.held", 900.0)
    assert runner.next_look() == {"until": 0.25}


@pytest.mark.parametrize("settings", ["('held',)", "{'a b': 1}", "{'held': 'fast'}", "{'held': math.nan}"])
def test_settings_that_are_none_are_refused(python_controller, settings):
    with pytest.raises(RigError, match="expected a map of names and first values"):
        python_controller("return Out()", f"settings = {settings}")


def test_a_value_acts_from_the_next_sample_on(python_controller):
    plug = python_controller("return Out([inputs.settings['k'], 0, 0])", "settings = {'k': 0.25}")
    assert ask(plug).command[0] == 0.25
    plug.set_value("k", 0.5)
    assert ask(plug, 1).command[0] == 0.5
    with pytest.raises(RigError, match="setting 'k' of controller .* is nan"):
        plug.set_value("k", float("nan"))
