# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The HydmAG in a vehicle with a combustion engine: road load against closed forms, stall, energy, and shifts that it survives."""

import math

import pytest

from rig_nodes.base.config import RIGS_DIR
from rig_nodes.base.errors import RigError
from rig_nodes.plant.parts.combustion_engine import STALLED
from rig_nodes.rig.configuration import load_rig, with_overrides
from rig_nodes.runs.calculations import calculations_of, of_run
from rig_nodes.runs.recorded import record
from rig_nodes.runs.rig import Rig
from rig_nodes.runs.sequence import load_sequence

NAME = "hydmag_engine"
RPM = math.pi / 30.0
EVEN = {"effects.transducers": "off", "motor.irregularity": "0 %", "motor.irregularity_scatter": "0 %"}


@pytest.fixture(scope="module")
def config():
    return load_rig(NAME, EVEN)


@pytest.fixture(scope="module")
def free():
    """Without losses of the gearbox, so that the road alone brakes."""
    values = {"loss_out.drag": "0 Nm", "loss_out.constant": "0 Nm", "loss_out.share": "0 %", "loss_out.square": "0 1/Nm"}
    return load_rig(NAME, {**EVEN, **values, "oil_supply.viscosity": "0.0001 Pa s", "oil_supply.second_viscosity": "0 Pa s"})


@pytest.fixture(scope="module")
def point(config):
    """The run of a point of the laboratory's grid."""
    return record(config, load_sequence("shift_point", None, NAME), 1)


def rolling(config, speed: float) -> Rig:
    """Returns the rig as its vehicle rolls at a speed [m/s] in neutral, the engine off."""
    rig = Rig(config)
    me, car = rig.device("vehicle"), config.vehicle
    me["speed"] = speed
    wheel = speed / car.wheel_radius
    system = rig.world.plan.system
    turns = system.bodies_from_speeds[system.bodies.index("wheels")]
    j = abs(turns).argmax()
    rig.world.line["v"][j] = wheel / turns[j]
    return rig


def test_the_vehicle_coasts_down_as_the_closed_form(free):
    """With m dv/dt = -(F + c v^2), v = sqrt(F/c) tan(atan(v0 sqrt(c/F)) - sqrt(F c) t / m), and wheels and gears turn with it."""
    car, start, time = free.vehicle, 8.0, 10.0
    steady, air = car.rolling_resistance * car.mass * 9.80665, 0.5 * car.air_density * car.drag_area
    turning = (free.wheels.inertia + free.z5.inertia * (41 / 40) ** 2 * 13**2) / car.wheel_radius**2
    mass = car.mass + turning
    expected = math.sqrt(steady / air) * math.tan(
        math.atan(start * math.sqrt(air / steady)) - math.sqrt(steady * air) * time / mass
    )
    rig = rolling(free, start)
    rig.advance(time)
    assert float(rig.device("vehicle")["speed"]) == pytest.approx(expected, rel=2e-3) and expected < 6.5


def test_it_stands_uphill_on_its_brakes_and_rolls_back_without(config):
    rig = Rig(config)
    rig.set("road", 0.08, True)
    rig.set("brake", 20e3, True)
    rig.advance(15.0)  # until the oscillation of the tyres has decayed
    assert abs(float(rig.device("vehicle")["speed"])) < 1e-3
    assert float(rig.device("vehicle")["force"]) == pytest.approx(5000 * 9.80665 * math.sin(math.atan(0.08)), rel=1e-3)
    rig.set("brake", 0.0, False)
    rig.advance(1.0)
    assert float(rig.device("vehicle")["speed"]) < -0.2


def test_energy_closes_and_the_vehicle_knows_where_its_work_went(config):
    """The energy in motion, deflection, height, air and slip equals the work that the tyres took from the wheels."""
    rig = Rig(config)
    rig.set("oil", 4e6, True)
    rig.set("motor", 1500 * RPM, True)
    rig.advance(3.0)
    rig.order_gear(1)
    rig.set("road", 0.02, True)
    rig.advance(6.0)
    me, car, energy = rig.device("vehicle"), config.vehicle, rig.energy()
    spring = 0.5 * car.slip_stiffness / car.relaxation_length * float(me["deflection"]) ** 2
    found = 0.5 * car.mass * float(me["speed"]) ** 2 + spring + sum(float(me[name]) for name in ("lifted", "air", "tyre"))
    assert found == pytest.approx(float(me["taken"]), rel=1e-4) and found > 2e4
    assert abs(energy["residual"]) < 1e-9 * energy["motor"]


