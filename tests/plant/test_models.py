# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Each device's equations, compared with values computed by hand from their source."""

import dataclasses
import functools
import math

import numpy as np
import pytest

from rig_nodes.base.schema import fill, record_dtype
from rig_nodes.plant.parts import dc_motor as motor
from rig_nodes.plant.parts import load_pump, oil_supply, plates
from rig_nodes.plant.parts import proportional_valve as valve
from rig_nodes.plant.parts import wet_clutch as clutch
from rig_nodes.plant.parts.gear_loss import GearLossConfig, loss_by_speed
from rig_nodes.rig.configuration import load_rig


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
    pack = dataclasses.replace(config.plate_pack, friction_spline=0.12)
    assert plates.torque_per_force(pack, friction) == pytest.approx(torque, abs=5e-5)
    plain = 12 * friction * 0.031948
    assert plates.torque_per_force(pack, friction) < plain
    assert plates.torque_per_force(pack, friction, releasing=True) > plain


def test_force_is_held_while_the_plates_stick_on_their_splines():
    # on release the force stays until it is twice the clamp force: it rises with the clamp, stays down to half of it, then follows
    force, seen = 0.0, []
    for clamp in (0.0, 1000.0, 2000.0, 1500.0, 1000.0, 800.0, 0.0):
        force = plates.held_force(force, clamp, 2.0)
        seen.append(force)
    assert seen == pytest.approx([0.0, 1000.0, 2000.0, 2000.0, 2000.0, 1600.0, 0.0])


def test_friction_falls_without_a_jump_from_rest_to_a_film_that_carries(config):
    """Stribeck's curve depends on viscosity times speed over pressure alone; at rest there is no film between the plates."""
    pack = dataclasses.replace(config.plate_pack, friction_speed=0.2, friction_pressure=1e6)
    force, slip = 1e6 * pack.area, 0.2 / pack.mean_radius
    stribeck = plates.derived_of_pack(pack, config.clutch_s1, 2e-3)["stribeck"]
    share = functools.partial(plates.boundary_share, stribeck=stribeck)
    assert share(0.0, force, 1.0) == 1.0 and share(0.0, 0.0, 1.0) == 1.0
    assert share(slip, force, 1.0) == pytest.approx(math.exp(-1.0)) == share(-slip, force, 1.0)
    assert share(0.5 * slip, force, 2.0) == pytest.approx(share(slip, force, 1.0))  # oil twice as viscous
    assert share(2.0 * slip, 2.0 * force, 1.0) == pytest.approx(share(slip, force, 1.0))  # twice the pressure
    assert share(1e-6 * slip, force, 1.0) == pytest.approx(1.0, abs=1e-5)
    assert share(100.0 * slip, force, 1.0) == 0.0 == share(slip, 0.0, 1.0)


def test_an_unclamped_pack_has_to_be_torn_loose_until_the_piston_has_gone_back(config):
    """M_rest comes with 200 N of clamp, stays without it, and disappears over 12 films of 0.1 mm."""
    c = record(
        dataclasses.replace(config.clutch_s1, clearance=2e-3),
        dataclasses.replace(config.plate_pack, film_force=200.0, film_gap=0.1e-3, surfaces=12),
    )
    way = (
        (0.0, 0.0, 0.0),
        (2.01e-3, 50.0, 0.25),
        (2.1e-3, 900.0, 1.0),
        (2.01e-3, 50.0, 1.0),
        (2e-3, 0.0, 1.0),
        (1.7e-3, 0.0, 0.75),
        (1.9e-3, 0.0, 0.75),
        (1.4e-3, 0.0, 0.5),
        (0.8e-3, 0.0, 0.0),
        (1.9e-3, 0.0, 0.0),
    )
    share = 0.0
    for piston, clamp, expected in way:
        share = plates.rest_share(share, piston, clamp, c)
        assert share == pytest.approx(expected), f"piston at {piston * 1e3} mm"


