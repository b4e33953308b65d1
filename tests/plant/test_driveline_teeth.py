# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Meshes whose efficiency depends on speed and torque, alone and with friction in their bearings, compared with scipy."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from rig_nodes.base.errors import RigError
from rig_nodes.driveline.builder import Driveline
from rig_nodes.driveline.run import run

JA, JB, R = 0.5, 3.0, 4.0
SPEEDS, THERE, BACK = [0.0, 20.0, 60.0], [0.6, 0.9, 0.8], [0.3, 0.7, 0.75]


def closes(r):
    flowed = 1e-9 + np.abs(np.diff(r.e_in)).sum() + r.stored.max()
    return np.abs(r.residual()).max() < 1e-9 * flowed and r.capped == 0


def pair(efficiency, back=None, speed=0.0):
    d = Driveline()
    d.inertia("a", JA, speed=R * speed)
    d.inertia("b", JB)
    d.mesh("m", "a", "b", R, efficiency, back)
    return d


def gain(at_a, at_b, there, back, w):
    """Acceleration of b at a speed w of a, whichever side drives."""
    for passes, sign in ((there, 1.0), (1.0 / back, -1.0)):
        found = (at_b + passes * R * at_a) / (JB + passes * R**2 * JA)
        if sign * (at_a - JA * R * found) * w >= 0.0:
            return found
    raise AssertionError("no side drives")


@pytest.mark.parametrize("step", [1e-3, 1e-4])
@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize("drives", ["a", "b"])
def test_an_efficiency_over_speed_is_that_of_scipy_in_all_four_quadrants(drives, direction, step):
    at_a, at_b = (20.0, -3.0) if drives == "a" else (-20.0, 30.0)
    r = run(
        pair((SPEEDS, THERE), (SPEEDS, BACK), 8.0 * direction).build(), 1.0, step, {"a": at_a * direction, "b": at_b * direction}
    )

    def rate(t, y):
        w = R * y[0]
        there, back = np.interp(abs(w), SPEEDS, THERE), np.interp(abs(w), SPEEDS, BACK)
        return [gain(at_a * direction, at_b * direction, there, back, w)]

    truth = solve_ivp(rate, (0.0, 1.0), [8.0 * direction], rtol=1e-11, atol=1e-11, max_step=1e-3, t_eval=r.t)
    assert np.abs(r.speed("b") - truth.y[0]).max() < 1e-5 * np.abs(truth.y[0]).max() and closes(r)
    passed = r.torque("m", "b")[-1] / R / -r.torque("m", "a")[-1]
    speed = R * abs(r.speed("b")[-1])
    expected = np.interp(speed, SPEEDS, THERE) if drives == "a" else 1.0 / np.interp(speed, SPEEDS, BACK)
    assert passed == pytest.approx(expected, rel=1e-4)


def test_an_efficiency_over_speed_and_torque_is_that_of_scipy():
    loads, values = [5.0, 20.0, 60.0], np.array([[0.5, 0.7, 0.8], [0.6, 0.85, 0.95]])

    def efficiency(w, load):
        return np.interp(abs(w), [0.0, 80.0], [np.interp(abs(load), loads, row) for row in values])

    r = run(
        pair(([0.0, 80.0], loads, values), speed=5.0).build(), 1.5, 1e-3, {"a": lambda t: 30.0 + 25.0 * np.sin(4.0 * t), "b": -40.0}
    )

    def rate(t, y):
        at_a, w = 30.0 + 25.0 * np.sin(4.0 * t), R * y[0]

        def missed(load):
            found = (-40.0 + efficiency(w, load) * R * at_a) / (JB + efficiency(w, load) * R**2 * JA)
            return at_a - JA * R * found - load

        load = brentq(missed, -100.0, 200.0, xtol=1e-13)
        assert load > 0.0
        return [(at_a - load) / JA / R]

    truth = solve_ivp(rate, (0.0, 1.5), [5.0], rtol=1e-10, atol=1e-10, max_step=2e-3, t_eval=r.t)
    assert np.abs(r.speed("b") - truth.y[0]).max() < 1e-5 * np.abs(truth.y[0]).max() and closes(r)
    assert np.ptp(r.torque("m", "a")) > 10.0, "the load sweeps the table"


