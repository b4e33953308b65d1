# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""`--delay`: the number of samples from a measurement to the effect of the answer to it, for every plug."""

import pytest

from rig_nodes.bags.reader import Bag
from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import main
from rig_nodes.controllers import load_controller
from rig_nodes.runs.rig import Rig
from rig_nodes.runs.simulation import advance_with

from .conftest import PYTHON


@pytest.mark.parametrize("delay", [0, 1, 2, 5])
def test_a_duty_acts_so_many_samples_after_the_measurement(config, python_controller, delay):
    plug = python_controller("return Out([1, 0, 0] if inputs.sample == 2 else [0, 0, 0])")
    rig, acted = Rig(config, controller="external", delay=delay), []
    for _ in range(10):
        advance_with(rig, plug)
        acted.append(float(rig.valves[0]["duty"]))
    assert acted == [1.0 if sample == 2 + delay else 0.0 for sample in range(10)]


def test_what_is_on_its_way_acts_however_time_is_cut(config):
    def moved(*parts):
        rig = Rig(config, controller="external", delay=4)
        rig.advance_samples(1)
        rig.set_duty(0, [0.5, 0.0, 0.0], [0.0] * 3, 1, False)
        assert rig.gear == 1 and rig.valves[0]["pending"] == 0.0
        for part in parts:
            rig.advance_samples(part)
        return rig

    whole, pieces = moved(20), moved(*[1] * 20)
    assert whole.state_hash() == pieces.state_hash() and whole.measurement("I_zr_p1") > 0.05


def test_the_safe_state_forgets_what_is_on_its_way(config):
    rig = Rig(config, controller="external", delay=9)
    rig.advance_samples(1)
    rig.set_duty(0, [1.0, 0.0, 0.0], [0.0] * 3, 1, False)
    rig.trip("somebody says so", "test")
    rig.reset()
    rig.advance_samples(30)
    assert rig.measurement("I_zr_p1") < 0.01


def commands(folder):
    return Bag(folder).canonical_hash()["/controller/command"]


def test_built_in_and_plug_agree_at_every_delay_and_delays_differ(tmp_path, capsys):
    hashes = set()
    for delay in ("0", "1", "3"):
        seen = {}
        for name, spec in (("built-in", "alfa46"), ("python", PYTHON)):
            folder = tmp_path / f"{name}-{delay}"
            given = ["--delay", delay] if (name, delay) != ("built-in", "1") else []  # 1 is what everybody has
            assert main(["simulate", "sample", *given, "--controller", spec, "--out", str(folder)]) == 0
            seen[name] = commands(folder)
        assert len(set(seen.values())) == 1
        hashes |= set(seen.values())
    assert len(hashes) == 3


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["simulate", "sample", "--delay", "-1"], "expected a whole number of samples from 0 to 50"),
        (["simulate", "sample", "--delay", "51"], "expected a whole number of samples from 0 to 50"),
        (["simulate", "sample", "--delay", "1 ms"], "expected a whole number of samples"),
        (["run", "sample", "--delay", "0"], "in real time time passes while the controller computes"),
    ],
)
def test_delays_that_cannot_be_are_refused(capsys, arguments, sentence):
    assert main(arguments) == 2
    error = capsys.readouterr().err
    assert sentence in error and error.count("\n") == 1


def test_the_embedded_law_has_its_one_sample(config):
    with pytest.raises(RigError, match="delay is 2"):
        Rig(config, delay=2)


def test_the_level_current_is_late_by_the_same(config):
    """The current loop itself keeps its delay of one sample; the setpoint arrives later by the difference."""
    seen = {}
    for delay in (1, 4):
        plug = load_controller(f"{PYTHON}@current", config)
        rig = Rig(config, controller="external", level="current", delay=delay)
        plug.order(1)
        on = []
        for _ in range(30):
            advance_with(rig, plug)
            on.append(float(rig.valves[0]["duty"]) > 0.0)
        seen[delay] = on.index(True)
    assert seen[4] - seen[1] == 3
