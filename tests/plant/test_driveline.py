# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The general driveline: analytic cases, exact sticking, events, energy, refusals."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rig_nodes.base.errors import RigError
from rig_nodes.driveline import algebra
from rig_nodes.driveline.builder import Driveline
from rig_nodes.driveline.kernel import driveline_step
from rig_nodes.driveline.run import run
from rig_nodes.driveline.state import Loads


def pair(stick=1.0, w1=100.0, w2=0.0, drag=0.0):
    d = Driveline()
    d.inertia("a", 0.7, speed=w1)
    d.inertia("b", 0.127, speed=w2)
    d.clutch("c", "a", "b", stick=stick, drag=drag)
    return d.build()


def kinds(result, element=None):
    return [e.kind for e in result.events if element in (None, e.element)]


def event(result, element, kind):
    found = [e for e in result.events if (e.element, e.kind) == (element, kind)]
    assert len(found) == 1, result.events
    return found[0].t


def test_engagement_with_constant_capacity():
    r = run(pair(), 1.0, 0.01, {"c": 30.0})
    lock = 100.0 / (30.0 / 0.7 + 30.0 / 0.127)
    assert event(r, "c", "lock") == pytest.approx(lock, abs=1e-12)
    common = 0.7 * 100.0 / 0.827
    assert r.speeds[-1] == pytest.approx([common, common], abs=1e-10)
    assert r.e_fric[-1, 0] == pytest.approx(0.5 * 100.0**2 * 0.7 * 0.127 / 0.827, rel=1e-12)
    assert r.impulse[-1, 0] == pytest.approx(0.127 * common, rel=1e-12)


def test_engagement_with_ramp_is_exact_at_any_step():
    ramp = ([0.0, 0.5], [0.0, 264.0])
    lock = math.sqrt(2.0 * 100.0 / (528.0 * (1.0 / 0.7 + 1.0 / 0.127)))
    for step in (0.5, 0.013, 1e-3):
        r = run(pair(), 0.5, step, {"c": ramp})
        assert event(r, "c", "lock") == pytest.approx(lock, abs=1e-11)
        assert np.abs(r.residual()).max() < 1e-9


def test_breaks_away_when_torque_crosses_the_static_limit():
    d = Driveline()
    d.inertia("a", 2.0)
    d.brake("b", "a", stick=1.3)
    r = run(d.build(), 1.0, 0.03, {"a": ([0.0, 1.0], [0.0, 40.0]), "b": 20.0})
    away = 26.0 / 40.0
    assert kinds(r, "b") == ["lock", "break"]
    assert event(r, "b", "break") == pytest.approx(away, abs=1e-11)
    assert np.all(r.speeds[r.t < away] == 0.0)
    assert r.torques[r.t > away + 0.03] == pytest.approx(20.0)
    slide = 1.0 - away
    assert r.speeds[-1, 0] == pytest.approx((6.0 * slide + 20.0 * slide**2) / 2.0, rel=1e-12)


def test_breaks_away_when_the_clutch_opens():
    d = Driveline()
    d.inertia("a", 1.0)
    d.brake("b", "a", stick=1.2)
    r = run(d.build(), 1.0, 0.07, {"a": -6.0, "b": ([0.0, 1.0], [10.0, 0.0])})
    assert event(r, "b", "break") == pytest.approx(0.5, abs=1e-11)
    assert r.speeds[-1, 0] == pytest.approx(-(6.0 * 0.5 - 5.0 * 0.5 + 5.0 * 0.5**2), rel=1e-12)


def test_brake_stops_the_shaft_and_never_turns_it_back():
    d = Driveline()
    d.inertia("a", 0.5, speed=20.0)
    d.brake("b", "a")
    r = run(d.build(), 2.0, 1e-3, {"a": lambda t: -8.0 + 5.0 * math.sin(40.0 * t), "b": 14.0})
    w = r.speed("a")
    assert w.min() == 0.0
    stop = event(r, "b", "lock")
    assert np.all(w[r.t >= stop] == 0.0)
    assert np.abs(r.torque("b")[r.t > stop + 1e-3] - (-8.0 + 5.0 * np.sin(40.0 * r.t[r.t > stop + 1e-3]))).max() < 1e-9


