# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Inertia over an angle: a slider-crank, compared with the balances of energy and torques."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rig_nodes.base.errors import RigError
from rig_nodes.driveline.builder import Driveline
from rig_nodes.driveline.run import Run, run

MASS, RADIUS, ROD, WHEEL = 2.0, 0.08, 0.2, 0.05


def lever(angle):
    """Returns the slider's speed over that of the crank: x = r cos + sqrt(l^2 - r^2 sin^2) (e.g. Shigley, Theory of Machines)."""
    across = RADIUS * np.sin(angle)
    return -across - across * RADIUS * np.cos(angle) / np.sqrt(ROD**2 - across**2)


def engine(speed=40.0, angle=0.4):
    d = Driveline()
    d.inertia("crank", WHEEL, speed=speed)
    d.slider_crank("piston", "crank", mass=MASS, radius=RADIUS, rod=ROD, angle=angle)
    return d


def closes(r):
    flowed = 1e-9 + np.abs(np.diff(r.e_in)).sum() + r.stored.max()
    return np.abs(r.residual()).max() < 1e-9 * flowed and r.capped == 0


def test_a_free_crank_has_the_speed_that_its_energy_gives_it_at_every_angle():
    r = run(engine().build(), 2.0, 1e-4)
    at = r.angle("crank") + 0.4
    exact = 40.0 * np.sqrt((WHEEL + MASS * lever(0.4) ** 2) / (WHEEL + MASS * lever(at) ** 2))
    assert r.speed("crank") == pytest.approx(exact, abs=1e-5) and np.ptp(exact) > 3.0
    assert at[-1] > 70.0 and np.ptp(r.stored) < 1e-9 * r.stored[0] and closes(r)


def test_the_angle_of_a_free_crank_is_the_integral_over_its_inertia():
    angles = np.linspace(0.4, 0.4 + 4.0 * math.pi, 400001)
    j = WHEEL + MASS * lever(angles) ** 2
    speed = 40.0 * np.sqrt(j[0] / j)
    turns = np.sum(0.5 * (1.0 / speed[1:] + 1.0 / speed[:-1])) * (angles[1] - angles[0])
    error = []
    for step in (4e-3, 2e-3, 1e-3, 1e-4):
        one = Run(engine().build(), step)
        error.append(abs(one.to(turns).angle("crank") - 4.0 * math.pi))
    assert error[1] < 0.35 * error[0] and error[2] < 0.35 * error[1] and error[3] < 1e-5


def test_a_driven_slider_crank_with_a_shaft_and_a_load_against_scipy():
    d = engine(speed=0.0, angle=math.pi / 2)
    d.inertia("load", 0.4)
    d.shaft("shaft", "crank", "load", stiffness=400.0, damping=0.5)
    gas = np.linspace(0.0, 2 * math.pi, 7201)
    d.torque("gas", "crank", by="angle", table=(gas, 15.0 + 12.0 * np.sin(gas)), period=2 * math.pi, angle=math.pi / 2)
    r = run(d.build(), 2.0, 1e-4, {"load": lambda t: -4.0 * t})

    def rate(t, y):
        w, v, x, at = y
        j = WHEEL + MASS * lever(at) ** 2
        bend = MASS * (lever(at + 1e-5) ** 2 - lever(at - 1e-5) ** 2) / 2e-5
        s = 400.0 * x + 0.5 * (w - v)
        return [(15.0 + 12.0 * math.sin(at) - s - 0.5 * bend * w * w) / j, (s - 4.0 * t) / 0.4, w - v, w]

    truth = solve_ivp(rate, (0.0, 2.0), [0.0, 0.0, 0.0, math.pi / 2], method="DOP853", rtol=1e-10, atol=1e-10)
    full = np.abs(truth.y[:2]).max()
    assert r.speeds[-1] == pytest.approx(truth.y[:2, -1], abs=1e-4 * full) and full > 20.0
    assert r.torque("shaft")[-1] == pytest.approx(400.0 * truth.y[2, -1] + 0.5 * (truth.y[0, -1] - truth.y[1, -1]), abs=1e-2)
    assert r.accelerations()[-1] == pytest.approx(rate(2.0, truth.y[:, -1])[:2], abs=0.5) and closes(r)


def test_a_clutch_locks_to_a_crank_and_lets_go():
    d = engine(speed=0.0)
    d.inertia("motor", 0.2, speed=50.0)
    d.clutch("c", "motor", "crank", stick=1.2)
    r = run(d.build(), 1.0, 1e-3, {"c": ([0.0, 0.6, 0.6, 1.0], [20.0, 20.0, 3.0, 3.0])})
    assert [e.kind for e in r.events][:2] == ["close", "lock"] and "break" in [e.kind for e in r.events]
    locked = np.abs(r.mode("c")) >= 2
    assert np.abs(r.slip("c")[locked]).max() < 1e-11 and closes(r)


def test_a_gear_to_a_crank_carries_what_the_slider_takes():
    d = engine(speed=10.0)
    d.inertia("pinion", 0.01)
    d.gear("pinion", "crank", -3.0, "gear")
    r = run(d.build(), 0.5, 1e-4, {"pinion": 2.0})
    gain = r.accelerations()[:, 1]
    assert r.torque("gear", "pinion") == pytest.approx(0.01 * gain - 2.0, abs=1e-9)
    at = r.angle("crank") + 0.4
    slope = MASS * (lever(at + 1e-5) ** 2 - lever(at - 1e-5) ** 2) / 2e-5
    takes = (WHEEL + MASS * lever(at) ** 2) * r.accelerations()[:, 0] + 0.5 * slope * r.speed("crank") ** 2
    assert r.torque("gear", "crank") == pytest.approx(takes, abs=0.02) and np.ptp(takes) > 0.5
    # the torque of the slider on the crank
    assert r.torque("piston") == pytest.approx(WHEEL * r.accelerations()[:, 0] - takes, abs=0.02)


@pytest.mark.parametrize(
    "act, words",
    [
        (lambda d: d.slider_crank("p", "x", mass=1.0, radius=0.1, rod=0.3), "varying inertia 'p' names the body 'x'"),
        (lambda d: d.slider_crank("p", "crank", mass=0.0, radius=0.1, rod=0.3), "mass of slider-crank 'p' is 0.0"),
        (lambda d: d.slider_crank("p", "crank", mass=1.0, radius=0.1, rod=0.1), "rod of slider-crank 'p' is 0.1 m"),
        (lambda d: d.varying_inertia("p", "crank", table=([0.0, 1.0], [0.1, -0.1])), "table of varying inertia 'p' falls to -0.1"),
        (lambda d: d.varying_inertia("p", "crank", table=([0.0, 0.0], [0.1, 0.2])), "table of varying inertia 'p' jumps"),
        (
            lambda d: d.slider_crank("p", "crank", mass=1.0, radius=0.1, rod=0.3, angle=math.nan),
            "angle of varying inertia 'p' is nan",
        ),
    ],
)
def test_refuses_in_one_sentence(act, words):
    with pytest.raises(RigError, match=words) as refusal:
        act(engine())
    assert refusal.value.exit_code == 2 and "\n" not in str(refusal.value)