# plates with friction of 0.12 and without M_rest transmit less than the engine's torque; those of the rig hold it at rest
WEAK = {"plate_pack.friction_static": "0.12 -", "plate_pack.friction_kinetic": "0.12 -", "plate_pack.rest_torque": "0 Nm"}


@pytest.mark.parametrize("plates, stalls", [(WEAK, False), ({}, True)], ids=["weak plates", "the rig's"])
def test_brakes_in_gear_stop_the_vehicle_and_stall_an_engine_that_the_clutch_holds(config, plates, stalls):
    rig = Rig(with_overrides(config, {"motor.torque_low": "240 Nm", **plates}))
    rig.set("oil", 4e6, True)
    rig.set("motor", 1000 * RPM, True)
    rig.advance(3.0)
    rig.order_gear(1)
    rig.advance(6.0)
    rig.set("brake", 40e3, True)
    rig.advance(5.0)
    assert abs(float(rig.device("vehicle")["speed"])) < 0.01
    assert (float(rig.device("motor")["runs"]) == STALLED) is stalls
    if not stalls:  # the clutch, which carries less than the engine gives at this speed, slips
        assert rig.slip("clutch_s1") > 10.0 and rig.true("w0.speed") > 900 * RPM


def test_the_loss_of_the_output_is_that_of_the_laboratorys_gearbox(config):
    """By M_wyj = T - d, with the drag d on wk, the share of M_wyj is that of the clutches' torque T less a share of d."""
    own, laboratory = config.loss_out, load_rig("hydmag").loss_out
    assert (own.drag, own.share) == (laboratory.drag, laboratory.share)
    assert own.constant == pytest.approx(-laboratory.share * 41 / 40 * laboratory.drag, abs=1e-4)


def test_steady_travel_asks_for_what_the_hand_calculation_says(config, point):
    """At the point's grade M_wyj is its load, and M_wej that of the gearbox's losses."""
    table = calculations_of(NAME)["survival"].table(config, of_run(point, config))
    grid = calculations_of(NAME)["grid"].table(config)
    up = {"shift": "I-II", "n_wej": 1500, "M_wyj": 80}
    assert table.cell({"shift": "I-II"}, "M_wyj") == pytest.approx(80.0, abs=0.5)
    before = point.recording.channels["M_wej"][int(18e4) : int(18.2e4)].mean()
    assert before == pytest.approx(grid.cell(up, "M_wej"), abs=0.5)


def test_an_upshift_takes_more_than_the_engine_has_and_a_downshift_does_not(config, point):
    table = calculations_of(NAME)["survival"].table(config, of_run(point, config))
    assert table.cell({"shift": "I-II"}, "M_wej") > 271.0 and table.cell({"shift": "I-II"}, "lowest") > 850 * RPM
    assert table.cell({"shift": "I-II"}, "verdict") == 0.0 and table.cell({"shift": "II-I"}, "verdict") == 1.0


@pytest.mark.parametrize(
    "old, new, sentence",
    [
        ("mass: [5000 kg", "mass: [5000 m", r"rig\.yaml:\d+: vehicle\.mass.* expected a mass"),
        ("adhesion: [0.8 -", "adhesion: [-0.8 -", r"rig\.yaml:\d+: vehicle\.adhesion is -0\.8 -, outside"),
        ("torque: clutches", "torque: M_wyj", "whose load pushes"),
    ],
)
def test_a_wrong_value_gets_one_sentence(tmp_path, old, new, sentence):
    text = (RIGS_DIR / NAME / "rig.yaml").read_text()
    assert old in text
    (tmp_path / "rig.yaml").write_text(text.replace(old, new, 1))
    with pytest.raises(RigError, match=sentence) as error:
        Rig(load_rig(tmp_path))
    assert "\n" not in str(error.value)