def test_slides_through_zero_where_friction_is_too_weak():
    d = Driveline()
    d.inertia("a", 1.0, speed=1.0)
    d.brake("b", "a")
    r = run(d.build(), 1.0, 0.3, {"a": -10.0, "b": 2.0})
    assert event(r, "b", "cross") == pytest.approx(1.0 / 12.0, abs=1e-13)
    assert r.speeds[-1, 0] == pytest.approx(-8.0 * (1.0 - 1.0 / 12.0), rel=1e-12)


def test_freewheel_drives_and_overruns():
    d = Driveline()
    d.inertia("a", 1.0)
    d.inertia("b", 3.0, speed=2.0)
    d.freewheel("f", "a", "b")
    r = run(d.build(), 2.0, 0.01, {"a": ([0.0, 1.0, 1.0, 2.0], [4.0, 4.0, -4.0, -4.0])})
    assert event(r, "f", "lock") == pytest.approx(0.5, abs=1e-12)
    assert event(r, "f", "break") == pytest.approx(1.0, abs=1e-12)
    assert r.speeds[-1] == pytest.approx([2.5 - 4.0, 2.5], abs=1e-12)
    driving = (r.t > 0.51) & (r.t < 0.99)
    assert r.torque("f")[driving] == pytest.approx(3.0)
    assert np.all(r.torque("f") >= 0.0)
    assert np.all(r.speed("a") - r.speed("b") < 1e-13)


def free_pair_on_shaft(damping=0.0, stiffness=4000.0):
    d = Driveline()
    d.inertia("a", 0.7, speed=1.0)
    d.inertia("b", 0.3, speed=-1.0)
    d.shaft("s", "a", "b", stiffness=stiffness, damping=damping)
    return d.build()


def test_natural_frequency_on_a_coarse_step():
    omega = math.sqrt(4000.0 * (1.0 / 0.7 + 1.0 / 0.3))
    period = 2.0 * math.pi / omega
    r = run(free_pair_on_shaft(), 50.0 * period, period / 60.0)
    slip = r.speed("a") - r.speed("b")
    up = np.flatnonzero((slip[:-1] < 0.0) & (slip[1:] >= 0.0))
    at = r.t[up] - slip[up] * (r.t[up + 1] - r.t[up]) / (slip[up + 1] - slip[up])
    assert np.mean(np.diff(at)) == pytest.approx(period, rel=1e-3)


def test_stiff_shaft_neither_gains_nor_loses_energy():
    # 1e5 steps of twice the natural period each
    system = free_pair_on_shaft(stiffness=4e8)
    r = run(system, 100.0, 1e-3)
    assert np.abs(r.stored / r.stored[0] - 1.0).max() < 1e-9
    damped = run(free_pair_on_shaft(stiffness=4e8, damping=50.0), 10.0, 1e-3)
    assert np.all(np.diff(damped.stored) <= 1e-12)
    assert np.abs(damped.residual()).max() < 1e-9


def test_three_elements_lock_in_one_step_and_at_one_instant():
    d = Driveline()
    for name, speed in (("a", 3.0), ("b", 2.0), ("c", 1.0)):
        d.inertia(name, 1.0, speed=speed)
    d.clutch("ab", "a", "b")
    d.clutch("bc", "b", "c")
    d.brake("cg", "c")
    # deceleration 30, 20, 10 rad/s2: all three reach standstill at 0.1 s
    r = run(d.build(), 0.5, 0.5, {"ab": 30.0, "bc": 50.0, "cg": 60.0})
    assert [e.kind for e in r.events if e.t > 0.0] == ["lock"] * 3
    assert [e.t for e in r.events if e.t > 0.0] == pytest.approx([0.1] * 3, abs=1e-12)
    assert np.abs(r.speeds[-1]).max() < 1e-12
    assert r.capped == 0


