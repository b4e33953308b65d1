# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Elements that depend on the motion: half the step has a quarter of the error, compared with a run of a far shorter step."""

import math

import numpy as np
import pytest

from rig_nodes.driveline.builder import Driveline
from rig_nodes.driveline.run import run

ANGLES = np.linspace(0.0, 2.0 * math.pi, 721)


def two(a, b):
    d = Driveline()
    d.inertia("a", a[0], speed=a[1])
    d.inertia("b", b[0], speed=b[1])
    return d


def crank():
    d = two((0.02, 40.0), (0.05, 40.0))
    d.shaft("s", "a", "b", stiffness=300.0, damping=0.1)
    d.slider_crank("p", "b", mass=2.0, radius=0.08, rod=0.2)
    return d, {"a": 3.0}


def torque_by_angle():
    d = two((0.5, 3.0), (1.0, 0.0))
    d.torque("t", "a", by="angle", table=(ANGLES, -8.0 * np.sin(ANGLES)), period=2.0 * math.pi)
    return d, {"a": lambda t: 4.0 * math.sin(5.0 * t)}


def centrifugal_clutch():
    speeds = np.linspace(100.0, 400.0, 3001)
    d = two((0.02, 100.0), (0.3, 0.0))
    d.clutch("shoes", "a", "b")
    d.capacity("shoes", "a", table=(speeds, 1e-3 * (speeds**2 - 1e4)))
    return d, {"a": lambda t: 20.0 + 5.0 * math.sin(30.0 * t)}


def capacity_by_slip():
    d = two((1.0, 30.0), (0.5, 0.0))
    d.inertia("c", 0.5, speed=-10.0)
    d.clutch("k", "a", "b")
    d.clutch("l", "b", "c")
    d.capacity("l", "k", table=([-40.0, 0.0, 40.0], [20.0, 2.0, 20.0]))
    return d, {"k": 6.0, "a": lambda t: 9.0 * math.sin(7.0 * t)}


def mesh_behind_a_shaft():
    d = two((0.05, 0.0), (1.0, 0.0))
    d.inertia("c", 0.5)
    d.mesh("m", "a", "b", 4.0, 0.5, 0.3)
    d.shaft("s", "b", "c", stiffness=800.0, damping=0.5)
    return d, {"a": lambda t: 10.0 * math.sin(12.0 * t), "c": lambda t: 15.0 * math.cos(7.0 * t)}


def shaft_with_hysteresis():
    d = two((0.5, 3.0), (2.0, 0.0))
    d.shaft("s", "a", "b", stiffness=500.0, damping=0.2, hysteresis=[(2000.0, 8.0), (800.0, 6.0)])
    return d, {"b": lambda t: 5.0 * math.sin(9.0 * t)}


def stick_slip():
    d = two((1.0, 0.5), (0.4, 0.0))
    d.motion("pull", "a")
    d.shaft("s", "a", "b", stiffness=200.0)
    d.brake("floor", "b", friction=([0.0, 1.0, 10.0], [1.0, 0.6, 0.5]))
    return d, {"floor": 20.0}


@pytest.mark.parametrize(
    "make", [crank, torque_by_angle, centrifugal_clutch, capacity_by_slip, mesh_behind_a_shaft, shaft_with_hysteresis, stick_slip]
)
def test_half_the_step_has_a_quarter_of_the_error(make):
    d, inputs = make()
    system = d.build()
    fine, *others = (run(system, 0.48, step, inputs) for step in (2.5e-5, 1.6e-3, 8e-4, 4e-4))
    full = np.abs(fine.speeds).max()
    errors = [
        np.abs(r.speeds[:: round(1.6e-3 / step)] - fine.speeds[::64]).max() / full for r, step in zip(others, (1.6e-3, 8e-4, 4e-4))
    ]
    # where a shaft is exact, what is left are the steps in which a bend or a change of modes lies
    assert errors[2] < 0.09 * errors[0] + 2e-6 and errors[2] < 2e-3 and fine.capped == 0
