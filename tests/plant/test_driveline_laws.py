# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Torques, capacities, friction and motion by functions of the driveline's own motion, compared with closed forms and scipy."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.special import ellipk

from rig_nodes.base.errors import RigError
from rig_nodes.driveline.builder import Driveline
from rig_nodes.driveline.run import Run, run


def event(result, element, kind):
    found = [e.t for e in result.events if (e.element, e.kind) == (element, kind) and e.t > 0.0]
    assert len(found) == 1, result.events
    return found[0]


def closes(r):
    """Checks that energy closes to 1e-9 of the transferred energy, and that every step is solved."""
    flowed = 1e-9 + np.abs(np.diff(r.e_in)).sum() + r.stored.max()
    return np.abs(r.residual()).max() < 1e-9 * flowed and r.capped == 0


def test_a_torque_over_speed_slows_a_fan_as_its_closed_form():
    """J dw/dt = -c w^2 from w0: w = w0 / (1 + c w0 t / J)."""
    speeds = np.linspace(0.0, 120.0, 6001)
    d = Driveline()
    d.inertia("fan", 0.5, speed=100.0)
    d.torque("air", "fan", table=(speeds, -0.01 * speeds**2))
    r = run(d.build(), 2.0, 1e-4)
    exact = 100.0 / (1.0 + 0.01 * 100.0 * r.t / 0.5)
    assert r.speed("fan") == pytest.approx(exact, abs=1e-4)
    assert r.torque("air") == pytest.approx(-0.01 * exact**2, abs=1e-3)
    assert r.e_in[-1] == pytest.approx(0.25 * (r.speed("fan")[-1] ** 2 - 100.0**2)) and closes(r)


def test_a_straight_torque_over_speed_is_exact_and_stable_where_it_is_steep():
    def end(step, slope):
        d = Driveline()
        d.inertia("a", 0.5, speed=90.0)
        d.torque("governor", "a", table=([0.0, 200.0], [100.0 * slope, -100.0 * slope]))
        return run(d.build(), 1.0, step).speeds[-1, 0]

    assert [end(step, 1.0) for step in (0.1, 0.05, 0.025)] == pytest.approx([100.0 - 10.0 * math.exp(-2.0)] * 3, abs=1e-9)
    assert abs(end(0.01, 1e5) - 100.0) < 10.0


def test_a_curve_with_bends_against_scipy():
    speeds, torques = [0.0, 20.0, 60.0, 60.5, 100.0, 120.0], [40.0, 90.0, 80.0, 60.0, 50.0, 0.0]
    d = Driveline()
    d.inertia("engine", 0.3)
    d.inertia("car", 2.0)
    d.shaft("shaft", "engine", "car", stiffness=500.0, damping=3.0)
    d.torque("curve", "engine", table=(speeds, torques))
    r = run(d.build(), 3.0, 1e-3)

    def rate(t, y):
        s = 500.0 * y[2] + 3.0 * (y[0] - y[1])
        return [(np.interp(y[0], speeds, torques) - s) / 0.3, s / 2.0, y[0] - y[1]]

    truth = solve_ivp(rate, (0.0, 3.0), [0.0, 0.0, 0.0], rtol=1e-8, atol=1e-8, max_step=1e-3)
    assert r.speeds[-1] == pytest.approx(truth.y[:2, -1], abs=1e-4) and closes(r)


def test_a_torque_over_the_angle_swings_a_pendulum_with_its_exact_period():
    """The torque is a periodic table over the angle; the swing lasts 4 K(sin(a/2)) / w (e.g. Landau, Mechanics, par. 11)."""
    angles = np.linspace(-math.pi, math.pi, 20001)
    d = Driveline()
    d.inertia("pendulum", 0.5)
    d.torque("weight", "pendulum", by="angle", table=(angles, -8.0 * np.sin(angles)), period=2.0 * math.pi, angle=2.5)
    period = 4.0 * ellipk(math.sin(1.25) ** 2) / math.sqrt(8.0 / 0.5)
    r = run(d.build(), 3.0 * period, 1e-4)
    assert r.speeds[-1, 0] == pytest.approx(0.0, abs=1e-4) and r.angle("pendulum")[-1] == pytest.approx(0.0, abs=1e-4)
    assert closes(r) and r.e_in == pytest.approx(0.5 * 0.5 * r.speeds[:, 0] ** 2, abs=1e-8)