def test_redundant_brakes_share_the_load_and_let_go_together():
    d = Driveline()
    d.inertia("a", 1.0, speed=1.0)
    d.brake("small", "a")
    d.brake("large", "a")
    r = run(d.build(), 2.0, 0.01, {"a": ([0.0, 1.0, 2.0], [0.0, 0.0, 220.0]), "small": 10.0, "large": 100.0})
    stop = event(r, "small", "lock")
    assert stop == pytest.approx(1.0 / 110.0, abs=1e-12) and event(r, "large", "lock") == stop
    assert event(r, "small", "break") == pytest.approx(1.5, abs=1e-10)
    assert event(r, "large", "break") == pytest.approx(1.5, abs=1e-10)
    held = (r.t > 0.05) & (r.t < 1.5)
    assert np.all(np.abs(r.speeds[held]) < 1e-14)
    load = np.interp(r.t, [0.0, 1.0, 2.0], [0.0, 0.0, 220.0])
    assert r.torques.sum(axis=1)[held] == pytest.approx(load[held], abs=1e-9)
    assert np.all(r.torque("small")[held] <= 10.0 + 1e-9)


def gearbox(stick=1.2, drag=0.002):
    """Returns a two-speed box: both clutches on geared wheels, brake on the output, back-stop on the input."""
    d = Driveline()
    d.inertia("in", 0.7, speed=150.0)
    d.inertia("out", 0.5, speed=60.0)
    d.inertia("wheel", 0.1)
    d.gear("wheel", "out", -2.0)
    d.clutch("s1", "in", "out", 1.0, 2.5, stick=stick, drag=drag)
    d.clutch("s2", "in", "wheel", 1.0, -0.6, stick=stick, drag=drag)
    d.brake("load", "out", stick=stick, drag=drag)
    d.brake("seal", "in", stick=stick)
    d.inertia("body", 8.0, speed=60.0)
    d.shaft("tyre", "out", "body", stiffness=900.0, damping=3.0)
    return d.build()


SHIFT = {
    "in": 60.0,
    "s1": ([0.0, 0.3, 0.35, 1.0, 1.1], [300.0, 300.0, 0.0, 0.0, 400.0]),
    "s2": ([0.0, 0.3, 0.5, 1.5], [0.0, 0.0, 250.0, 400.0]),
    "load": ([0.0, 0.9, 1.2], [80.0, 80.0, 1500.0]),
    "seal": 1.0,
}


def test_tie_up_with_every_element_locked_does_not_crash():
    r = run(gearbox(), 2.0, 1e-3, SHIFT)
    assert np.abs(r.residual()).max() < 1e-8 * r.e_in[-1]
    assert np.all(np.abs(r.modes[-1]) >= 2)
    assert np.abs(r.speed("in")[-1]) < 1e-12 and np.abs(r.speed("out")[-1]) < 1e-12
    assert r.capped == 0
    assert np.all(np.diff(r.e_fric, axis=0) >= 0.0) and np.all(np.diff(r.e_visc, axis=0) >= 0.0)


def test_locked_clutch_does_not_creep_over_a_million_steps():
    system = pair(stick=1.1, w1=90.0, w2=90.0)
    x, cap, q = system.state(), system.limits(), np.zeros((2, 2))
    cap[algebra.KIN0 : algebra.KIN1 + 1], cap[algebra.HI0 : algebra.HI1 + 1] = 30.0, 33.0
    cap[algebra.LO0 : algebra.LO1 + 1] = -33.0
    worst = 0.0
    for i in range(20000):
        q[:, 0] = 7.3 * (-1.0) ** i + 0.01
        driveline_step(1e-3, i * 1e-3, system.structure, Loads(q, cap), system.losses(), x)
        worst = max(worst, abs(x.v[0] - x.v[1]))
    assert x.mode[0] == algebra.STUCK and worst < 1e-13
    assert x.v[0] == pytest.approx(90.0 + 0.01 * 20.0 / 0.827, rel=1e-9)


