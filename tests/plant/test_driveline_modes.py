# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Natural frequencies, damping and mode shapes against closed forms (Den Hartog, Mechanical Vibrations, ch. 4)."""

import math

import numpy as np
import pytest

from rig_nodes.base.errors import RigError
from rig_nodes.driveline.builder import Driveline
from rig_nodes.driveline.vibration import modes


def test_two_masses_on_a_shaft():
    d = Driveline()
    d.inertia("a", 0.7)
    d.inertia("b", 0.3)
    d.shaft("s", "a", "b", stiffness=4000.0)
    m = modes(d.build())
    assert m.frequencies == pytest.approx([0.0, math.sqrt(4000.0 * (1 / 0.7 + 1 / 0.3)) / (2 * math.pi)], rel=1e-12, abs=1e-9)
    assert m.shapes == pytest.approx(np.array([[1.0, 1.0], [-0.3 / 0.7, 1.0]]), rel=1e-9)
    assert not m.damping.any()


@pytest.mark.parametrize("count", [3, 10, 50])
def test_a_uniform_chain_has_the_frequencies_of_its_closed_form(count):
    """Equal bodies on equal shafts, both ends free: 2 sqrt(k / J) sin(i pi / 2 N)."""
    d = Driveline()
    for i in range(count):
        d.inertia(f"J{i}", 0.2)
    for i in range(count - 1):
        d.shaft(f"s{i}", f"J{i}", f"J{i + 1}", stiffness=1500.0)
    m = modes(d.build())
    i = np.arange(count)
    exact = 2.0 * math.sqrt(1500.0 / 0.2) * np.sin(i * math.pi / (2 * count)) / (2.0 * math.pi)
    assert m.frequencies == pytest.approx(exact, rel=1e-9, abs=1e-9)
    shape = np.cos(math.pi * (i + 0.5) / count)
    assert m.shapes[1] == pytest.approx(shape / shape[np.abs(m.shapes[1]).argmax()], abs=1e-9)


def test_a_geared_branch_counts_by_the_square_of_its_ratio():
    d = Driveline()
    d.inertia("motor", 0.1)
    d.inertia("pinion", 0.0)
    d.inertia("wheel", 0.0)
    d.inertia("mill", 9.0)
    d.shaft("coupling", "motor", "pinion", stiffness=800.0)
    d.gear("pinion", "wheel", -6.0)
    d.inertia("fan", 0.4)
    d.shaft("belt", "wheel", "fan", stiffness=300.0)
    d.gear("mill", "wheel", 0.5)
    m = modes(d.build())
    # reduced to the wheel's speed: 36 times the motor and the coupling, a quarter of the mill
    jm, jw, jf, km, kf = 36 * 0.1, 9.0 / 4, 0.4, 36 * 800.0, 300.0
    half = 0.5 * (km * (1 / jm + 1 / jw) + kf * (1 / jw + 1 / jf))
    product = km * kf * (jm + jw + jf) / (jm * jw * jf)
    roots = [half - math.sqrt(half**2 - product), half + math.sqrt(half**2 - product)]
    assert m.frequencies == pytest.approx([0.0, *(math.sqrt(x) / (2 * math.pi) for x in roots)], rel=1e-9, abs=1e-9)
    by_name = dict(zip(m.bodies, m.shapes[2]))
    assert by_name["pinion"] == pytest.approx(-6.0 * by_name["wheel"])
    assert by_name["mill"] == pytest.approx(0.5 * by_name["wheel"])


def clutch_between_shafts():
    d = Driveline()
    for name, j in (("a", 0.5), ("b", 0.1), ("c", 0.2), ("d", 3.0)):
        d.inertia(name, j)
    d.shaft("ab", "a", "b", stiffness=2000.0)
    d.shaft("cd", "c", "d", stiffness=900.0)
    d.clutch("bc", "b", "c")
    d.brake("held", "d")
    return d.build()