def test_a_table_that_repeats_itself_does_so_for_any_number_of_turns():
    d = Driveline()
    d.inertia("crankshaft", 1.0, speed=-30.0)
    d.torque("gas", "crankshaft", by="angle", table=([0.0, 1.0, 1.0, 4.0], [9.0, 9.0, -3.0, -3.0]), period=4.0)
    r = run(d.build(), 5.0, 1e-3)
    work = r.angle("crankshaft") - 0.0
    inside = np.mod(work, 4.0)
    exact = np.where(inside < 1.0, 9.0 * inside, 9.0 - 3.0 * (inside - 1.0))
    assert 0.5 * (r.speeds[:, 0] ** 2 - 900.0) == pytest.approx(exact, abs=1e-8) and abs(work[-1]) > 100.0


def test_an_input_multiplies_a_torque_over_speed():
    d = Driveline()
    d.inertia("a", 0.5, speed=50.0)
    d.torque("brake", "a", table=([-100.0, 100.0], [100.0, -100.0]))
    r = run(d.build(), 2.0, 1e-3, {"brake": ([0.0, 2.0], [0.0, 1.0])})
    assert r.speed("a") == pytest.approx(50.0 * np.exp(-0.25 * r.t**2 / 0.5), abs=5e-5) and closes(r)


def test_a_torque_between_bodies_and_one_by_the_speed_of_another_body():
    d = Driveline()
    for name, j, speed in (("a", 0.5, 50.0), ("b", 0.2, 0.0), ("c", 1.0, 10.0)):
        d.inertia(name, j, speed=speed)
    d.torque("fluid", "a", "b", table=([-200.0, 200.0], [600.0, -600.0]))
    d.torque("fan", "b", of="c", table=([-200.0, 200.0], [400.0, -400.0]))
    d.torque("pull", "c", of="a", table=([-200.0, 200.0], [-100.0, 100.0]))
    r = run(d.build(), 1.0, 1e-3)
    rates = np.array([[-3.0 / 0.5, 3.0 / 0.5, 0.0], [3.0 / 0.2, -3.0 / 0.2, -2.0 / 0.2], [0.5, 0.0, 0.0]])
    assert r.speeds[-1] == pytest.approx(expm(rates) @ [50.0, 0.0, 10.0], abs=1e-4)
    assert r.torque("fluid") == pytest.approx(-3.0 * (r.speed("a") - r.speed("b"))) and closes(r)
    assert r.accelerations()[:, 1] * 0.2 == pytest.approx(-r.torque("fluid") + r.torque("fan"), abs=1e-9)


def test_friction_that_falls_with_slip_stops_a_body_when_its_closed_form_says():
    """J dw/dt = -(F - m w): Stribeck's falling branch (Armstrong-Helouvry et al., Automatica 30, 1994), linear to 50 rad/s."""
    d = Driveline()
    d.inertia("a", 0.5, speed=40.0)
    d.brake("b", "a", friction=([0.0, 50.0, 100.0], [1.0, 0.5, 0.5]), drag=0.01)
    r = run(d.build(), 2.0, 1e-4, {"b": 30.0})
    slope = (30.0 * 0.5 / 50.0 - 0.01) / 0.5
    stop = math.log(1.0 / (1.0 - slope * 40.0 / 60.0)) / slope
    assert event(r, "b", "lock") == pytest.approx(stop, abs=1e-6)
    sliding = (r.t > 0.0) & (r.t < stop)
    assert r.torque("b")[sliding] == pytest.approx(30.0 * (1.0 - r.speed("a")[sliding] / 100.0), abs=1e-9)
    exact = 60.0 / slope - (60.0 / slope - 40.0) * np.exp(slope * r.t[sliding])
    assert r.speed("a")[sliding] == pytest.approx(exact, abs=1e-5)
    assert closes(r) and r.impulse[-1, 0] == pytest.approx(0.5 * 40.0 - 0.01 * r.angle("a")[-1], rel=1e-9)


