# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Gears that two clutches hold: the box drives both outputs, each by its own profile, and keeps an output that both gears use."""

import numpy as np
import pytest

from rig_nodes.analysis.shift import shifts
from rig_nodes.base.errors import RigError
from rig_nodes.base.names import find_config
from rig_nodes.cli.main import main
from rig_nodes.controllers.alfa46.box import Alfa46
from rig_nodes.plant import alfa46_law as law
from rig_nodes.rig.alfa46 import read_alfa46
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.recorded import record
from rig_nodes.runs.rig import Rig
from rig_nodes.runs.sequence import load_sequence

# A clutch joins the sun to the input. The first gear holds the ring, the second one joins input and carrier.
TWO = """\
description: two clutches in each gear
base: three_speed
bodies:
  sun:
    inertia: [0.02 kg m2, "assumed"]
planetary_sets:
  set_1: {sun: sun}
gears:
  1: [clutch_2, brake_1]
  2: [clutch_2, clutch_3]
  3: [brake_1, clutch_3]
parts:
  clutch_2:
    joins: [input, sun]
"""
SEQUENCE = """\
description: 1-2 under load
steps:
  - oil: {pressure: 4 MPa}
  - wait: {for: 500 ms}
  - shift: {to: 1, timeout: 3 s}
  - motor: {speed: 1000 rpm}
  - wait: {until: {signal: n_in, above: 990 rpm}, timeout: 10 s}
  - load: {torque: 40 Nm}
  - wait: {for: 2 s}
  - shift: {to: 2, timeout: 5 s}
  - wait: {for: 2 s}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("rigs") / "two"
    (folder / "sequences").mkdir(parents=True)
    (folder / "rig.yaml").write_text(TWO)
    (folder / "sequences" / "up.yaml").write_text(SEQUENCE)
    return folder


@pytest.fixture(scope="module")
def config(folder):
    return load_rig(folder, {"effects.transducers": "off"})


def setpoints(box: Alfa46, gear: int, first: int, samples: int) -> np.ndarray:
    """Returns the setpoints of the box after an order (samples, 3) [A]."""
    box.order(gear)
    return np.array([box.step(first + k, [0.0] * 3)[1].copy() for k in range(samples)])


def test_each_output_of_a_gear_follows_its_own_profile(config):
    profiles = config.alfa46.profiles.copy()
    profiles[0, :3, 0] *= 0.5  # so that the brake's profile differs from the clutch's
    settings = type(config.alfa46)(config.alfa46.values, profiles)
    box = Alfa46(settings, config.transmission)
    rise = setpoints(box, 1, 0, 800)
    for output in (0, 1):
        expected = [law.profile_current(k * 1e-3, True, 0.0, profiles[output]) for k in range(800)]
        assert rise[:, output] == pytest.approx(expected, abs=1e-12)
    assert not rise[:, 2].any() and list(box.active) == [True, True, False]


def test_an_output_of_both_gears_stays_as_it_is_through_the_shift(config):
    box = Alfa46(config.alfa46, config.transmission)
    setpoints(box, 1, 0, 800)
    change = setpoints(box, 2, 800, 2000)
    assert np.all(change[:, 1] == config.alfa46.profiles[1, 2, 1]), "C2 holds on"
    assert change[0, 0] > 0.0 and change[-1, 0] == 0.0, "the brake is let go"
    assert change[0, 2] == 0.0 and change[-1, 2] == config.alfa46.profiles[2, 2, 1], "C3 is clamped"
    assert list(box.active) == [False, True, True]
    end = setpoints(box, 0, 2800, 2000)
    assert not end[-1].any(), "neutral lets both go"


def test_profiles_of_all_outputs_that_a_shift_moves_are_in_use(config):
    box = Alfa46(config.alfa46, config.transmission)
    setpoints(box, 1, 0, 10)
    assert list(box.outputs_in_shift()) == [True, True, False]


@pytest.mark.campaign
@pytest.mark.parametrize("gear, ratio", [(1, 2.8), (2, 1.0)])
def test_the_rig_is_driven_in_its_gears(config, gear, ratio):
    rig = Rig(config)
    rig.set("oil", 4e6, True)
    rig.advance(0.3)
    rig.order_gear(gear)
    rig.advance(1.5)
    rig.set("motor", 100.0, True)
    rig.set("load", 2e6, True)
    rig.advance(5.0)
    assert rig.locked_gear() == gear
    assert rig.true("input.speed") == pytest.approx(ratio * rig.true("output.speed"), rel=1e-9)


@pytest.mark.campaign
def test_a_shift_under_load_lets_one_clutch_go_for_another_and_keeps_the_third(config, folder):
    run = record(config, load_sequence("up", None, folder), plant_states=("c2_mode",))
    assert run.end["state"] == "ended", run.end
    (shift,) = shifts(run.recording)
    # the released brake drags until its current ends, so the input torque has not settled half a second after lock-up
    assert (shift["from_gear"], shift["to_gear"]) == (1, 2) and shift["t_c_s"] < 1.0, shift["why"]
    rows = slice(round(shift["t_order_s"] * 1e4), None)
    assert set(run.plant_states["c2_mode"][rows]) == {2.0}, "C2 is locked all the way"


@pytest.mark.campaign  # tests/rig/test_more_outputs.py shifts a rig of five outputs
def test_simulate_shifts_it_and_says_so(folder, tmp_path, capsys):
    assert main(["simulate", "up", "--rig", str(folder), "--out", str(tmp_path / "run")]) == 0
    assert "1 -> 2" in capsys.readouterr().out


def test_a_gear_of_clutches_without_valves_is_refused(config):
    box = config.transmission
    gears = tuple(type(gear)(gear.number, gear.name, gear.clutches, gear.ratio) for gear in box.gears)
    without = type(box)(box.input, box.output, box.clutches, gears, box.inertias)
    with pytest.raises(RigError, match="gear 1 has no output of the controller, because none of its clutches has a valve"):
        Alfa46(config.alfa46, without).order(1)


def test_a_profile_of_a_fourth_output_is_refused(tmp_path):
    text = find_config("controllers", "alfa46").read_text()
    (tmp_path / "mine.yaml").write_text(text + text[text.index("  output_3:") :].replace("output_3", "output_4"))
    line = 1 + text.count("\n")
    with pytest.raises(RigError, match=f"mine.yaml:{line}: alfa46.profiles has output_4; the Alfa46 has 3 outputs$"):
        read_alfa46(tmp_path / "mine.yaml")


def test_crossed_wires_are_crossed_behind_the_box():
    plain, crossed = load_rig("hydmag"), load_rig("hydmag", {"wiring": "swapped"})
    for config in (plain, crossed):
        assert [gear.outputs for gear in config.transmission.gears] == [(), (0,), (1,)]
