# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Shafts with a ratio, a characteristic, backlash and hysteresis, compared with closed forms and scipy."""

import math

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.linalg import expm

from rig_nodes.base.errors import RigError
from rig_nodes.driveline.builder import Driveline
from rig_nodes.driveline.run import run
from rig_nodes.driveline.vibration import modes


def closes(r):
    flowed = 1e-9 + np.abs(np.diff(r.e_in)).sum() + r.stored.max()
    return np.abs(r.residual()).max() < 1e-9 * flowed and r.capped == 0


def bodies(j=(0.5, 2.0), speeds=(3.0, 0.0)):
    d = Driveline()
    d.inertia("a", j[0], speed=speeds[0])
    d.inertia("b", j[1], speed=speeds[1])
    return d


def test_a_shaft_with_a_ratio_is_a_shaft_behind_a_gear():
    with_ratio, with_gear = bodies(speeds=(6.0, 1.0)), bodies(speeds=(6.0, 1.0))
    with_ratio.shaft("s", "a", "b", 1.0, -2.5, stiffness=900.0, damping=2.0)
    with_gear.inertia("wheel", 0.0)
    with_gear.gear("wheel", "b", -2.5)
    with_gear.shaft("s", "a", "wheel", stiffness=900.0, damping=2.0)
    one, other = (run(d.build(), 1.0, 1e-3, {"a": 4.0}) for d in (with_ratio, with_gear))
    assert one.speeds == pytest.approx(other.speeds[:, :2], abs=1e-12)
    assert one.torque("s") == pytest.approx(other.torque("s"), abs=1e-10)
    natural = math.sqrt(900.0 * (1.0 / 0.5 + 2.5**2 / 2.0))
    assert modes(with_ratio.build()).frequencies[1] * 2 * math.pi == pytest.approx(natural, rel=1e-9)


def test_a_shaft_that_hardens_swings_with_the_period_of_its_potential():
    """Its stiffness is constant to 0.1 rad and three times that beyond: half a period is the integral of dx over the speed."""
    j = 0.5 * 2.0 / 2.5
    d = bodies()
    d.shaft("s", "a", "b", table=([-0.2, -0.1, 0.1, 0.2], [-80.0, -20.0, 20.0, 80.0]))
    energy = 0.5 * j * 9.0

    def potential(x):
        return 100.0 * min(x, 0.1) ** 2 + (20.0 * (x - 0.1) + 300.0 * (x - 0.1) ** 2 if x > 0.1 else 0.0)

    most = 0.1 + (-20.0 + math.sqrt(400.0 + 4.0 * 300.0 * (energy - 1.0))) / 600.0
    quarter = math.asin(0.1 / math.sqrt(energy / 100.0)) / math.sqrt(200.0 / j)
    quarter += quad(lambda u: 2.0 * u / math.sqrt(2.0 / j * (energy - potential(most - u * u))), 1e-9, math.sqrt(most - 0.1))[0]
    r = run(d.build(), 12.0 * quarter, 1e-4)
    # after three whole periods everything is as at the start
    assert r.slips.shape[1] == 0 and r.speed("a")[-1] - r.speed("b")[-1] == pytest.approx(3.0, abs=3e-4)
    assert r.twists[-1, 0] == pytest.approx(0.0, abs=1e-4)
    assert r.twists.max() == pytest.approx(most, abs=1e-6) and closes(r)
    assert r.torque("s").max() == pytest.approx(20.0 + 600.0 * (most - 0.1), abs=1e-3)


def test_a_shaft_with_bends_turns_alike_in_steps_of_any_length():
    def end(step):
        d = bodies()
        d.shaft("s", "a", "b", table=([-0.1, 0.1, 0.2], [-20.0, 20.0, 80.0]), damping=0.3)
        return run(d.build(), 0.5, step).speeds[-1, 0]

    assert [end(step) for step in (3.2e-2, 1.6e-2, 8e-3, 1e-3)] == pytest.approx([end(1e-5)] * 4, abs=1e-8)