def test_friction_that_falls_with_slip_makes_a_shaft_stick_and_slip():
    """A spring pulls a body whose friction falls with slip: it breaks away and sticks again when a solution by scipy does."""
    friction, pull = ([0.0, 1.0, 10.0], [1.0, 0.6, 0.5]), 0.5
    d = Driveline()
    d.inertia("puller", 1.0, speed=pull)
    d.motion("pull", "puller")
    d.inertia("body", 0.4)
    d.shaft("spring", "puller", "body", stiffness=200.0)
    d.brake("b", "body", friction=friction)
    r = run(d.build(), 1.0, 1e-4, {"b": 20.0})
    away = 20.0 / (200.0 * pull)
    assert next(e.t for e in r.events if e.kind == "break") == pytest.approx(away, abs=1e-9)

    def rate(t, y):
        return [(200.0 * y[1] - 20.0 * np.interp(y[0], *friction)) / 0.4, pull - y[0]]

    def stops(t, y):
        return y[0] if t > away + 0.01 else 1.0

    stops.terminal = True
    truth = solve_ivp(rate, (away, 1.0), [0.0, 20.0 / 200.0 + 1e-9], events=stops, rtol=1e-10, atol=1e-12, max_step=1e-3)
    again = [e.t for e in r.events if e.kind == "lock" and e.t > away]
    assert again[0] == pytest.approx(truth.t[-1], abs=1e-5) and closes(r)


def test_a_stick_limit_may_differ_by_direction():
    for load, limit in ((1.0, 15.0), (-1.0, 10.0)):
        d = Driveline()
        d.inertia("a", 1.0)
        d.brake("b", "a", stick=(1.5, 1.0))
        r = run(d.build(), 2.0, 1e-2, {"a": ([0.0, 2.0], [0.0, 20.0 * load]), "b": 10.0})
        assert event(r, "b", "break") == pytest.approx(limit / 10.0, abs=1e-10)
        assert r.speeds[-1, 0] * load > 0.0


def centrifugal():
    """Returns a clutch whose capacity grows with the square of the engine's speed, from 0 at 100 rad/s."""
    speeds = np.linspace(100.0, 400.0, 3001)
    d = Driveline()
    d.inertia("engine", 0.02)
    d.inertia("drum", 0.3)
    d.clutch("shoes", "engine", "drum")
    d.capacity("shoes", "engine", table=(speeds, 1e-3 * (speeds**2 - 1e4)))
    return d.build()


def test_a_centrifugal_clutch_against_scipy():
    r = run(centrifugal(), 4.0, 1e-4, {"engine": 20.0})

    def rate(t, y):
        c = 1e-3 * max(0.0, y[0] ** 2 - 1e4)
        return [(20.0 - c) / 0.02, c / 0.3]

    def locks(t, y):
        return y[0] - y[1] if t > 0.05 else 1.0

    locks.terminal = True
    truth = solve_ivp(rate, (0.0, 4.0), [0.0, 0.0], events=locks, rtol=1e-10, atol=1e-10)
    assert event(r, "shoes", "lock") == pytest.approx(truth.t[-1], abs=1e-5)
    at = [e.kind for e in r.events].index("lock")
    assert r.event_speeds[at] == pytest.approx(truth.y[:, -1], abs=1e-3)
    assert r.torque("shoes")[-1] == pytest.approx(20.0 * 0.3 / 0.32, rel=1e-9) and closes(r)
    coarse = run(centrifugal(), 4.0, 4e-3, {"engine": 20.0})
    assert event(coarse, "shoes", "lock") == pytest.approx(truth.t[-1], abs=2e-3)


