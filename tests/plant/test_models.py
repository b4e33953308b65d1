"""Each device's equations against values computed by hand from their source."""

import math

import numpy as np
import pytest

from rig_nodes.config.schema import fill, record_dtype
from rig_nodes.instruments.noise import noise
from rig_nodes.plant import clutch, load_pump, motor, valve
from rig_nodes.testbench.configuration import load_rig


def record(*instances):
    out = np.zeros(1, record_dtype(*map(type, instances)))
    fill(out, *instances)
    return out[0]


@pytest.fixture(scope="module")
def config():
    return load_rig("hydmag")


@pytest.mark.parametrize("friction, torque", [(0.17, 0.0478), (0.30, 0.0682)])
def test_torque_per_force_of_the_gearbox_pack(config, friction, torque):
    """(6.54), (6.55) for 12 surfaces; without spline friction it is n mu r_m with r_m = 31.95 mm (6.5)."""
    assert clutch.torque_per_force(config.plate_pack, friction) == pytest.approx(torque, abs=5e-5)
    plain = 12 * friction * 0.031948
    assert clutch.torque_per_force(config.plate_pack, friction) < plain
    assert clutch.torque_per_force(config.plate_pack, friction, releasing=True) > plain


def test_capacity_is_held_while_the_plates_stick_on_their_splines():
    # engaging 0.05 Nm/N, releasing 0.10 Nm/N: rises with the clamp, stays down to half of it, then follows
    torque, seen = 0.0, []
    for clamp in (0.0, 1000.0, 2000.0, 1500.0, 1000.0, 800.0, 0.0):
        torque = clutch.held_torque(torque, clamp, 0.05, 0.10)
        seen.append(torque)
    assert seen == pytest.approx([0.0, 50.0, 100.0, 100.0, 100.0, 80.0, 0.0])


def test_coil_rises_with_its_time_constant(config):
    v = record(config.valve_zr_p1)
    tau = config.valve_zr_p1.coil_inductance / config.valve_zr_p1.coil_resistance
    steady = 24 * 0.5 / 22
    assert valve.coil_current(0.0, 0.5, tau, v) == pytest.approx(steady * (1 - math.exp(-1)))
    assert valve.coil_current(steady, 0.0, 10 * tau, v) < 1e-3 * steady


@pytest.mark.parametrize("current, pressure", [(0.10, 0.0), (0.130, 0.0), (0.23, 0.427e6), (0.74, 2.3e6)])
def test_static_line_of_the_valve(config, current, pressure):
    assert valve.commanded_pressure(current, record(config.valve_zr_p1)) == pytest.approx(pressure, abs=1.0)


def test_spool_has_a_dead_band_on_the_relieving_side(config):
    v = record(config.valve_zr_p1)
    settled = 1.0  # s, far above the spool's time
    within = valve.spool_position(0.0, 0.23, 0.427e6 + 0.09e6, settled, v)
    assert valve.opening(within, v) == 0.0
    assert valve.opening(valve.spool_position(0.0, 0.23, 0.427e6 + 0.15e6, settled, v), v) == pytest.approx(-0.5)
    assert valve.opening(valve.spool_position(0.0, 0.23, 0.427e6 - 0.05e6, settled, v), v) == pytest.approx(0.5)
    assert valve.opening(valve.spool_position(0.0, 0.74, 0.0, settled, v), v) == pytest.approx(1.0)


def test_orifice_limits_the_filling_flow(config):
    v = record(config.valve_zr_p1)
    flow, slope = valve.port_flow(1.0, 0.2e6, 4e6, 870.0, v)
    assert flow == pytest.approx(0.65e-6 * math.sqrt(2 * 3.8e6 / 870), rel=1e-6)
    assert slope < 0.0
    assert valve.port_flow(1.0, 5e6, 4e6, 870.0, v)[0] == 0.0, "no flow back into the supply"
    assert valve.port_flow(-1.0, 1e6, 4e6, 870.0, v)[0] == pytest.approx(-0.35e-6 * math.sqrt(2e6 / 870), rel=1e-4)


@pytest.mark.parametrize("part, kiss", [("clutch_s1", 0.17e6), ("clutch_s2", 0.36e6)])
def test_kiss_point_lies_where_the_thesis_puts_it(config, part, kiss):
    """Static balance at the clearance: area p - seal = preload + rate x (7.3.2 gives the pressures)."""
    c = getattr(config, part)
    spring = c.spring_preload + c.spring_rate * c.clearance
    pressure = (spring + c.seal_friction) / (c.piston_area * (1 - c.seal_friction_share))
    assert pressure == pytest.approx(kiss, rel=0.05)


def test_piston_rests_on_its_seals_and_moves_against_its_springs(config):
    c = record(config.clutch_s1, config.plate_pack)
    cylinder = config.clutch_s1
    x, slope = clutch.piston_step(0.001, (128 + 128) / 2480e-6, 1e-4, c)  # springs balanced: within seal friction
    assert (x, slope) == (0.001, 0.0)
    x = 0.0
    for _ in range(20_000):
        x, _ = clutch.piston_step(x, 0.12e6, 1e-4, c)
    by_hand = (2480e-6 * 0.12e6 * 0.97 - 24 - 128) / 128e3
    assert x == pytest.approx(by_hand, rel=1e-3)
    assert clutch.pack_force(x, c)[0] == 0.0 and clutch.pack_force(cylinder.clearance + 0.7e-3, c)[0] == \
        pytest.approx(600e3 * 0.7e-3 / (1 - 0.7 / 1.4))


def test_load_is_what_the_relief_valve_makes_of_the_speed(config):
    """Annex D: f(n) has its minimum 1.057 at 828 rpm."""
    rpm = math.pi / 30
    assert load_pump.relief_factor(828 * rpm) == pytest.approx(1.0566, abs=1e-3)
    setting = load_pump.relief_setting_for(80.0, 1085 * rpm, config.load_pump)
    pump = record(config.load_pump)
    pressure = load_pump.line_pressure(0.0, setting, True, 1085 * rpm, 10.0, pump)
    assert load_pump.torque_capacity(pressure, pump) == pytest.approx(80.0, rel=1e-6)


def test_drive_without_permission_has_no_torque(config):
    m = record(config.motor)
    assert motor.drive_torque(100.0, 50.0, 150.0, 100.0, False, 1e-4, m) == (0.0, 0.0)
    torque, _ = motor.drive_torque(0.0, 0.0, 150.0, 50.0, True, 1.0, m)
    assert torque == pytest.approx(500.0), "limited by the torque limit"
    torque, _ = motor.drive_torque(0.0, 0.0, 300.0, 200.0, True, 1.0, m)
    assert torque == pytest.approx(350.0), "limited by 70 kW at 200 rad/s"


def test_noise_is_counter_based_with_unit_variance():
    values = np.array([noise(7, 3, k) for k in range(20_000)])
    assert values.mean() == pytest.approx(0.0, abs=0.03) and values.std() == pytest.approx(1.0, abs=0.02)
    assert np.abs(values).max() < 3.5
    assert noise(7, 3, 1234) == values[1234] != noise(7, 4, 1234)
    assert abs(np.corrcoef(values[:-1], values[1:])[0, 1]) < 0.03
