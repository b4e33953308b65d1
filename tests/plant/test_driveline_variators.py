# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Gears whose ratio varies, with an input or over an angle, compared with closed forms and scipy."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rig_nodes.base.errors import RigError
from rig_nodes.driveline.builder import Driveline
from rig_nodes.driveline.run import Run, run
from rig_nodes.driveline.vibration import modes

BEND = math.radians(35.0)
TURN = np.linspace(0.0, math.pi, 3601)
HOOKE = math.cos(BEND) / (1.0 - (math.sin(BEND) * np.cos(TURN)) ** 2)


def closes(r):
    flowed = 1e-9 + np.abs(np.diff(r.e_in)).sum() + r.stored.max()
    return np.abs(r.residual()).max() < 1e-9 * flowed and r.capped == 0


def two(**given):
    d = Driveline()
    d.inertia("a", 0.3)
    d.inertia("b", 0.5, speed=100.0)
    d.variator("cvt", "a", "b", **given)
    return d


def test_a_sweep_of_a_variator_keeps_the_energy_as_its_closed_form():
    """(J_b + r^2 J_a) w_b^2 is constant without torques from outside."""
    r = run(two(ratio=2.0).build(), 2.0, 1e-3, {"cvt": ([0.0, 1.5], [2.0, 0.4])})
    ratio = np.interp(r.t, [0.0, 1.5], [2.0, 0.4])
    exact = 100.0 * np.sqrt((0.5 + 4.0 * 0.3) / (0.5 + ratio**2 * 0.3))
    assert r.speed("b") == pytest.approx(exact, rel=1e-6) and r.speed("a") == pytest.approx(ratio * r.speed("b"), rel=1e-9)
    assert np.ptp(r.stored) < 1e-9 * r.stored[0] and np.abs(r.e_in).max() < 1e-9 * r.stored[0] and closes(r)
    inside = (r.t > 0.01) & (r.t < 1.49)
    slowing = np.gradient(exact, r.t)
    assert r.torque("cvt", "b")[inside] == pytest.approx(0.5 * slowing[inside], rel=2e-3)
    assert r.torque("cvt", "b") == pytest.approx(-ratio * r.torque("cvt", "a"), rel=1e-9)
    assert r.accelerations()[inside, 1] == pytest.approx(slowing[inside], rel=2e-3)


def test_torques_through_a_variator_follow_its_ratio_as_scipy_has_it():
    def ratio(t):
        return 1.2 + 0.8 * math.sin(3.0 * t)

    d = two(ratio=1.2)
    d.inertia("wheel", 2.0)
    d.shaft("s", "a", "wheel", stiffness=400.0, damping=2.0)
    errors = []
    for step in (2e-3, 1e-3):
        r = run(d.build(), 2.0, step, {"cvt": ratio, "b": 30.0, "wheel": -20.0})

        def rate(t, y):
            s, now, change = 400.0 * y[2] + 2.0 * (ratio(t) * y[0] - y[1]), ratio(t), 2.4 * math.cos(3.0 * t)
            gained = (30.0 - now * s - 0.3 * now * change * y[0]) / (0.5 + 0.3 * now**2)
            return [gained, (s - 20.0) / 2.0, now * y[0] - y[1]]

        truth = solve_ivp(rate, (0.0, 2.0), [100.0, 0.0, 0.0], rtol=1e-10, atol=1e-10)
        errors.append(np.abs(r.speeds[-1, 1:] - truth.y[:2, -1]).max())
        assert closes(r)
    assert errors[1] < 1e-5 * 100.0 and errors[0] > 3.0 * errors[1]
    # none of the work comes from the variator, but for what is of second order in the step
    assert r.e_in[-1] == pytest.approx(30.0 * r.angle("b")[-1] - 20.0 * r.angle("wheel")[-1], rel=2e-4)


def test_the_ripple_behind_a_hooke_joint():
    """w_a / w_b = cos(bend) / (1 - sin(bend)^2 cos(angle)^2), e.g. Seherr-Thoss, Schmelz, Aucktor, Gelenke und Gelenkwellen."""
    d = two(table=(TURN, HOOKE), period=math.pi)
    d.motion("drive", "b")
    r = run(d.build(), 0.5, 5e-4)
    angle = 100.0 * r.t
    under = 1.0 - (math.sin(BEND) * np.cos(angle)) ** 2
    exact = 100.0 * math.cos(BEND) / under
    assert np.abs(r.speed("a") - exact).max() < 1e-5 * 100.0 and closes(r)
    rate = -(100.0**2) * math.cos(BEND) * math.sin(BEND) ** 2 * np.sin(2.0 * angle) / under**2
    assert np.abs(r.torque("cvt", "a") - 0.3 * rate)[1:].max() < 2e-3 * 0.3 * np.abs(rate).max()
    assert r.e_in[-1] == pytest.approx(0.5 * 0.3 * (exact[-1] ** 2 - exact[0] ** 2), abs=1e-6 * r.stored[0])