def test_a_capacity_over_an_angle_and_one_over_the_slip_of_another_element():
    d = Driveline()
    d.inertia("a", 1.0, speed=10.0)
    d.inertia("b", 2.0, speed=5.0)
    d.brake("cam", "a")
    d.capacity("cam", "a", by="angle", table=([0.0, 100.0], [0.0, 200.0]))
    d.brake("over", "b")
    d.capacity("over", "cam", table=([0.0, 100.0], [0.0, 50.0]))
    r = run(d.build(), 1.0, 1e-3, {"over": ([0.0, 1.0], [2.0, 2.0])})
    w = math.sqrt(2.0)
    assert r.speed("a") == pytest.approx(10.0 * np.cos(w * r.t), abs=1e-4)
    assert r.angle("b")[-1] == pytest.approx(5.0 - 0.25 * (10.0 / w**2) * 2.0 * (1.0 - math.cos(w)), abs=1e-4) and closes(r)


def test_a_capacity_that_is_0_at_the_slip_of_a_locked_clutch_stays_0():
    """The slip of a locked clutch is a rounding error: a capacity over it must not switch on and off, or cap a step."""
    d = Driveline()
    for name, j in (("a", 0.7), ("b", 0.3), ("c", 1.0)):
        d.inertia(name, j)
    d.clutch("locked", "a", "b")
    d.clutch("follows", "a", "c")
    d.capacity("follows", "locked", table=([-5.0, 0.0, 5.0], [3.0, 0.0, 6.0]))
    r = run(d.build(), 2.0, 2e-3, {"locked": 50.0, "a": lambda t: 7.0 * math.sin(9.0 * t), "c": 1.0})
    assert [(e.element, e.kind) for e in r.events] == [("locked", "lock")] and closes(r)
    assert np.abs(r.torque("follows")).max() == 0.0 and r.speed("c")[-1] == pytest.approx(2.0)


def test_a_prescribed_motion_finds_its_torque():
    """A body that is turned to and fro drives an oscillator; its torque is the closed form of the forced vibration."""
    d = Driveline()
    d.inertia("shaker", 0.3)
    d.inertia("wheel", 0.5)
    d.shaft("spring", "shaker", "wheel", stiffness=200.0)
    d.motion("shake", "shaker")
    drive, natural = 12.0, math.sqrt(200.0 / 0.5)
    r = run(d.build(), 2.0, 1e-4, {"shake": lambda t: 3.0 * math.sin(drive * t)})
    assert r.speed("shaker") == pytest.approx(3.0 * np.sin(drive * r.t), abs=1e-9)
    swing = 3.0 / (1.0 - (drive / natural) ** 2)
    wheel = swing * (np.sin(drive * r.t) - drive / natural * np.sin(natural * r.t))
    assert r.speed("wheel") == pytest.approx(wheel, abs=1e-4)
    middle = r.t[1:] - 5e-5
    spring = 0.5 * swing * drive * (np.cos(drive * middle) - np.cos(natural * middle))
    assert r.torque("shake")[1:] == pytest.approx(0.3 * 3.0 * drive * np.cos(drive * middle) + spring, abs=2e-3)
    assert closes(r)