def test_drag_that_comes_after_a_very_short_step_is_met_as_any_other():
    def moved(before):
        system = pair(w1=90.0, w2=0.0)
        x, cap, q = system.state(), system.limits(), np.zeros((2, 2))
        for h, drag in (*before, (1.0, 1e-4)):
            cap[algebra.VISC] = drag
            driveline_step(h, 0.0, system.structure, Loads(q, cap), system.losses(), x)
        return x.v

    assert np.array_equal(moved([(1e-9, 0.0)]), moved([]))


def test_mirrored_signs_give_the_mirrored_motion():
    def mirrored(sign):
        d = Driveline()
        for name, j, speed in (("a", 0.7, 9.0), ("b", 0.2, -3.0), ("c", 1.1, 1.0)):
            d.inertia(name, j, speed=sign * speed)
        d.clutch("ab", "a", "b", stick=1.2)
        d.clutch("bc", "b", "c", stick=1.1, drag=0.01)
        d.brake("cg", "c", stick=1.3)
        d.shaft("s", "a", "c", stiffness=300.0, damping=0.4)
        return run(
            d.build(),
            3.0,
            1e-3,
            {"a": lambda t: sign * 20.0 * math.sin(7.0 * t), "ab": 6.0, "bc": lambda t: 9.0 + 8.0 * math.cos(3.0 * t), "cg": 4.0},
        )

    plus, minus = mirrored(1.0), mirrored(-1.0)
    assert len(plus.events) > 10
    assert plus.events == minus.events
    assert np.array_equal(plus.speeds, -minus.speeds) and np.array_equal(plus.torques, -minus.torques)
    assert np.array_equal(plus.e_fric, minus.e_fric)


def test_running_in_pieces_gives_the_same_bits():
    """A second run that begins every step with a new work buffer, as after a restart, ends with the same values."""
    system = gearbox()
    q, cap = np.zeros((2, len(system.speeds))), system.limits()
    q[:] = 60.0 * system.bodies_from_speeds[system.bodies.index("in")]
    one, other = system.state(), system.state()
    for i in range(1500):
        t = i * 1e-3
        for f, name in enumerate(system.elements):
            table = SHIFT[name] if isinstance(SHIFT[name], tuple) else ([0.0], [SHIFT[name]])
            for k in (0, 1):
                kin = np.interp(t + k * 1e-3, *table)
                cap[algebra.KIN0 + k, f], cap[algebra.HI0 + k, f] = kin, 1.2 * kin
                cap[algebra.LO0 + k, f] = -1.2 * kin
        for x in (one, other):
            driveline_step(1e-3, t, system.structure, Loads(q, cap), system.losses(), x)
        other.work[:] = 0.0
    assert one.count[algebra.N_EVENTS] > 5
    for a, b in (
        (one.v, other.v),
        (one.twist, other.twist),
        (one.mode, other.mode),
        (one.el, other.el),
        (one.events, other.events),
    ):
        assert np.array_equal(a, b)


def test_a_shift_with_a_shaft_and_drag_does_not_depend_on_the_step():
    """Speeds and the times of lock-up and break-away of steps of 4 ms are those of 0.125 ms."""
    coarse, fine = (run(gearbox(), 0.9, step, SHIFT) for step in (4e-3, 1.25e-4))
    assert coarse.speeds[-1] == pytest.approx(fine.speeds[-1], abs=1e-9)
    assert [(e.element, e.kind) for e in coarse.events] == [(e.element, e.kind) for e in fine.events]
    assert [e.t for e in coarse.events] == pytest.approx([e.t for e in fine.events], abs=1e-10)