def test_coil_rises_with_its_time_constant(config):
    v = record(config.valve_zr_p1)
    tau = config.valve_zr_p1.coil_inductance / config.valve_zr_p1.coil_resistance
    steady = 24 * 0.5 / 22
    assert valve.coil_current(0.0, 0.5, tau, v) == pytest.approx(steady * (1 - math.exp(-1)))
    assert valve.coil_current(steady, 0.0, 10 * tau, v) < 1e-3 * steady


@pytest.fixture
def zr(config):
    """Returns a valve in round numbers: 4 MPa/A from 100 mA, 10 % hysteresis, 0.1 MPa friction, 0.1 MPa for the full stroke."""
    return record(
        dataclasses.replace(
            config.valve_zr_p1,
            pressure_gain=4e6,
            cracking_current=0.1,
            hysteresis=0.1,
            friction_pressure=0.1e6,
            pressure_limit=2.3e6,
            full_opening_pressure=0.1e6,
            spool_stroke=0.5e-3,
            spool_dead_band=0.5e-3,
        )
    )


def test_the_magnet_rises_and_falls_along_different_lines(zr):
    force, seen = 0.0, []
    for current in (0.3, 0.5, 0.45, 0.42, 0.3):
        force = valve.magnet_pressure(force, current, zr)
        seen.append(force)
    # 0.9 g i on the way up, nothing while 1.1 g i is above that, 1.1 g i on the way down
    assert seen == pytest.approx([1.08e6, 1.8e6, 1.8e6, 1.8e6, 1.32e6])


@pytest.mark.parametrize("magnet, lowest, highest", [(1.0e6, 0.5e6, 0.7e6), (0.4e6, -0.1e6, 0.1e6), (4.0e6, 2.3e6, 2.3e6)])
def test_friction_holds_the_spool_in_a_band_around_the_balance(zr, magnet, lowest, highest):
    """Magnet less spring (4 MPa/A x 0.1 A), 0.1 MPa of friction to both sides, and no more than 2.3 MPa."""
    assert valve.held_pressures(magnet, 0.1e6, zr) == pytest.approx((lowest, highest))


def test_spool_opens_closes_and_has_a_dead_band_on_the_relieving_side(zr):
    def opening(start, port):
        # magnet for 0.5 to 0.7 MPa; 1 s is far above the spool's time
        return valve.opening(valve.spool_position(start, 1.0e6, port, 1.0, 1.0, 0.1e6, zr), zr)

    assert opening(0.0, 0.45e6) == pytest.approx(0.5) and opening(0.0, 0.0) == pytest.approx(1.0)
    assert opening(0.1e-3, 0.6e6) == pytest.approx(0.2), "inside the band it stays where it is"
    assert opening(0.1e-3, 0.7e6) == pytest.approx(0.0, abs=1e-9), "closed at the upper end of the band"
    assert opening(0.0, 0.79e6) == 0.0 and opening(0.0, 0.85e6) == pytest.approx(-0.5)


def test_friction_holds_the_supply_open_up_to_the_limit_and_no_further(zr):
    """Magnet for 3.5 to 3.7 MPa, limit 2.3 MPa: a spool a tenth open closes there and releases pressure above the overlap."""

    def after(port):
        return valve.opening(valve.spool_position(0.05e-3, 4.0e6, port, 1.0, 1.0, 0.1e6, zr), zr)

    assert after(2.25e6) == pytest.approx(0.5) and after(2.295e6) == pytest.approx(0.05)
    assert after(2.31e6) == after(2.39e6) == 0.0 and after(2.45e6) == pytest.approx(-0.5)


def test_a_closing_pressure_closes(zr):
    for spool, reducing, edge in ((0.3e-3, True, 0.0), (-0.8e-3, False, -0.5e-3)):
        port = valve.closing_pressure(spool, reducing, 1.0e6, 8e-3, 1.0, 0.1e6, zr)
        assert valve.spool_position(spool, 1.0e6, port, 8e-3, 1.0, 0.1e6, zr) == pytest.approx(edge, abs=1e-12)


