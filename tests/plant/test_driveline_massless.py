# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bodies without inertia between shafts, compared with one shaft that is equivalent to them."""

import math

import numpy as np
import pytest

from rig_nodes.base.errors import RigError
from rig_nodes.driveline.builder import Driveline
from rig_nodes.driveline.run import Run, run
from rig_nodes.driveline.vibration import modes, sensitivities


def ends(*, between=(), speed=3.0):
    """Returns a description of two bodies with inertia and, between them, those without."""
    d = Driveline()
    d.inertia("a", 0.5, speed=speed)
    for name in between:
        d.inertia(name, 0.0)
    d.inertia("b", 2.0)
    return d


def in_series(*stiffnesses, proportion=0.002, **start):
    names = [f"m{k}" for k in range(len(stiffnesses) - 1)]
    d = ends(between=names, **start)
    for k, (one, other) in enumerate(zip(["a", *names], [*names, "b"])):
        d.shaft(f"s{k}", one, other, stiffness=stiffnesses[k], damping=proportion * stiffnesses[k])
    return d


@pytest.mark.parametrize("stiffnesses", [(900.0, 300.0), (900.0, 300.0, 50.0, 1e6), (1e7, 1.0)])
def test_shafts_in_series_act_as_one_whose_compliance_is_the_sum_of_theirs(stiffnesses):
    whole = 1.0 / sum(1.0 / k for k in stiffnesses)
    one = ends()
    one.shaft("s", "a", "b", stiffness=whole, damping=0.002 * whole)
    system = in_series(*stiffnesses).build()
    r, truth = (run(x, 1.0, 1e-4, {"a": lambda t: 4.0 * math.cos(9.0 * t)}) for x in (system, one.build()))
    for body in "ab":
        assert np.abs(r.speed(body) - truth.speed(body)).max() < 1e-11
    for k in range(len(stiffnesses)):
        assert np.abs(r.torque(f"s{k}") - truth.torque("s")).max() < 1e-9 * whole
    flowed = np.abs(np.diff(r.e_in)).sum() + r.stored.max()
    assert np.abs(r.residual()).max() < 1e-9 * flowed
    natural = math.sqrt(whole * (1.0 / 0.5 + 1.0 / 2.0)) / (2.0 * math.pi)
    assert modes(system).frequencies == pytest.approx([0.0, natural], rel=1e-9)


def test_the_speed_between_two_springs_is_their_mean_and_a_start_is_taken_from_it():
    d = in_series(900.0, 300.0, proportion=0.0)
    r = run(d.build(), 1.0, 1e-4)
    assert r.speed("m0") == pytest.approx(0.75 * r.speed("a") + 0.25 * r.speed("b"), abs=1e-12)
    relative = r.speed("a") - r.speed("b")
    # at a step of 100 us the error is at most 1e-4 of the full 3 rad/s
    assert relative == pytest.approx(3.0 * np.cos(math.sqrt(225.0 * 2.5) * r.t), abs=3e-4)


def test_a_speed_at_the_start_that_is_not_the_mean_is_refused():
    d = Driveline()
    for name, j, speed in (("a", 0.5, 3.0), ("m", 0.0, 1.0), ("b", 2.0, 0.0)):
        d.inertia(name, j, speed=speed)
    d.shaft("s", "a", "m", stiffness=900.0)
    d.shaft("t", "m", "b", stiffness=300.0)
    with pytest.raises(RigError, match="initial speeds contradict"):
        d.build()


def test_a_pair_of_wheels_without_inertia_between_shafts_has_its_ratio():
    """The wheel m turns three times as fast as n: reduced to m the shaft on n has a ninth of its stiffness."""
    d = ends(between=("m", "n"))
    d.gear("m", "n", 3.0, "pair")
    d.shaft("s", "a", "m", stiffness=90.0)
    d.shaft("t", "n", "b", stiffness=810.0)
    one = ends()
    one.shaft("s", "a", "b", 1.0, 3.0, stiffness=45.0)
    r, truth = (run(x.build(), 1.0, 1e-4, {"b": 6.0}) for x in (d, one))
    assert r.speed("a") == pytest.approx(truth.speed("a"), abs=1e-11)
    assert r.speed("b") == pytest.approx(truth.speed("b"), abs=1e-11)
    assert r.torque("pair", "m") == pytest.approx(-r.torque("s"), abs=1e-9), "the gear puts on the wheel what the shaft takes"