def test_random_chain_against_scipy():
    """Three bodies with slipping clutches, drag and a shaft have the speeds of an adaptive solver; no clutch locks."""
    rng = np.random.default_rng(7)
    j = rng.uniform(0.2, 1.5, 3)
    d = Driveline()
    for i, speed in enumerate((80.0, 40.0, 10.0)):
        d.inertia(f"J{i}", j[i], speed=speed)
    d.clutch("c0", "J0", "J1", drag=0.05)
    d.clutch("c1", "J1", "J2", drag=0.02)
    d.shaft("s", "J0", "J2", stiffness=30.0, damping=0.3)
    r = run(
        d.build(), 0.1, 1e-4, {"J0": lambda t: 30.0 * math.cos(9.0 * t), "J2": -4.0, "c0": 12.0, "c1": lambda t: 5.0 + 20.0 * t}
    )

    def rate(t, y):
        c0 = 12.0 + 0.05 * (y[0] - y[1])
        c1 = 5.0 + 20.0 * t + 0.02 * (y[1] - y[2])
        s = 30.0 * y[3] + 0.3 * (y[0] - y[2])
        return [(30.0 * math.cos(9.0 * t) - c0 - s) / j[0], (c0 - c1) / j[1], (c1 + s - 4.0) / j[2], y[0] - y[2]]

    truth = solve_ivp(rate, (0.0, 0.1), [80.0, 40.0, 10.0, 0.0], method="DOP853", rtol=1e-11, atol=1e-11)
    assert [e.kind for e in r.events] == ["close"] * 2
    assert r.speeds[-1] == pytest.approx(truth.y[:3, -1], abs=1e-5)


def test_lock_time_with_drag_and_shaft_against_scipy_events():
    system = pair(drag=0.3)
    r = run(system, 1.0, 1e-3, {"c": 30.0, "a": 12.0})

    def rate(t, y):
        c = 30.0 + 0.3 * (y[0] - y[1])
        return [(12.0 - c) / 0.7, c / 0.127]

    def locked(t, y):
        return y[0] - y[1]

    locked.terminal = True
    truth = solve_ivp(rate, (0.0, 1.0), [100.0, 0.0], events=locked, rtol=1e-11, atol=1e-11)
    assert event(r, "c", "lock") == pytest.approx(truth.t_events[0][0], abs=1e-6)


def test_geared_bodies_act_with_reduced_inertia():
    d = Driveline()
    d.inertia("motor", 0.1)
    d.inertia("wheel", 2.0)
    d.gear("motor", "wheel", 5.0)
    r = run(d.build(), 1.0, 0.1, {"motor": 3.0, "wheel": -1.0})
    assert r.speed("wheel")[-1] == pytest.approx((5.0 * 3.0 - 1.0) / (2.0 + 25.0 * 0.1), rel=1e-12)
    assert r.speed("motor")[-1] == pytest.approx(5.0 * r.speed("wheel")[-1], rel=1e-14)


K = 2.5  # teeth of the ring over those of the sun


@pytest.mark.parametrize("held, driven, ratio", [("ring", "carrier", 1.0 + K), ("carrier", "ring", -K)])
@pytest.mark.parametrize("by", ["ground", "brake"])
def test_a_planetary_set_with_one_member_held_is_a_gear_by_willis(held, driven, ratio, by):
    d = Driveline()
    for name, j in (("sun", 0.2), ("ring", 0.7), ("carrier", 0.5)):
        if not (by == "ground" and name == held):
            d.inertia(name, j)
    member = {name: name for name in ("sun", "ring", "carrier")} | ({held: "ground"} if by == "ground" else {})
    d.planetary("set", member["sun"], member["ring"], member["carrier"], K)
    if by == "brake":
        d.brake("brake", held)
    r = run(d.build(), 1.0, 0.1, {"sun": 3.0} | ({"brake": 1e3} if by == "brake" else {}))
    j = {"ring": 0.7, "carrier": 0.5}[driven]
    assert r.speed(driven)[-1] == pytest.approx(3.0 * ratio / (0.2 * ratio**2 + j), rel=1e-12)
    assert r.speed("sun")[-1] == pytest.approx(ratio * r.speed(driven)[-1], rel=1e-12)
    if by == "brake":
        assert abs(r.speed(held)[-1]) < 1e-12


def test_a_planetary_set_with_its_sun_held_drives_the_carrier_slower_than_the_ring():
    d = Driveline()
    d.inertia("ring", 0.7, speed=14.0)
    d.inertia("carrier", 0.0)
    d.planetary("set", "ground", "ring", "carrier", K)
    system = d.build()
    assert system.speeds == ("ring",)
    r = run(system, 1.0, 0.1, {"carrier": -4.0})
    assert r.speed("carrier") == pytest.approx(r.speed("ring") * K / (1.0 + K), rel=1e-12)
    assert r.speed("ring")[-1] == pytest.approx(14.0 - 4.0 * K / (1.0 + K) / 0.7, rel=1e-12)