def test_pulses_are_on_for_their_duty():
    """At 1 kHz and duty 0.3 they are on from 0 to 0.3 ms of each period."""
    assert valve.on_share(0.0, 1e-4, 0.3, 1e3) == 1.0 and valve.on_share(4e-4, 1e-4, 0.3, 1e3) == 0.0
    assert valve.on_share(2.5e-4, 1e-4, 0.3, 1e3) == pytest.approx(0.5)
    assert sum(valve.on_share(k * 1e-4, 1e-4, 0.3, 1e3) for k in range(100)) == pytest.approx(30.0)


@pytest.mark.parametrize(
    "model, by_hand",
    [
        # one surface after the other has mu r_m F, 12 of them; k_os(12) = 1 - 0.03 x 10
        ("traditional", 12 * 0.17 * 0.031948),
        ("osinski", 0.7 * 12 * 0.17 * 0.031948),
    ],
)
def test_models_without_splines_follow_their_clamp_force(config, model, by_hand):
    assert plates.torque_per_force(config.plate_pack, 0.17, model=model) == pytest.approx(by_hand, rel=1e-4)
    assert plates.torque_per_force(config.plate_pack, 0.17, True, model) == pytest.approx(by_hand, rel=1e-4)


@pytest.mark.parametrize("model", ["newcomb", "chen"])
def test_models_with_splines_but_no_reading_of_the_release_follow_their_clamp_force(config, model):
    engaging = plates.torque_per_force(config.plate_pack, 0.30, model=model)
    assert plates.torque_per_force(config.plate_pack, 0.30, True, model) == engaging


def test_plates_heat_cool_and_wear(config):
    c = record(
        config.clutch_s1,
        dataclasses.replace(
            config.plate_pack,
            heat_capacity=200.0,
            cooling=50.0,
            friction_per_kelvin=-1e-3,
            friction_temperature=40.0,
            wear_rate=1e-15,
            wear_per_kelvin=0.01,
        ),
    )
    hot, wear = plates.plates_after(40.0, 0.0, 1000.0, 40.0, *plates.plates_cooling(1e-3, c), c)
    # 200 J/K over 50 W/K are 4 s: of 5 K at a constant rate within 1 ms, half of 1/4000 is lost again
    assert hot == pytest.approx(45.0 - 5.0 / 8000.0, abs=1e-6) and wear == pytest.approx(1e-12)
    assert plates.friction_factor(hot, c) == pytest.approx(0.995, rel=1e-6)
    cooler, more = plates.plates_after(hot, wear, 0.0, 40.0, *plates.plates_cooling(0.1, c), c)
    assert cooler == pytest.approx(40.0 + (hot - 40.0) * math.exp(-0.1 / 4.0)) and more == wear
    later = plates.plates_after(50.0, 0.0, 1000.0, 50.0, *plates.plates_cooling(1e-3, c), c)
    assert later[1] == pytest.approx(1.1e-12), "hot plates wear faster"


def test_orifice_limits_the_filling_flow(config):
    edges = dataclasses.replace(config.valve_zr_p1, orifice_area=0.9e-6, drain_area=0.5e-6)
    v = record(dataclasses.replace(edges, supply_bore_area=0.0, drain_bore_area=0.0))
    oil = valve.orifice_speed(870.0), valve.laminar_force(0.08, 870.0)
    flow, slope = valve.port_flow(1.0, 0.2e6, 4e6, *oil, v)
    assert flow == pytest.approx(0.9e-6 * math.sqrt(2 * 3.8e6 / 870), rel=1e-6)
    assert slope < 0.0
    assert valve.port_flow(1.0, 5e6, 4e6, *oil, v)[0] == 0.0, "no flow back into the supply"
    assert valve.port_flow(-1.0, 1e6, 4e6, *oil, v)[0] == pytest.approx(-0.5e-6 * math.sqrt(2e6 / 870), rel=1e-4)