def test_backlash_bodies_bounce_at_its_ends_as_often_as_the_closed_form_says():
    """The bodies cross the gap at the relative speed and spend half a period of the spring at each end.

    This is MSL's ElastoBacklash without damping.
    """
    gap, j = 0.1, 0.5 * 2.0 / 2.5
    d = bodies()
    d.shaft("s", "a", "b", stiffness=1e4, backlash=gap)
    period = 2.0 * (gap / 3.0 + math.pi / math.sqrt(1e4 / j))
    r = run(d.build(), 10.25 * period, 1e-4)
    relative = r.speed("a") - r.speed("b")
    at = np.searchsorted(r.t, 10.0 * period)
    assert r.twists[at, 0] == pytest.approx(3.0 * (r.t[at] - 10.0 * period), abs=2e-5) and relative[at] == pytest.approx(
        3.0, abs=1e-6
    )
    free = np.abs(r.twists[:, 0]) < 0.5 * gap
    assert np.abs(r.torque("s")[free]).max() == 0.0 and np.abs(np.abs(relative[free]) - 3.0).max() < 1e-9
    assert r.torque("s").max() == pytest.approx(3.0 * math.sqrt(1e4 * j), rel=1e-4) and closes(r)
    first = np.flatnonzero(r.torque("s") > 0.0)[0]
    assert r.t[first] - 0.5 * gap / 3.0 == pytest.approx(0.0, abs=1e-4)


@pytest.mark.parametrize("step", [1e-4, 1e-3])
@pytest.mark.parametrize("stiffness", [1e3, 1e5, 1e7, 1e8])
@pytest.mark.parametrize("damping", [0.0, 2e-3, 0.1])
def test_a_shaft_of_any_stiffness_turns_as_the_matrix_exponential_says(stiffness, damping, step):
    """Also written as a table: of up to 7600 Hz, in steps that are up to eight of its periods, to 1e-6 of the largest twist."""
    inertia, load = np.array([0.3, 0.05]), 100.0
    drag = 2.0 * damping * math.sqrt(stiffness / np.sum(1.0 / inertia))
    plain, table = Driveline(), Driveline()
    for d in (plain, table):
        d.inertia("a", inertia[0])
        d.inertia("b", inertia[1])
    plain.shaft("s", "a", "b", stiffness=stiffness, damping=drag)
    points = np.array([-1.0, 0.0, 1.0])
    table.shaft("s", "a", "b", table=(points, stiffness * points), damping=drag)
    twist, rates = np.array([1.0, -1.0]), np.zeros((4, 4))
    rates[:2, :2], rates[:2, 2] = -drag / inertia[:, None] * np.outer(twist, twist), -stiffness / inertia * twist
    rates[2, :2], rates[0, 3] = twist, load / inertia[0]
    for d in (plain, table):
        r = run(d.build(), 0.05, step, {"a": load})
        now, by = np.array([0.0, 0.0, 0.0, 1.0]), expm(rates * step)
        truth = np.array([now, *(now := by @ now for _ in r.t[1:])])
        assert r.twists[:, 0] == pytest.approx(truth[:, 2], abs=1e-6 * np.abs(truth[:, 2]).max())
        assert r.speeds == pytest.approx(truth[:, :2], abs=1e-6 * np.abs(truth[:, :2]).max()) and closes(r)


def bounce(stiffness, damping, gap, load, grid):
    """Return the speeds of the two bodies at the times of `grid` by the equations of MSL 4.1.0's ElastoBacklash2.

    scipy solves them from one contact to the next. A contact does not pull: where damping would exceed the torque of the spring
    there is no torque.
    """
    y, t, out = np.array([3.0, 0.0, 0.0]), 0.0, np.zeros((len(grid), 2))
    out[0], side = y[:2], 0.0
    while t < grid[-1]:

        def rate(_t, y, side=side):
            tau = side * max(0.0, side * (stiffness * (y[2] - side * 0.5 * gap) + damping * (y[0] - y[1])))
            return [(load - tau) / 0.5, tau / 2.0, y[0] - y[1]]

        def over(_t, y):
            return y[2] - 0.5 * gap

        def under(_t, y):
            return y[2] + 0.5 * gap

        over.terminal = under.terminal = True
        over.direction, under.direction = -side or 1.0, -side or -1.0
        events = [over, under] if side == 0.0 else over if side > 0.0 else under
        leg = solve_ivp(
            rate, (t, grid[-1]), y, method="DOP853", rtol=1e-11, atol=1e-12, max_step=5e-4, events=events, dense_output=True
        )
        on = (grid > t) & (grid <= leg.t[-1])
        out[on] = leg.sol(grid[on])[:2].T
        t, y = leg.t[-1], leg.y[:, -1]
        side = 0.0 if side else math.copysign(1.0, y[2])
    return out