def test_three_shafts_meet_in_a_body_without_inertia():
    """Two equal springs to the ends, one to the ground: the stiffness matrix of the ends follows by eliminating the middle."""
    d = ends(between=("m",))
    d.shaft("s", "a", "m", stiffness=100.0)
    d.shaft("t", "m", "b", stiffness=100.0)
    d.shaft("g", "m", "ground", stiffness=200.0)
    matrix = np.diag([100.0, 100.0]) - np.full((2, 2), 100.0**2 / 400.0)
    squares = np.linalg.eigvals(np.diag([1.0 / 0.5, 1.0 / 2.0]) @ matrix)
    assert modes(d.build()).frequencies == pytest.approx(np.sqrt(np.sort(squares)) / (2.0 * math.pi), rel=1e-9)


def test_a_clutch_beyond_the_shafts_locks_when_the_one_shaft_says():
    def of(d, last):
        d.inertia("c", 1.0)
        d.clutch("k", last, "c")
        return run(d.build(), 1.0, 1e-3, {"k": 3.0, "a": 2.0})

    one = ends()
    one.shaft("s", "a", "b", stiffness=225.0, damping=0.45)
    r, truth = of(in_series(900.0, 300.0), "b"), of(one, "b")
    assert [e.kind for e in r.events] == [e.kind for e in truth.events] != []
    assert [e.t for e in r.events] == pytest.approx([e.t for e in truth.events], abs=1e-10)


def test_dampers_in_series_act_as_one_and_sensitivities_say_which_spring_counts():
    d = ends(between=("m",))
    d.shaft("s", "a", "m", stiffness=0.0, damping=6.0)
    d.shaft("t", "m", "b", stiffness=0.0, damping=3.0)
    one = ends()
    one.shaft("s", "a", "b", stiffness=0.0, damping=2.0)
    r, truth = (run(x.build(), 0.5, 1e-3) for x in (d, one))
    assert r.speed("a") == pytest.approx(truth.speed("a"), abs=1e-12)
    # the frequency grows with the square root of the stiffness, so the shares of both springs add up to 1/2
    found = sensitivities(in_series(900.0, 300.0, proportion=0.0).build())
    assert found.stiffness[1].sum() == pytest.approx(0.5, abs=1e-9)


def spring(d, name, a, b, stiffness=900.0, **more):
    d.shaft(name, a, b, stiffness=stiffness, **more)


@pytest.mark.parametrize(
    "describe, words",
    [
        (lambda d: (spring(d, "s", "a", "m"), d.clutch("k", "m", "b")), "'m' has no inertia, and 'k' acts on it.*a billionth"),
        (lambda d: (d.clutch("j", "a", "m"), d.clutch("k", "m", "b")), "'m' has no inertia, and 'j' acts on it.*a billionth"),
        (lambda d: (spring(d, "s", "a", "m"), spring(d, "t", "m", "b", backlash=0.1)), "'m' has no inertia, and 't' acts on it"),
        (
            lambda d: (spring(d, "s", "a", "m"), spring(d, "t", "m", "b"), d.torque("air", "m", table=([0.0, 1.0], [0.0, -1.0]))),
            "'m' has no inertia, and 'air' acts on it",
        ),
        (lambda d: (spring(d, "s", "a", "m", damping=1.0), spring(d, "t", "m", "b")), "damping of its shafts is not in the same"),
        (lambda d: (spring(d, "s", "a", "m", twist=0.1), spring(d, "t", "m", "b")), "put 90 Nm on body 'm'.*twists whose torques"),
        (lambda d: spring(d, "s", "a", "m"), "body 'm' has no inertia, and no gears"),
        (lambda d: (spring(d, "s", "a", "m", 0.0), spring(d, "t", "m", "b", 0.0)), "body 'm' has no inertia, and no gears"),
    ],
)
def test_refuses_in_one_sentence(describe, words):
    d = ends(between=("m",))
    describe(d)
    with pytest.raises(RigError, match=words) as refusal:
        d.build()
    assert "\n" not in str(refusal.value)


def test_a_torque_on_such_a_body_is_refused():
    with pytest.raises(RigError, match="body 'm0' has no inertia and stands between shafts.*give it an inertia"):
        Run(in_series(900.0, 300.0).build(), 1e-3, {"m0": 1.0})