@pytest.mark.parametrize("edge, bore, share", [("orifice_area", "supply_bore_area", 1.0), ("drain_area", "drain_bore_area", -1.0)])
def test_a_bore_beside_the_spool_limits_the_flow_of_a_wide_edge(config, edge, bore, share):
    """Edge and bore of 0.8 mm2 each, one after the other, are as 0.8 mm2 / sqrt(2)."""
    v = record(dataclasses.replace(config.valve_zr_p1, **{edge: 0.8e-6, bore: 0.8e-6}))
    assert valve.edge_area(share, v) == pytest.approx(0.8e-6 / math.sqrt(2.0))
    wide = record(dataclasses.replace(config.valve_zr_p1, **{edge: 80e-6, bore: 0.8e-6}))
    assert valve.edge_area(share, wide) == pytest.approx(0.8e-6, rel=1e-4)
    assert valve.edge_area(0.1 * share, wide) == pytest.approx(0.8e-6, rel=0.01), "a tenth of the way opens the bore already"


def test_the_spools_stops_limit_its_way_and_not_its_speed(config):
    """Far from its target the spool closes faster than by a stroke per time constant, and it stays at rest at its stop."""
    values = dataclasses.replace(config.valve_zr_p1, full_opening_pressure=0.2e6, spool_time=15e-3, spool_stroke=0.5e-3)
    v, cracks = record(values), values.pressure_gain * values.cracking_current
    closed = valve.spool_position(0.5e-3, 1.0e6 + cracks, 2.0e6, 1e-3, 1.0, 0.0, v)
    assert closed == pytest.approx(0.5e-3 - (0.5e-3 + 2.5e-3) * (1.0 - math.exp(-1.0 / 15.0)))
    opened = valve.spool_position(0.5e-3, 2.0e6 + cracks, 1.0e6, 1e-3, 1.0, 0.0, v)
    assert opened == 0.5e-3


def test_flow_of_cold_oil_is_laminar(config):
    """Where Re is far below 9.3, C_d = 0.2 sqrt(Re): the flow grows with the pressure drop itself and falls with the viscosity."""
    v = record(dataclasses.replace(config.valve_zr_p1, drain_area=1e-6, drain_bore_area=0.0))
    speed = valve.orifice_speed(870.0)

    def flow(drop, viscosity):
        return -valve.port_flow(-1.0, drop, 0.0, speed, valve.laminar_force(viscosity, 870.0), v)[0]

    assert flow(2e4, 20.0) == pytest.approx(2.0 * flow(1e4, 20.0), rel=1e-3)
    assert flow(1e4, 20.0) == pytest.approx(0.5 * flow(1e4, 10.0), rel=1e-3)
    # at 10 Pa s and 1e4 Pa by hand: C_d = 0.2 sqrt(v D / nu), v = C_d sqrt(2 dp / rho), with D of a round hole of 1 mm2 / 0.61
    diameter = math.sqrt(4e-6 / 0.61 / math.pi)
    c_d = 0.04 * math.sqrt(2e4 / 870.0) * diameter / (10.0 / 870.0)
    assert flow(1e4, 10.0) == pytest.approx(1e-6 / 0.61 * c_d * math.sqrt(2e4 / 870.0), rel=0.02)


def test_pulses_shake_the_spool_loose(config):
    """At 24 V, 0.35 H and half duty the current swings by 24 x 0.25 / (0.35 f): 34 mA at 500 Hz, 4.3 mA at 4 kHz."""
    v = record(dataclasses.replace(config.valve_zr_p1, pressure_gain=4e6, friction_pressure=0.02e6, coil_inductance=0.35))
    assert valve.friction_left(0.5, 500.0, v) == 0.0
    assert valve.friction_left(0.5, 4000.0, v) == pytest.approx(0.02e6 - 0.5 * 4e6 * 24 * 0.25 / (0.35 * 4000))
    assert valve.friction_left(0.0, 500.0, v) == 0.02e6, "no pulses, no dither"


def oil_record(**values):
    return record(dataclasses.replace(load_rig("hydmag").oil_supply, **values))