def test_a_free_planetary_set_accelerates_by_its_two_by_two_mass_matrix():
    js, jr, jc = 0.2, 0.7, 0.5
    d = Driveline()
    d.inertia("sun", js)
    d.inertia("ring", jr, speed=-3.0)
    d.inertia("carrier", jc, speed=2.0)
    d.planetary("set", "sun", "ring", "carrier", K)
    system = d.build()
    assert system.speeds == ("sun", "ring")
    by_sun, by_ring = 1.0 / (1.0 + K), K / (1.0 + K)  # w_carrier = by_sun w_sun + by_ring w_ring
    mass = np.array([[js + jc * by_sun**2, jc * by_sun * by_ring], [jc * by_sun * by_ring, jr + jc * by_ring**2]])
    assert system.mass == pytest.approx(mass, rel=1e-14)
    start = np.array([2.0 * (1.0 + K) + 3.0 * K, -3.0])
    r = run(system, 1.0, 0.1, {"sun": 5.0, "ring": 1.0, "carrier": -8.0})
    gain = np.linalg.solve(mass, [5.0 - 8.0 * by_sun, 1.0 - 8.0 * by_ring])
    assert r.speeds[-1, :2] == pytest.approx(start + gain, rel=1e-12)
    assert r.speed("carrier") == pytest.approx(r.speeds[:, :2] @ [by_sun, by_ring], rel=1e-12)
    assert np.abs(r.residual()).max() < 1e-11


def test_a_planetary_gearbox_shifts_under_power_from_its_brake_to_its_clutch():
    """The brake holds the ring in the low gear; in the high gear the clutch makes sun, ring and carrier turn as one."""
    js, jc, drive, load, low = 0.3, 4.0, 40.0, -90.0, 1.0 + K
    d = Driveline()
    d.inertia("sun", js, speed=35.0 * low)
    d.inertia("ring", 0.0)
    d.inertia("carrier", jc, speed=35.0)
    d.planetary("set", "sun", "ring", "carrier", K)
    d.brake("low", "ring")
    d.clutch("high", "sun", "carrier")
    system = d.build()
    assert system.speeds == ("sun", "carrier") and system.w[0] == pytest.approx([-1.0 / K, low / K])
    t0, friction = 0.5, 150.0
    r = run(
        system,
        2.0,
        1e-2,
        {
            "sun": drive,
            "carrier": load,
            "low": ([0.0, t0, t0, 2.0], [500.0, 500.0, 0.0, 0.0]),
            "high": ([0.0, t0, t0, 2.0], [0.0, 0.0, friction, friction]),
        },
    )
    in_low = (low * drive + load) / (jc + low**2 * js)
    at_shift = 35.0 + in_low * t0
    assert r.speed("carrier")[r.t < t0][-1] == pytest.approx(35.0 + in_low * r.t[r.t < t0][-1], rel=1e-12)
    assert np.abs(r.speed("ring")[r.t < t0]).max() < 1e-12
    apart = (low - 1.0) * at_shift
    assert event(r, "high", "lock") == pytest.approx(t0 + apart / ((friction - drive) / js + (friction + load) / jc), rel=1e-12)
    momentum = js * low * at_shift + jc * at_shift + (drive + load) * (2.0 - t0)
    assert r.speeds[-1] == pytest.approx([momentum / (js + jc)] * 3, rel=1e-12)
    assert np.abs(r.residual()).max() < 1e-9


