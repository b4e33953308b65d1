# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A value of a type that a description or a run does not take is refused in one sentence, not by an error of Python's."""

import math

import numpy as np
import pytest

from rig_nodes.base.errors import RigError
from rig_nodes.driveline.builder import Driveline
from rig_nodes.driveline.run import Run, run
from rig_nodes.driveline.vibration import modes

TABLE = ([0.0, 1.0], [1.0, 2.0])


@pytest.fixture
def three():
    """Returns three bodies of which the first two are geared, and a clutch to the third."""
    out = Driveline()
    for name in "abc":
        out.inertia(name, 1.0)
    out.gear("a", "b", 2.0)
    out.clutch("k", "b", "c")
    return out


@pytest.mark.parametrize(
    "describe, sentence",
    [
        (lambda d: d.inertia("x", "1"), "j of inertia 'x' is '1'; a number is needed"),
        (lambda d: d.inertia("x", None), "j of inertia 'x' is None; a number is needed"),
        (lambda d: d.inertia("x", True), "j of inertia 'x' is True; a number is needed"),
        (lambda d: d.inertia(3, 1.0), "name of inertia is 3; a name is needed"),
        (lambda d: d.inertia("", 1.0), "name of inertia is ''; a name is needed"),
        (lambda d: d.inertia("x", 1.0, speed="fast"), "speed of inertia 'x' is 'fast'; a number is needed"),
        (lambda d: d.gear("a", "c", "2"), "ratio of gear is '2'; a number is needed"),
        (lambda d: d.mesh("m", "a", "c", 2.0, "0.9"), "efficiency of mesh 'm' is '0.9'; a number is needed"),
        (lambda d: d.relation("r", [("a", 1.0), ("c", 2.0)]), "coefficients of relation 'r' is .*; a map of names and numbers"),
        (lambda d: d.relation("r", {"a": "1", "c": 2.0}), "coefficients of relation 'r' is .*; a map of names and numbers"),
        (lambda d: d.clutch("l", "a", "c", stick="1.2"), "stick of clutch 'l' is '1.2'; a number or two of them is needed"),
        (lambda d: d.shaft("s", "a", "c", stiffness=1.0, hysteresis=3.0), "hysteresis of shaft 's' is 3.0; a list of pairs"),
        (lambda d: d.shaft("s", "a", "c", stiffness=1.0, hysteresis=(3.0, 2.0)), "hysteresis of shaft 's' is .*; a list of pairs"),
        (lambda d: d.torque("t", "a"), "torque: missing a required argument: 'table'"),
        (lambda d: d.torque("t", "a", table=TABLE, period=1.0), "has a period and is by speed; only a table over an angle repeats"),
        (
            lambda d: (d.inertia("w", 1e300), d.gear("w", "c", 1e10), d.build()),
            "no finite number.*; inertias and ratios nearer to 1",
        ),
    ],
)
def test_in_a_description(three, describe, sentence):
    with pytest.raises(RigError, match=f"driveline: .*{sentence}"):
        describe(three)


@pytest.mark.parametrize(
    "start, sentence",
    [
        (lambda d: run(d, 1.0, 0.1), r"a Driveline cannot be run; a description becomes a System by its build\(\)"),
        (lambda d: modes(d), r"a Driveline cannot be run; a description becomes a System by its build\(\)"),
        (lambda d: modes(d.build(), locked="k"), "locked is 'k'; a list of names is needed"),
        (lambda d: run(d.build(), "1", 0.1), "end time '1' s; a finite number above 0 is needed"),
        (lambda d: run(d.build(), 1.0, "0.1"), "a step of '0.1' s; a finite number above 0 is needed"),
        (lambda d: run(d.build(), 1.0, 0.1, [("a", 1.0)]), "inputs are .*; a map from names to numbers, functions or tables"),
        (lambda d: run(d.build(), 1.0, 0.1, {"a": lambda t: None}), "the input 'a' gives None at 0 s; a number is needed"),
        (lambda d: run(d.build(), 1.0, 0.1, {"a": lambda t: np.ones(2)}), "the input 'a' gives .* at 0 s; a number is needed"),
        (lambda d: run(d.build(), 1.0, 0.1, breakpoints=[math.nan]), "breakpoints are .nan.; a list of finite times"),
        (lambda d: run(d.build(), 1.0, 0.1, breakpoints=0.5), "breakpoints are 0.5; a list of finite times"),
        (lambda d: Run(d.build(), 0.1, controller=5), "the controller is 5; a function of the moment is needed"),
        (lambda d: Run(d.build(), 0.1, every=1.5), "every 1.5 steps; a whole number from 1 on is needed"),
        (lambda d: Run(d.build(), 0.1).step(-1), "-1 steps; a whole number from 0 on is needed"),
        (lambda d: Run(d.build(), 0.1).step(1.5), "1.5 steps; a whole number from 0 on is needed"),
        (lambda d: Run(d.build(), 0.1).to("1"), "end time '1' s; a finite number is needed"),
    ],
)
def test_in_a_run(three, start, sentence):
    with pytest.raises(RigError, match=f"driveline: .*{sentence}"):
        start(three)


def test_numbers_of_numpy_are_numbers():
    d = Driveline()
    d.inertia("a", np.float32(1.0), speed=np.int64(2))
    d.inertia("b", 1)
    d.gear("a", "b", np.array(2.0))
    assert run(d.build(), 1, 0.5, {"a": lambda t: np.float64(0.0)}).speed("a")[-1] == 2.0