def test_viscosity_goes_through_both_points_and_bends_between_them_as_astm_d341_says():
    """ISO VG 46 with 46 and 6.8 mm2/s at 40 and 100 degC has by ASTM D341 about 110 mm2/s at 23 and some thousand at -20 degC."""
    oil = oil_record(viscosity=46e-6 * 870, second_viscosity=6.8e-6 * 870, density=870.0)
    at = {t: 1e6 * oil_supply.viscosity_at(float(t), oil)[0] / 870 for t in (-20, 23, 40, 100)}
    assert at[40] == pytest.approx(46.0) and at[100] == pytest.approx(6.8)
    assert 95 < at[23] < 120 and 2500 < at[-20] < 5000
    by_hand = 1e6 * (oil_supply.viscosity_at(40.01, oil)[0] - oil_supply.viscosity_at(39.99, oil)[0]) / 0.02 / 870
    assert by_hand == pytest.approx(-46.0 * oil_supply.viscosity_at(40.0, oil)[1], rel=1e-4)


def test_an_oil_with_one_viscosity_keeps_it():
    assert oil_supply.viscosity_at(-10.0, oil_record(second_viscosity=0.0)) == (pytest.approx(0.08), 0.0)


def test_turning_oil_presses_on_the_piston(config):
    """Radii 25 and 37 mm around a shaft, 2000 rpm: 870 / 2 x (209 x 0.0317)^2 is 19 kPa, 46 N on 2408 mm2."""
    c = record(dataclasses.replace(config.clutch_s1, piston_area=2408e-6, centrifugal_radius=31.7e-3), config.plate_pack)
    assert clutch.turning_force(2000 * math.pi / 30, 870.0, c) == pytest.approx(46.2, abs=0.5)
    assert clutch.turning_force(0.0, 870.0, c) == 0.0


def test_a_feed_resists_cold_oil_by_its_viscosity(config):
    """By hand for 3 mm2 and 10 Pa s: C_d = 0.2 sqrt(v D / nu) makes the drop proportional to flow and viscosity."""
    c = record(dataclasses.replace(config.clutch_s1, feed_area=3e-6), config.plate_pack)
    diameter = math.sqrt(4 * 3e-6 / 0.61 / math.pi)
    # Q = (A / 0.61) C_d sqrt(2 dp / rho) with C_d = 0.2^2 sqrt(2 dp / rho) D / nu
    flow_per_drop = 3e-6 / 0.61 * 0.04 * 2 / 870 * diameter / (10.0 / 870)
    assert 10.0 * clutch.feed_resistance(record(config.oil_supply), c) == pytest.approx(1.0 / flow_per_drop, rel=0.02)


@pytest.mark.parametrize("part, kiss", [("clutch_s1", 0.17e6), ("clutch_s2", 0.36e6)])
def test_kiss_point_lies_where_the_thesis_puts_it(config, part, kiss):
    """Static balance at the clearance: area p - seal = preload + rate x (7.3.2 gives the pressures)."""
    c = getattr(config, part)
    spring = c.spring_preload + c.spring_rate * c.clearance
    pressure = (spring + c.seal_friction) / (c.piston_area * (1 - c.seal_friction_share))
    # within the largest error of the transducer with which it was read (tab. 7.1)
    assert pressure == pytest.approx(kiss, abs=0.1e6 if part == "clutch_s1" else 0.063e6)