@pytest.mark.parametrize(
    "stiffness, damping, gap, load",
    [
        (1e4, 6.0, 0.1, 0.0),
        (1e4, 0.0, 0.1, 0.0),
        (1e5, 20.0, 0.02, 5.0),
        (1e5, 0.0, 0.02, 5.0),
        (1e6, 30.0, 0.1, 0.0),
        (1e7, 100.0, 0.1, 0.0),
        (1e7, 30.0, 0.02, 5.0),
    ],
    ids=["damped", "free", "stiff under load", "stiff, free, under load", "stiffer", "stiffest", "stiffest under load"],
)
def test_contacts_begin_and_end_inside_a_step(stiffness, damping, gap, load):
    d = bodies()
    d.shaft("s", "a", "b", stiffness=stiffness, damping=damping, backlash=gap)
    r = run(d.build(), 0.96, 1e-4, {"a": load})
    truth = bounce(stiffness, damping, gap, load, r.t)
    assert np.abs(r.speeds - truth).max() < 1e-4 * np.abs(truth).max() and closes(r)
    assert np.diff(r.e_shaft[:, 0]).min() >= 0.0 and (r.e_shaft[-1, 0] > 0.5) == (damping > 0.0)
    assert np.abs(r.torque("s")[np.abs(r.twists[:, 0]) < 0.5 * gap]).max() == 0.0
    assert (r.torque("s") * r.twists[:, 0]).min() > -1e-12, "a contact pushes and never pulls"


@pytest.mark.parametrize("step", [1e-3, 7e-3])
def test_hysteresis_loses_the_area_of_its_loop(step):
    """A spring that slides at F beside a straight one, turned to and fro by A, loses 4 F (A - F / k) each period (Iwan, 1966)."""
    d = Driveline()
    d.inertia("arm", 1.0, speed=0.4 * math.pi)
    d.motion("turn", "arm")
    d.shaft("s", "arm", "ground", stiffness=50.0, hysteresis=[(400.0, 8.0), (100.0, 6.0)])
    amplitude = 0.2
    r = run(d.build(), 10.5, step, {"turn": lambda t: amplitude * 2 * math.pi * math.cos(2 * math.pi * t)})
    area = sum(4.0 * limit * (amplitude - limit / k) for k, limit in ((400.0, 8.0), (100.0, 6.0)))
    start, end = (np.argmin(np.abs(r.t - x)) for x in (2.25, 10.25))
    assert r.e_shaft[end, 0] - r.e_shaft[start, 0] == pytest.approx(8.0 * area, rel=1e-3)
    assert r.torque("s").max() == pytest.approx(50.0 * amplitude + 14.0, rel=1e-3)
    assert np.diff(r.e_shaft[:, 0]).min() >= -1e-12 and closes(r)


def test_a_shaft_with_hysteresis_swings_as_the_stiff_spring_it_is_below_its_limit():
    d = bodies()
    d.shaft("s", "a", "b", stiffness=100.0, hysteresis=[(300.0, 1e6)])
    straight = bodies()
    straight.shaft("s", "a", "b", stiffness=400.0)
    one, other = (run(x.build(), 1.0, 1e-3) for x in (d, straight))
    assert one.speeds == pytest.approx(other.speeds, abs=1e-9) and one.torque("s") == pytest.approx(other.torque("s"), abs=1e-8)
    assert modes(d.build()).frequencies == pytest.approx(modes(straight.build()).frequencies)