def test_wheels_without_inertia_are_the_coefficients_of_a_clutch_bit_for_bit():
    """Described once with z3, countershaft and z5 as bodies, and once with coefficients in the clutches' slips instead of them."""
    z3, countershaft, z5 = 34 / 47, 41 / 41, 41 / 40  # teeth of tab. 3.2
    as_bodies, as_numbers = Driveline(), Driveline()
    for name, j, d in (
        ("z3", 0.0, [as_bodies]),
        ("w0", 0.71, [as_bodies, as_numbers]),
        ("countershaft", 0.0, [as_bodies]),
        ("wk", 0.127 * z5**2, [as_bodies, as_numbers]),
        ("z5", 0.0, [as_bodies]),
    ):
        for one in d:
            one.inertia(name, j, speed=None if j == 0.0 else 7.0)
    as_bodies.gear("z3", "w0", z3)
    as_bodies.gear("countershaft", "wk", countershaft)
    as_bodies.gear("z5", "wk", z5)
    as_bodies.clutch("s1", "z3", "countershaft")
    as_bodies.clutch("s2", "w0", "z5")
    as_numbers.clutch("s1", "w0", "wk", z3, countershaft)
    as_numbers.clutch("s2", "w0", "wk", 1.0, z5)
    one, other = as_bodies.build(), as_numbers.build()
    assert one.speeds == other.speeds == ("w0", "wk")
    for name in ("mass", "minv", "w", "v_start"):
        assert np.array_equal(getattr(one, name), getattr(other, name)), name


def test_a_relation_of_its_own_kind_ties_four_bodies():
    """Twice the speed of a differential's crown is the sum of the speeds of its two wheels; a gear ties the crown to a shaft."""
    d = Driveline()
    d.inertia("shaft", 0.1, speed=20.0)
    d.inertia("crown", 0.0)
    d.inertia("left", 1.0, speed=6.0)
    d.inertia("right", 1.0)
    d.gear("shaft", "crown", 4.0)
    d.relation("differential", {"left": 1.0, "right": 1.0, "crown": -2.0})
    system = d.build()
    assert system.speeds == ("shaft", "left")
    r = run(system, 1.0, 0.1, {"shaft": 3.0})
    assert r.speed("right")[0] == pytest.approx(4.0) and r.speed("crown")[0] == pytest.approx(5.0)
    gain = 3.0 * 4.0 / (2.0 + 0.1 * 16.0)
    assert r.speeds[-1, 2:] == pytest.approx([6.0 + gain, 4.0 + gain], rel=1e-12)


def test_tables_jump_where_a_time_stands_twice_and_off_the_grid():
    d = Driveline()
    d.inertia("a", 1.0)
    r = run(d.build(), 1.0, 0.1, {"a": ([0.0, 0.333, 0.333, 1.0], [1.0, 1.0, 5.0, 5.0])})
    assert r.speeds[-1, 0] == pytest.approx(0.333 + 5.0 * 0.667, rel=1e-12)


def described(*calls):
    d = Driveline()
    d.inertia("a", 1.0)
    d.inertia("b", 1.0)
    for name, *args in calls:
        kwargs = args.pop() if isinstance(args[-1], dict) else {}  # after the coefficients of a relation an empty one is given
        getattr(d, name)(*args, **kwargs)
    return d.build()