def test_a_locked_clutch_carries_what_a_prescribed_motion_needs():
    d = Driveline()
    d.inertia("a", 0.3)
    d.inertia("b", 0.5)
    d.clutch("c", "a", "b")
    d.motion("ramp", "a")
    r = run(d.build(), 2.0, 1e-2, {"ramp": ([0.0, 2.0], [0.0, 40.0]), "c": ([0.0, 1.0, 2.0], [12.0, 12.0, 0.0])})
    away = 1.0 + (12.0 - 10.0) / 12.0
    assert event(r, "c", "break") == pytest.approx(away, abs=1e-9)
    assert r.torque("ramp")[(r.t > 0.0) & (r.t < away)] == pytest.approx(0.8 * 20.0, abs=1e-6)
    assert r.torque("ramp")[-1] == pytest.approx(6.0, abs=0.1)
    assert r.speed("b")[-1] == pytest.approx(
        20.0 * away + (12.0 * (2.0 - away) - 6.0 * ((2.0 - 1.0) ** 2 - (away - 1.0) ** 2)) / 0.5
    )


def test_a_run_with_laws_is_continued_bit_for_bit():
    inputs = {"engine": lambda t: 20.0 * math.cos(4.0 * t)}
    whole = run(centrifugal(), 1.0, 1e-3, inputs)
    one = Run(centrifugal(), 1e-3, inputs)
    for stop in (0.013, 0.2, 0.7, 1.0):
        one.to(stop)
    for name in ("speeds", "angles", "torques", "laws", "e_in", "e_fric"):
        assert np.array_equal(getattr(one.result(), name), getattr(whole, name)), name


def described(*calls):
    d = Driveline()
    d.inertia("a", 1.0)
    d.inertia("b", 1.0)
    d.clutch("c", "a", "b")
    for name, *args in calls:
        getattr(d, name)(*args[:-1], **args[-1])
    return d.build()


LINE = ([0.0, 1.0], [0.0, 1.0])


@pytest.mark.parametrize(
    "calls, words",
    [
        ([("torque", "t", "a", {"table": ([0.0, 1.0], [1.0])})], "table of torque 't' needs as many values as points"),
        ([("torque", "t", "a", {"table": ([0.0, 2.0, 1.0], [1.0, 1.0, 1.0])})], "points of the table of torque 't' fall"),
        ([("torque", "t", "a", {"table": ([0.0, math.nan], [1.0, 1.0])})], "table of torque 't' needs .* all finite"),
        ([("torque", "t", "a", {"table": LINE, "period": 3.0})], "is by speed; only a table over an angle repeats"),
        ([("torque", "t", "a", {"table": LINE, "by": "angle", "period": 3.0})], "reaches over 1; its period is 3"),
        ([("torque", "t", "a", {"table": LINE, "by": "time"})], "torque 't' is by 'time'"),
        ([("torque", "t", "a", {"table": ([0.0, 1.0, 1.0], [0.0, 1.0, 2.0])})], "torque 't' jumps at 1 rad/s"),
        ([("torque", "t", "a", {"table": LINE, "of": "x"})], "names the body 'x', which does not exist"),
        ([("torque", "c", "a", {"table": LINE})], "'c' is already taken"),
        ([("capacity", "x", "a", {"table": LINE})], "no clutch or brake of that name"),
        ([("freewheel", "f", "a", {}), ("capacity", "f", "a", {"table": LINE})], "no clutch or brake of that name"),
        ([("capacity", "c", "a", {"table": LINE}), ("capacity", "c", "b", {"table": LINE})], "follows another table already"),
        ([("brake", "k", "a", {"friction": ([1.0, 2.0], [1.0, 1.0])})], "slips that rise from 0"),
        ([("brake", "k", "a", {"friction": ([0.0, 2.0], [1.0, 0.0])})], "factors above 0"),
        ([("brake", "k", "a", {"stick": (1.0, 0.5)})], "stick ratio of 'k'"),
        ([("motion", "m", "x", {})], "motion 'm' names the body 'x'"),
        ([("motion", "m", "a", {}), ("motion", "n", "a", {})], "one is enough"),
    ],
)
def test_refuses_in_one_sentence(calls, words):
    with pytest.raises(RigError, match=words) as refusal:
        described(*calls)
    assert refusal.value.exit_code == 2 and "\n" not in str(refusal.value)