def test_piston_rests_on_its_seals_and_moves_against_its_springs(config):
    """128 N + 128 N/mm against 2480 mm2, seals 24 N and 3 %, pack 600 N/mm that is flat after 1.4 mm."""
    cylinder = dataclasses.replace(
        config.clutch_s1,
        piston_area=2480e-6,
        force_per_pressure_squared=0.0,
        spring_preload=128.0,
        spring_rate=128e3,
        seal_friction=24.0,
        seal_friction_share=0.03,
        clearance=2.04e-3,
        pack_rate=600e3,
        pack_travel=1.4e-3,
        piston_damping=2000.0,
    )
    c = record(cylinder, config.plate_pack)
    x, slope = clutch.piston_step(0.001, (128 + 128) / 2480e-6, 0.0, 1e-4, 2000.0, c)  # springs balanced: within seal friction
    assert (x, slope) == (0.001, 0.0)
    x = 0.0
    for _ in range(20_000):
        x, _ = clutch.piston_step(x, 0.12e6, 0.0, 1e-4, 2000.0, c)
    by_hand = (2480e-6 * 0.12e6 * 0.97 - 24 - 128) / 128e3
    assert x == pytest.approx(by_hand, rel=1e-3)
    assert clutch.pack_force(x, c)[0] == 0.0
    assert clutch.pack_force(2.04e-3 + 0.7e-3, c)[0] == pytest.approx(600e3 * 0.7e-3 / (1 - 0.7 / 1.4))


@pytest.mark.parametrize("part, linear, square", [("clutch_s1", 2408.2, 140.0), ("clutch_s2", 2454.4, 123.55)])
def test_the_clamp_force_grows_with_the_pressure_as_annex_d_says(config, part, linear, square):
    """F_p = linear p + square p^2 (p in MPa) less an offset: increase of the force of a rising piston from 1 to 2 MPa."""
    cylinder = dataclasses.replace(getattr(config, part), pack_rate=5e6, pack_travel=5e-3)
    c, forces = record(cylinder, config.plate_pack), []
    for pressure in (1e6, 2e6):
        x = 0.0
        for _ in range(200):
            x, _ = clutch.piston_step(x, pressure, 0.0, 1e-2, cylinder.piston_damping, c)
        forces.append(clutch.pack_force(x, c)[0] + cylinder.spring_rate * x)
    assert forces[1] - forces[0] == pytest.approx((linear + square * 3.0), rel=0.02)


def test_load_is_what_the_relief_valve_makes_of_the_speed(config):
    """Annex D: f(n) has its minimum 1.057 at 828 rpm."""
    rpm = math.pi / 30
    assert load_pump.relief_factor(828 * rpm) == pytest.approx(1.0566, abs=1e-3)
    setting = load_pump.relief_setting_for(80.0, 1085 * rpm, config.load_pump)
    pump = record(config.load_pump)
    pressure = load_pump.line_pressure(0.0, setting, True, 1085 * rpm, 10.0, pump)
    assert load_pump.torque_capacity(pressure, pump) == pytest.approx(80.0, rel=1e-6)


def test_the_loss_by_speed_runs_down_along_the_printed_parabola():
    """(7.7): w = 0.5735 t2 - 11.736 t + 49.274, so dw/dt is -11.736 rad/s2 at first, -7.148 rad/s2 after 4 s at 11.506
    rad/s; the torques are those times 0.709 kg m2, and 3.522 Nm where the parabola ends, at 4.967 rad/s2.
    """
    loss = record(
        GearLossConfig(
            by_speed=0.0, at_rest=3.522, at_470=8.321, drag=0.0, constant=0.0, share=0.0, square=0.0, torque_side="driven"
        )
    )
    assert loss_by_speed(49.274, loss) == pytest.approx(0.709 * 11.736, rel=1e-3)
    assert loss_by_speed(11.506, loss) == pytest.approx(0.709 * 7.148, rel=2e-3)
    assert loss_by_speed(0.0, loss) == pytest.approx(3.522)
    assert loss_by_speed(209.4, loss) > loss_by_speed(157.1, loss) + 1.0, "more at more speed (7.4.2.2)"


def test_drive_without_permission_has_no_torque(config):
    m = record(config.motor)
    assert motor.drive_torque(100.0, 50.0, 150.0, 100.0, False, 1e-4, m) == (0.0, 0.0)
    torque, _ = motor.drive_torque(0.0, 0.0, 150.0, 50.0, True, 1.0, m)
    assert torque == pytest.approx(500.0), "limited by the torque limit"
    torque, _ = motor.drive_torque(0.0, 0.0, 300.0, 200.0, True, 1.0, m)
    assert torque == pytest.approx(350.0), "limited by 70 kW at 200 rad/s"