@pytest.mark.parametrize(
    "calls, words",
    [
        ([("clutch", "c", "a", "x")], "'x', which does not exist"),
        ([("inertia", "a", 1.0)], "'a' is already taken"),
        ([("brake", "b", "a")], "'b' is already taken"),
        ([("inertia", "c", -1.0)], "inertia of 'c' is -1.0"),
        ([("inertia", "c", 0.0)], "body 'c' has no inertia"),
        (
            [("inertia", "c", 0.0), ("clutch", "ac", "a", "c")],
            "body 'c' has no inertia.*a billionth of its neighbours' acts as none",
        ),
        ([("inertia", "c", 0.0), ("inertia", "e", 0.0), ("gear", "c", "e", 2.0)], "body 'c' has no inertia"),
        ([("inertia", "c", 0.0), ("inertia", "e", 0.0), ("planetary", "p", "a", "c", "e", 2.0)], "body '[ce]' has no inertia"),
        ([("inertia", "c", 1.0), ("planetary", "p", "a", "b", "c", -2.0)], "ratio of planetary set 'p' is -2"),
        ([("planetary", "p", "a", "a", "b", 2.0)], "planetary set 'p' joins 'a' and 'b'; three different bodies"),
        ([("relation", "r", {"a": 1.0}, {})], "relation 'r' joins 'a'; two different bodies"),
        ([("relation", "r", {"a": 1.0, "x": 1.0}, {})], "'x', which does not exist"),
        ([("relation", "r", {"a": 1.0, "b": 0.0}, {})], "coefficient of 'b' in relation 'r' is 0.0"),
        ([("relation", "b", {"a": 1.0, "b": 1.0}, {})], "'b' is already taken"),
        ([("relation", "r", {"a": 1.0, "b": 1.0}, {}), ("brake", "r", "a")], "'r' is already taken"),
        ([("relation", "r", {"a": 1.0, "ground": 1.0}, {})], "with relation 'r', body 'a' could not turn"),
        ([("relation", "r", {"a": 1.0, "b": -2.0}, {}), ("relation", "s", {"b": -4.0, "a": 2.0}, {})], "relation 's' says no more"),
        (
            [("relation", "r", {"a": 1.0, "b": -2.0}, {}), ("relation", "s", {"a": 1.0, "b": -3.0}, {})],
            "with relation 's', body 'a' could not turn",
        ),
        ([("inertia", "c", 0.0), ("planetary", "p", "a", "c", "b", 2.0), ("gear", "a", "b", 3.0)], "body 'c' could not turn"),
        ([("relation", "r", {"a": 1.0, "b": -2.0}, {}), ("clutch", "c", "a", "b", 1.0, 2.0)], "its slip is always 0"),
        (
            [
                ("inertia", "c", 0.0, 5.0),
                ("inertia", "e", 1.0, 1.0),
                ("inertia", "f", 1.0, 1.0),
                ("planetary", "p", "e", "c", "f", 2.0),
            ],
            "contradict the gears",
        ),
        ([("inertia", "c", float("nan"))], "inertia of 'c' is nan"),
        ([("gear", "a", "b", 0.0)], "ratio of gear a-b"),
        ([("gear", "a", "b", 2.0), ("gear", "a", "b", 3.0)], "closes a loop"),
        ([("gear", "a", "b", 2.0), ("clutch", "c", "a", "b", 1.0, 2.0)], "its slip is always 0"),
        ([("clutch", "c", "a", "a")], "joins 'a' with itself"),
        ([("clutch", "c", "a", "b", {"stick": 0.9})], "stick ratio of 'c'"),
        ([("shaft", "s", "a", "b", {"stiffness": -1.0})], "stiffness of shaft 's'"),
        ([("inertia", "c", 1.0, 3.0), ("freewheel", "f", "c", "a")], "free-wheel 'f'"),
        ([("inertia", "c", 1.0, 3.0), ("inertia", "e", 1.0, 1.0), ("gear", "c", "e", 2.0)], "contradict the gears"),
    ],
)
def test_refuses_what_cannot_be(calls, words):
    with pytest.raises(RigError, match=words) as refusal:
        described(*calls)
    assert refusal.value.exit_code == 2
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    "inputs, words",
    [
        ({"nobody": 1.0}, "no input 'nobody'"),
        ({"c": -1.0}, "capacity of 'c' falls to -1"),
        ({"a": float("nan")}, "input 'a' is not finite"),
        ({"a": ([0.0, 1.0], [1.0])}, "table for 'a'"),
    ],
)
def test_run_refuses_bad_inputs(inputs, words):
    with pytest.raises(RigError, match=words):
        run(pair(), 1.0, 0.1, inputs)


def test_consistent_gear_loop_is_accepted():
    d = Driveline()
    for name in ("a", "b", "c"):
        d.inertia(name, 1.0)
    d.gear("a", "b", 2.0)
    d.gear("b", "c", -1.5)
    d.gear("a", "c", -3.0)
    assert d.build().mass == pytest.approx(np.array([[1.0 + 1.0 / 4.0 + 1.0 / 9.0]]))
