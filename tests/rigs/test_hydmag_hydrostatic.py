# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The HydmAG with its hydrostatic drive: steady states by hand, energy, limits of the pressures, a gear without slip."""

import math

import numpy as np
import pytest

from rig_nodes.base.config import RIGS_DIR
from rig_nodes.base.errors import RigError
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.calculations import calculations_of
from rig_nodes.runs.recorded import record
from rig_nodes.runs.rig import Rig
from rig_nodes.runs.sequence import load_sequence

NAME = "hydmag_hydrostatic"
RPM = math.pi / 30.0
HEATS = ("heat_leak", "heat_relief", "heat_boost", "heat_friction")


@pytest.fixture(scope="module")
def config():
    return load_rig(NAME, {"effects.transducers": "off", "trips.watched": "off"})


def travelling(config, swivel: float = 0.6, pressure: float = 5e6, seconds: float = 4.0) -> Rig:
    """Returns the rig on its hydrostatic drive at 1500 rpm, against the load pump at a setting of its relief valve."""
    rig = Rig(config)
    rig.set("motor", 1500 * RPM, True)
    rig.set("hydraulic_motor", swivel, True)
    rig.advance(2.5)
    rig.set("load", pressure, True)
    rig.set("pump", 1.0, True)
    rig.advance(seconds)
    return rig


def stored(config, me) -> float:
    """Returns the energy of the compressed oil in both lines [J]."""
    return 0.5 * config.hydrostatic.line_volume / config.hydrostatic.bulk_modulus * float(me["high"] ** 2 + me["low"] ** 2)


@pytest.fixture(scope="module")
def steady(config):
    return travelling(config)


@pytest.fixture(scope="module")
def by_hand():
    """The module of the rig's calculations."""
    import importlib.util

    spec = importlib.util.spec_from_file_location("hydrostatic_by_hand", RIGS_DIR / NAME / "calculations.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_a_steady_state_is_the_one_by_hand(config, steady, by_hand):
    """Swivel, pressures, torques and efficiency at the torque and the speeds that the rig has reached."""
    me, pump = steady.device("hydrostatic"), steady.true("w0.speed")
    one = by_hand.steady_state(config, pump, steady.true("wk.speed"), float(me["torque_motor"]) * 41 / 23)
    assert one.swivel == pytest.approx(0.6, rel=1e-3)
    assert one.high == pytest.approx(float(me["high"]), rel=1e-3) and one.low == pytest.approx(float(me["low"]), rel=1e-3)
    assert one.pump_torque == pytest.approx(float(me["torque_pump"]), rel=1e-3)
    shown = float(me["torque_motor"]) * steady.true("z6.speed") / (float(me["torque_pump"]) * steady.true("z2.speed"))
    assert one.efficiency == pytest.approx(shown, rel=1e-3) and 0.6 < one.efficiency < 0.9


def test_energy_closes_with_the_losses_of_the_oil(config, steady):
    """The work of the shafts on the drive equals the losses in leaks, valves and friction and the energy stored in the oil."""
    me, energy = steady.device("hydrostatic").copy(), steady.energy()
    heat = sum(float(me[name]) for name in HEATS)
    assert heat + stored(config, me) == pytest.approx(energy["hydrostatic"], rel=1e-5) and heat > 1000.0
    assert abs(energy["residual"]) < 1e-9 * energy["motor"]
    drive, taken = float(me["torque_pump"]) * steady.true("z2.speed"), energy["motor"]
    steady.advance(0.1)
    assert steady.energy()["motor"] - taken > 0.1 * drive, "work of the motor is its own, not less what the drive takes"


def test_the_relief_valve_bounds_the_pressure_and_no_line_is_empty(config):
    rig = travelling(config, swivel=0.2, pressure=25e6, seconds=0.2)
    differences, lowest = [], []
    for k in range(1500):
        if k == 600:
            rig.set("load", 0.0, False)
        if k == 900:
            rig.set("pump", -0.3, True)
        rig.advance(0.002)
        me = rig.device("hydrostatic")
        differences.append(float(me["high"] - me["low"]))
        lowest.append(min(float(me["high"]), float(me["low"])))
    droop = config.hydrostatic.relief_droop * config.hydrostatic.pump_displacement * 1.05 * rig.true("z2.speed")
    assert 35e6 < max(differences) < 35e6 + droop
    assert min(lowest) > -101325.0, "below vacuum"
    assert min(lowest) > 0.5e6, "the boost supply feeds the line that returns"


def test_without_its_boost_supply_a_line_is_empty_but_never_below_vacuum(config):
    values = {"boost_pressure": "0 MPa", "boost_resistance": "100 bar/(l/min)"}
    bare = load_rig(NAME, {"effects.transducers": "off", **{f"hydrostatic.{name}": value for name, value in values.items()}})
    rig = travelling(bare, seconds=1.0)
    assert float(rig.device("hydrostatic")["low"]) == -101325.0


def test_gear_1_is_engaged_without_slip_from_the_hydrostatic_drive(config):
    """The two-phase drive of the thesis: from the hydrostatic drive to gear I at equal speeds, and back."""
    run = record(config, load_sequence("demo", None, NAME), 1, plant_states=("s1_slip", "s1_torque"))
    slip, torque = run.plant_states["s1_slip"], run.plant_states["s1_torque"]
    assert run.end["state"] == "ended"
    grips = np.flatnonzero(np.abs(torque) > 20.0)[0]
    assert abs(slip[grips]) < 0.02 * 1500 * RPM * 34 / 47
    heat = np.sum((np.abs(slip) * np.abs(torque))[: grips + 5000]) * 1e-4  # rows of the logger
    assert heat < 50.0


@pytest.mark.parametrize(
    "old, new, sentence",
    [
        ("pump_time: [500 ms", "pump_time: [500 mm", r"rig\.yaml:\d+: hydrostatic\.pump_time.* expected a time"),
        (
            "relief_pressure: [35 MPa",
            "relief_pressure: [-35 MPa",
            r"rig\.yaml:\d+: hydrostatic\.relief_pressure is -35 MPa, outside",
        ),
        ("driven: z6", "driven: z66", r"rig\.yaml:\d+: parts\.hydrostatic\.driven.*z66"),
    ],
)
def test_a_wrong_value_gets_one_sentence_with_file_and_line(tmp_path, old, new, sentence):
    text = (RIGS_DIR / NAME / "rig.yaml").read_text()
    assert old in text
    (tmp_path / "rig.yaml").write_text(text.replace(old, new, 1))
    with pytest.raises(RigError, match=sentence) as error:
        load_rig(tmp_path)
    assert "\n" not in str(error.value)


def test_a_swivel_beyond_its_stop_is_refused(config):
    with pytest.raises(RigError, match="swivel"):
        Rig(config).set("pump", 1.2, True)


def test_the_printed_ratio_is_that_of_the_teeth_cut_not_rounded(config):
    table = calculations_of(NAME)["ratios"].table(config)
    assert table.cell({"state": "hydrostatic"}, "cut") == pytest.approx(1.782, abs=1e-9)
    assert table.cell({"state": "hydrostatic"}, "rounded") == pytest.approx(1.783, abs=1e-9)