def test_an_open_clutch_parts_the_driveline_and_a_locked_one_joins_it():
    system = clutch_between_shafts()
    left, right = (math.sqrt(k * (1 / j1 + 1 / j2)) / (2 * math.pi) for k, j1, j2 in ((2000, 0.5, 0.1), (900, 0.2, 3.0)))
    apart = modes(system)
    assert apart.frequencies == pytest.approx([0.0, 0.0, right, left], abs=1e-9)
    joined = modes(system, locked=["bc", "held"])
    k, c = np.array([2000.0, 900.0]), 0.3
    half = 0.5 * (k[0] / 0.5 + (k[0] + k[1]) / c)
    product = k[0] * k[1] / (0.5 * c)
    exact = [math.sqrt(half - math.sqrt(half**2 - product)), math.sqrt(half + math.sqrt(half**2 - product))]
    assert joined.frequencies == pytest.approx(np.array(exact) / (2 * math.pi), rel=1e-9)
    assert joined.shapes[:, 1] == pytest.approx(joined.shapes[:, 2]) and np.abs(joined.shapes[:, 3]).max() < 1e-12


def test_damping_of_one_oscillator_and_of_an_overdamped_one():
    d = Driveline()
    for name, damping in (("weak", 0.8), ("strong", 40.0)):
        d.inertia(name, 0.5)
        d.shaft(f"spring of {name}", name, "ground", stiffness=50.0, damping=damping)
    m = modes(d.build())
    natural = math.sqrt(50.0 / 0.5)
    half = 40.0 / (2 * 0.5)
    dies = [half - math.sqrt(half**2 - natural**2), half + math.sqrt(half**2 - natural**2)]
    assert 2 * math.pi * m.frequencies == pytest.approx([dies[0], natural, dies[1]], rel=1e-9)
    assert m.damping == pytest.approx([1.0, 0.8 / (2 * math.sqrt(50.0 * 0.5)), 1.0], rel=1e-9)


def test_a_free_driveline_with_damped_shafts_keeps_its_mode_at_0():
    d = Driveline()
    d.inertia("a", 0.7)
    d.inertia("b", 0.3)
    d.shaft("s", "a", "b", stiffness=4000.0, damping=2.0)
    m = modes(d.build())
    per = 1 / 0.7 + 1 / 0.3
    assert 2 * math.pi * m.frequencies == pytest.approx([0.0, math.sqrt(4000.0 * per)], rel=1e-9)
    assert m.damping == pytest.approx([0.0, 0.5 * 2.0 * per / math.sqrt(4000.0 * per)], rel=1e-9)


def test_what_depends_on_the_motion_counts_as_it_is_at_the_start():
    slopes = {"pendulum": -20.0, "fan": -0.8, "held": 0.0}
    d = Driveline()
    for name in slopes:
        d.inertia(name, 0.3)
        d.varying_inertia(f"piston of {name}", name, table=([0.0, 1.0], [0.2, 0.2]))
        d.shaft(f"spring of {name}", name, "ground", stiffness=30.0)
    d.torque("gravity", "pendulum", by="angle", table=([-1.0, 1.0], [-slopes["pendulum"], slopes["pendulum"]]))
    d.torque("air", "fan", table=([-9.0, 9.0], [-9.0 * slopes["fan"], 9.0 * slopes["fan"]]))
    d.motion("grip", "held")
    m = modes(d.build())
    assert 2 * math.pi * m.frequencies == pytest.approx([math.sqrt(30.0 / 0.5), math.sqrt((30.0 + 20.0) / 0.5)], rel=1e-9)
    assert m.damping == pytest.approx([0.8 / (2 * math.sqrt(30.0 * 0.5)), 0.0], rel=1e-9, abs=1e-12)
    assert np.abs(m.shapes[:, 2]).max() < 1e-12, "what a motion holds does not swing"


def test_a_torque_that_pushes_away_is_a_mode_that_grows():
    d = Driveline()
    d.inertia("upright", 0.5)
    d.torque("gravity", "upright", by="angle", table=([-1.0, 1.0], [-8.0, 8.0]))
    m = modes(d.build())
    assert 2 * math.pi * m.frequencies == pytest.approx([4.0, 4.0], rel=1e-9) and sorted(m.damping) == [-1.0, 1.0]


def test_an_unknown_clutch_is_named():
    with pytest.raises(RigError, match="no friction element 'x'; there are: bc, held"):
        modes(clutch_between_shafts(), locked=["x"])