def test_a_stiff_backlash_stays_finite_and_closes_on_a_coarse_step():
    d = bodies(j=(0.01, 2.0), speeds=(200.0, 0.0))
    d.shaft("s", "a", "b", stiffness=1e6, damping=1.0, backlash=0.02)
    r = run(d.build(), 1.0, 1e-3)
    assert np.isfinite(r.speeds).all() and closes(r) and np.all(np.diff(r.e_shaft[:, 0]) >= 0.0)


@pytest.mark.parametrize(
    "options, words",
    [
        ({}, "needs a stiffness or a table"),
        ({"stiffness": 1.0, "table": ([0.0, 1.0], [0.0, 1.0])}, "needs a stiffness or a table"),
        ({"table": ([0.0, 1.0], [1.0, 0.0])}, "torques not falling"),
        ({"table": ([0.0, 0.0, 1.0], [0.0, 1.0, 2.0])}, "twists rising"),
        ({"table": ([-1.0, 1.0], [-1.0, 2.0]), "backlash": 0.1}, "has 0.5 Nm at twist 0"),
        ({"stiffness": 1.0, "backlash": -0.1}, "backlash of shaft 's' is -0.1"),
        ({"stiffness": 1.0, "hysteresis": [(0.0, 1.0)]}, "stiffness in the hysteresis of shaft 's' is 0.0"),
        ({"stiffness": 1.0, "hysteresis": [(1.0, -1.0)]}, "torque in the hysteresis of shaft 's' is -1.0"),
        ({"stiffness": 1.0, "ca": 0.0}, "coefficients of 's' are 0.0"),
        ({"stiffness": 1.0, "twist": math.nan}, "twist of shaft 's' is nan"),
    ],
)
def test_refuses_in_one_sentence(options, words):
    with pytest.raises(RigError, match=words) as refusal:
        bodies().shaft("s", "a", "b", **options)
    assert refusal.value.exit_code == 2 and "\n" not in str(refusal.value)


@pytest.mark.parametrize(("step", "near"), [(1e-3, 2e-5), (1e-4, 2e-7)])
def test_a_shaft_that_rubs_by_a_share_of_its_torque_swings_as_in_closed_form(step, near):
    """Against the spring it is stiffer by the share, with it softer: V(x1) (1 + f) = V(x0) (1 - f) from one rest to the next."""
    share, k, inertia = 0.1, 200.0, 0.5
    d = Driveline()
    d.inertia("a", inertia)
    d.shaft("s", "a", "ground", stiffness=k, twist=0.3, friction=share)
    r = run(d.build(), 2.0, step)
    rests = [(e.t, angle[0] + 0.3) for e, angle in zip(r.events, r.event_angles) if (e.element, e.kind) == ("s friction", "cross")]
    count = np.arange(1, len(rests) + 1)
    swing = 0.5 * math.pi * (math.sqrt(inertia / k / (1.0 - share)) + math.sqrt(inertia / k / (1.0 + share)))
    assert len(rests) >= 10 and [t for t, _ in rests] == pytest.approx(swing * count, abs=near)
    assert [x for _, x in rests] == pytest.approx(0.3 * (-math.sqrt(0.9 / 1.1)) ** count, abs=0.3 * near)
    assert r.e_fric[-1, 0] == pytest.approx(9.0 - r.stored[-1]) and closes(r)


def test_the_friction_of_a_table_with_backlash_is_a_share_of_its_torque_and_none_in_the_play():
    d = Driveline()
    d.inertia("a", 0.5)
    d.shaft("s", "a", "ground", table=([-0.2, 0.0, 0.2], [-10.0, 0.0, 40.0]), backlash=0.1, twist=0.25, friction=0.2)
    r = run(d.build(), 1.0, 1e-3)
    first = next(angle[0] for e, angle in zip(r.events, r.event_angles) if (e.element, e.kind) == ("s friction", "cross"))
    # half the torque of the soft side's 50 Nm/rad counts against 200 Nm/rad over 0.2 rad
    assert 0.5 * 50.0 * (first + 0.25 + 0.05) ** 2 * 1.2 == pytest.approx(0.5 * 200.0 * 0.2**2 * 0.8, rel=2e-5)
    inside = np.abs(r.twists[:, 0]) < 0.05
    assert np.abs(r.torque("s friction")[inside]).max() == 0.0 and inside.sum() > 5 and closes(r)