@pytest.mark.parametrize(("step", "near"), [(1e-3, 3e-5), (1e-4, 3e-7)])
def test_the_ripple_of_a_joint_beside_a_shaft_is_that_of_scipy(step, near):
    """A ratio 1 + 0.06 cos 2 x of the angle x of b, which a shaft of 2000 Nm/rad joins to a load."""
    turns = np.linspace(0.0, math.pi, 14401)
    d = Driveline()
    d.inertia("a", 0.4, speed=53.0)
    d.inertia("b", 0.3, speed=50.0)
    d.inertia("load", 0.6, speed=50.0)
    d.variator("joint", "a", "b", table=(turns, 1.0 + 0.06 * np.cos(2.0 * turns)), period=math.pi)
    d.shaft("s", "b", "load", stiffness=2000.0, damping=0.5)
    r = run(d.build(), 1.0, step, {"a": 20.0, "load": -15.0})

    def rate(t, y):
        x, w, twist, load = y
        ratio, bend = 1.0 + 0.06 * math.cos(2.0 * x), -0.12 * math.sin(2.0 * x)
        back = 2000.0 * twist + 0.5 * (w - load)
        gain = (20.0 * ratio - 0.4 * ratio * bend * w * w - back) / (0.3 + 0.4 * ratio * ratio)
        return [w, gain, w - load, (back - 15.0) / 0.6]

    truth = solve_ivp(rate, (0.0, 1.0), [0.0, 50.0, 0.0, 50.0], method="DOP853", rtol=1e-11, atol=1e-11, t_eval=r.t)
    assert np.abs(r.speed("b") - truth.y[1]).max() < near * 50.0 and np.ptp(truth.y[1]) > 5.0 and closes(r)


@pytest.mark.parametrize(("capacity", "holds"), [(79.0, False), (81.0, True)])
def test_a_clutch_behind_a_variator_carries_what_the_change_of_ratio_takes(capacity, holds):
    """0.2 kg m2 behind a, whose speed rises with 4 1/s times 100 rad/s: 80 Nm."""
    d = two()
    d.inertia("c", 0.2)
    d.clutch("k", "a", "c")
    d.motion("drive", "b")
    one = Run(d.build(), 1e-3, {"k": 500.0})
    one.to(1.0)
    one.set(cvt=([1.0, 1.25], [1.0, 2.0]), k=capacity)
    one.to(1.2)
    r = one.result()
    assert (abs(r.slip("k")[-1]) < 1e-9) == holds and closes(r)
    assert r.torque("k")[-1] == pytest.approx(80.0 if holds else 79.0, abs=1e-6)


def test_a_ratio_that_jumps_is_reached_within_a_step_without_power():
    r = run(two().build(), 0.2, 1e-3, {"cvt": ([0.1, 0.1], [1.0, 1.5])})
    assert r.speed("a")[-1] == pytest.approx(1.5 * r.speed("b")[-1]) and closes(r)
    assert r.speed("b")[-1] == pytest.approx(100.0 * math.sqrt(0.8 / (0.5 + 2.25 * 0.3)), rel=1e-6)


def test_modes_hold_a_variator_at_its_first_ratio():
    def built(geared):
        d = two(ratio=1.7) if geared else Driveline()
        if not geared:
            d.inertia("a", 0.3)
            d.inertia("b", 0.5)
            d.gear("a", "b", 1.7)
        d.inertia("c", 1.0)
        d.shaft("s", "b", "c", stiffness=800.0)
        return modes(d.build())

    assert built(True).frequencies == pytest.approx(built(False).frequencies)


def test_wrong_variators_are_refused_in_words():
    d = two()
    d.variator("other", "b", "a")
    with pytest.raises(RigError, match="variator 'other' says no more than the gears and relations before it; leave it out"):
        d.build()
    one = two()
    one.motion("drive", "b")
    one.motion("brake", "a")
    with pytest.raises(RigError, match=r"variators and free-wheels \('cvt'\) can hold against them"):
        one.build()
    with pytest.raises(RigError, match="the table of variator 'x' jumps"):
        d.variator("x", "a", "b", table=([0.0, 1.0, 1.0], [1.0, 2.0, 3.0]))
    with pytest.raises(RigError, match="names the ground; two bodies"):
        d.variator("x", "a", "ground")
