# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The driveline against the Modelica Standard Library's CoupledClutches (published result, MSL 4.1.0)."""

import math

import numpy as np
import pytest

from rig_nodes.driveline.builder import Driveline
from rig_nodes.driveline.run import run

# time [s], element, kind, speed of J1 [rad/s] (kind None: only the speed is compared)
TABLE = [
    (0.400000, "c2", "close", 6.166300),
    (0.709621, "c2", "lock", 4.429701),
    (0.791658, "c1", "lock", 3.336941),
    (0.831109, "c1", "break", 3.380080),
    (0.900000, "c3", "close", 3.556477),
    (0.906849, "c1", "lock", 3.520244),
    (1.000296, "c1", "break", 2.999049),
    (1.143970, "c3", "lock", 3.059224),
    (1.250000, "c1", "free", 2.928723),
    (1.500000, None, None, 3.247035),
]


def drive(t):
    return 10.0 * math.sin(2.0 * math.pi * 5.0 * t)


def capacity_1(t):
    return 10.0 * max(0.0, math.sin(2.0 * math.pi * 0.2 * t + math.pi / 2.0)) if t < 1.25 else 0.0


@pytest.fixture(scope="module")
def result():
    d = Driveline()
    d.inertia("J1", 1.0, speed=10.0)
    for k in (2, 3, 4):
        d.inertia(f"J{k}", 1.0)
    for k in (1, 2, 3):
        d.clutch(f"c{k}", f"J{k}", f"J{k + 1}", stick=1.1)
    # a step also ends at each time of the table, so that speeds are compared exactly there
    times = [row[0] for row in TABLE]
    return run(
        d.build(),
        1.5,
        1e-4,
        {
            "J1": drive,
            "c1": capacity_1,
            "c2": ([0.0, 0.4, 0.4, 1.5], [0.0, 0.0, 10.0, 10.0]),
            "c3": ([0.0, 0.9, 0.9, 1.5], [0.0, 0.0, 10.0, 10.0]),
        },
        breakpoints=times,
    )


def test_events_and_nothing_but_these(result):
    expected = [row for row in TABLE if row[1]]
    seen = [e for e in result.events if e.t > 0.0]
    assert [(e.element, e.kind) for e in seen] == [row[1:3] for row in expected]
    assert max(abs(e.t - row[0]) for e, row in zip(seen, expected)) < 1e-5


def test_speed_of_the_driven_inertia(result):
    w1 = result.speed("J1")
    for t, _, _, speed in TABLE:
        assert w1[np.argmin(np.abs(result.t - t))] == pytest.approx(speed, abs=1e-4)


def test_first_slip_against_the_closed_form(result):
    """Until clutch 1 locks, only the drive and capacity 1 act on J1, and both can be integrated by hand."""
    w1 = result.speed("J1")
    for t in (0.4, 0.709621):
        driven = (1.0 - math.cos(10.0 * math.pi * t)) / math.pi
        braked = 25.0 / math.pi * math.sin(0.4 * math.pi * t)
        exact = 10.0 + driven - braked
        assert w1[np.argmin(np.abs(result.t - t))] == pytest.approx(exact, abs=1e-6)


def test_no_drift_while_locked(result):
    for k in (1, 2, 3):
        locked = np.abs(result.mode(f"c{k}")) >= 2
        slip = result.speed(f"J{k}") - result.speed(f"J{k + 1}")
        assert locked.sum() > 50
        assert np.abs(slip[locked]).max() < 1e-12


def test_energy_is_accounted_for(result):
    assert np.abs(result.residual()).max() < 1e-11
    assert result.e_fric[-1].min() > 0.1
    assert result.capped == 0