def test_lossy_gear_of_the_modelica_standard_library_with_a_table_and_friction_of_its_bearings():
    """Its lossTable [0, 0.8, 0.8, 1, 1; 1, 0.7, 0.7, 2, 2] of HeatLosses, whose bearing friction is all at b; ratio 2.

    Where a drives, the loss at a is (1 - eta) tau_a + tau_bf, and where b drives (1 - 1 / eta) tau_a + tau_bf.
    """
    d = Driveline()
    d.inertia("a", 2.0)
    d.inertia("b", 1.0, speed=0.4)
    d.mesh("m", "a", "b", 2.0, ([0.0, 1.0], [0.8, 0.7]))
    d.brake("bearing", "b")
    d.capacity("bearing", "a", table=([-1.0, 0.0, 1.0], [4.0, 2.0, 4.0]))
    r = run(d.build(), 1.0, 1e-4, {"a": lambda t: 1.0 + 8.0 * np.cos(3.0 * t), "b": -2.0})

    def rate(t, y):
        at_a, w = 1.0 + 8.0 * np.cos(3.0 * t), 2.0 * y[0]
        eta, bf = np.interp(abs(w), [0.0, 1.0], [0.8, 0.7]), np.interp(abs(w), [0.0, 1.0], [1.0, 2.0])
        for passes in (eta, 1.0 / eta):
            found = (-2.0 + 2.0 * (passes * at_a - bf)) / (1.0 + 4.0 * passes * 2.0)
            if (at_a - 4.0 * found >= 0.0) == (passes < 1.0):
                return [found]
        raise AssertionError("no side drives")

    until = r.t < 0.4  # then it stops
    truth = solve_ivp(rate, (0.0, 0.4), [0.4], rtol=1e-11, atol=1e-11, max_step=1e-3, t_eval=r.t[until])
    assert truth.y[0].min() > 0.0 and np.abs(r.speed("b")[until] - truth.y[0]).max() < 1e-5 * truth.y[0].max() and closes(r)


def test_a_planetary_set_has_a_table_over_its_sun_relative_to_the_carrier():
    def built(efficiency):
        d = Driveline()
        for name, j in (("sun", 0.1), ("ring", 0.4), ("carrier", 0.8)):
            d.inertia(name, j, speed=30.0)
        d.planetary("set", "sun", "ring", "carrier", 2.0, efficiency)
        return run(d.build(), 0.5, 1e-3, {"sun": 10.0, "ring": 4.0, "carrier": -25.0})

    flat = built(([0.0, 400.0], [0.85, 0.85]))
    assert flat.speeds == pytest.approx(built(0.85).speeds, rel=1e-7) and closes(flat)
    falling = built(([0.0, 400.0], [0.9, 0.5]))
    turned, torque = falling.speed("sun") - falling.speed("carrier"), falling.torque("set", "sun")
    passed = abs(falling.torque("set", "ring")[-1] / 2.0 / torque[-1])
    expected = np.interp(abs(turned[-1]), [0.0, 400.0], [0.9, 0.5])
    assert min(passed, 1.0 / passed) == pytest.approx(expected, rel=1e-3) and closes(falling)


@pytest.mark.parametrize(
    ("efficiency", "sentence"),
    [
        (([0.0, 1.0], [0.8, 1.2]), "efficiency of mesh 'm' is 1.2; a number above 0, at most 1, is needed"),
        (([1.0, 0.0], [0.8, 0.7]), "a number is needed, or rising speeds from 0 on and a value for each"),
        (([0.0, 1.0], [0.8]), "a number is needed, or rising speeds"),
        (([0.0, 1.0], [0.0, 5.0], [[0.8, 0.8], [0.7, 0.7]]), "rising torques above 0"),
        ("high", "efficiency of mesh 'm' is 'high'; a number is needed"),
    ],
)
def test_a_wrong_efficiency_is_refused_in_words(efficiency, sentence):
    with pytest.raises(RigError, match=sentence):
        pair(efficiency)
