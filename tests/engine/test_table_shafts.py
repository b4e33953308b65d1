# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Shafts with tables: exact across their bends, at the cost of a straight shaft, alone and in the engine of a rig."""

import cmath
import math
import time

import numpy as np
import pytest
from scipy.optimize import brentq
from small_rig import HEAD

from rig_nodes.driveline.builder import Driveline
from rig_nodes.driveline.run import Run, run
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.plan import plan_of
from rig_nodes.runs.rig import Rig

INERTIAS, LOAD = (0.3, 0.05), 100.0  # kg m2 of two bodies; Nm on the first
MOBILITY = sum(1.0 / j for j in INERTIAS)


def middle(stiffness):
    """Return the twist about which the bodies swing on a straight shaft."""
    return LOAD / INERTIAS[0] / (stiffness * MOBILITY)


def two_bodies(**shaft):
    d = Driveline()
    for name, inertia in zip("ab", INERTIAS):
        d.inertia(name, inertia)
    d.shaft("s", "a", "b", **shaft)
    return d.build()


def swings(x, y, damping, grid):
    """Return twists and their rates (r, 2) at the times of a grid, by the closed form from one bend to the next."""
    slopes, state, t, out = np.diff(y) / np.diff(x), (0.0, 0.0), 0.0, [(0.0, 0.0)]
    piece = int(np.searchsorted(x, 0.0, "right")) - 1
    while len(out) < len(grid):
        low = x[piece] if piece > 0 else -math.inf
        high = x[piece + 1] if piece < len(slopes) - 1 else math.inf
        at = swing(state, LOAD / INERTIAS[0] - MOBILITY * (y[piece] - slopes[piece] * x[piece]), slopes[piece], damping)
        left = grid[len(out)] - t
        samples = 8 * math.ceil(left * math.sqrt(MOBILITY * max(slopes)))
        time = next((time for time in left * np.arange(1, samples + 1) / samples if not low <= at(time)[0] <= high), None)
        if time is None:
            state, t = at(left), grid[len(out)]
            out.append(state)
            continue
        bend = high if at(time)[0] > high else low
        passed = brentq(lambda time: at(time)[0] - bend, 0.0 if state[0] != bend else 1e-6 * time, time, xtol=1e-17, rtol=1e-14)
        state, t, piece = (bend, at(passed)[1]), t + passed, piece + (1 if bend == high else -1)
    return np.array(out)


def swing(state, load, stiffness, damping):
    """Return the function of time that gives twist and rate after a state, on a straight shaft or, without stiffness, on none."""
    k, half = MOBILITY * stiffness, 0.5 * MOBILITY * damping
    if k == 0.0:
        return lambda time: (state[0] + time * (state[1] + 0.5 * load * time), state[1] + load * time)
    rate, off = complex(-half, math.sqrt(k - half**2)), state[0] - load / k
    start = complex(off, -(state[1] + half * off) / rate.imag)

    def at(time):
        turned = start * cmath.exp(rate * time)
        return turned.real + load / k, (turned * rate).real

    return at


@pytest.mark.parametrize("step", [1e-4, 1e-3])
@pytest.mark.parametrize("stiffness", [1e3, 1e5, 1e7])
@pytest.mark.parametrize("form", ["two stages", "free in the middle", "damped stages", "forty points"])
def test_a_shaft_turns_exactly_across_the_bends_of_its_table(form, stiffness, step):
    far = middle(stiffness)
    x, y = {
        "two stages": ([-1.0, 0.0, 1.0, 2.0], [-1.0, 0.0, 1.0, 2.5]),
        "damped stages": ([-1.0, 0.0, 1.0, 2.0], [-1.0, 0.0, 1.0, 2.5]),
        "free in the middle": ([-1.0, -0.3, 0.3, 1.0], [-0.7, 0.0, 0.0, 0.7]),
        "forty points": ((even := np.linspace(-3.0, 3.0, 40)), even + 0.1 * even**3),
    }[form]
    x, y = far * np.asarray(x), far * stiffness * np.asarray(y)
    damping = 0.05 * math.sqrt(stiffness / MOBILITY) if form == "damped stages" else 0.0
    r = run(two_bodies(table=(x, y), damping=damping), 0.03 if stiffness < 1e5 else 0.01, step, {"a": LOAD})
    truth = swings(x, y, damping, r.t)
    assert np.abs(r.twists[:, 0] - truth[:, 0]).max() < 1e-5 * np.abs(truth[:, 0]).max()
    assert np.abs(r.speed("a") - r.speed("b") - truth[:, 1]).max() < 1e-5 * np.abs(truth[:, 1]).max()
    assert np.abs(r.residual()).max() < 1e-9 * (np.abs(np.diff(r.e_in)).sum() + r.stored.max()) and r.capped == 0


@pytest.mark.campaign
def test_a_table_takes_at_most_three_times_as_long_as_its_straight_line():
    far, least = middle(1e4), [math.inf, math.inf]
    straight = two_bodies(stiffness=1e4)
    bent = two_bodies(table=(far * np.array([-1.0, 0.0, 1.0, 2.0]), 1e4 * far * np.array([-1.0, 0.0, 1.0, 2.5])))
    for _ in range(10):
        for k, system in enumerate((straight, bent)):
            one = Run(system, 1e-4, {"a": LOAD})
            one.to(0.01)
            since = time.thread_time()
            one.to(0.51)
            least[k] = min(least[k], time.thread_time() - since)
    assert least[1] < 3.0 * least[0]


def rig_of(folder, shaft):
    """Return a rig whose motor turns two bodies on a shaft."""
    text = f"description: two bodies\n{HEAD}bodies:\n  engine: {{inertia: [0.3 kg m2, x]}}\n  load: {{inertia: [0.05 kg m2, x]}}\n"
    text += f"shafts:\n  s: {{joins: [engine, load], {shaft}, damping: [0.1 Nm s/rad, x]}}\n"
    text += "inputs:\n  engine: [[[0 s, 100 Nm], [0.05 s, 100 Nm], [0.05 s, -50 Nm]], x]\n"
    folder.mkdir()
    (folder / "rig.yaml").write_text(text.replace(" x]", ' "assumed"]'))
    return Rig(load_rig(folder, {"effects.transducers": "off"}))


def table_of(points):
    """Return a table of points that hardens by a fifth at the ends of the swing, as a rig's description has it."""
    twists = middle(1e4) * np.linspace(-3.0, 3.0, points)
    torques = 1e4 * twists * (1.0 + 0.2 * (twists / twists[-1]) ** 2)
    return "table: [[" + ", ".join(f"[{x:.9g} rad, {y:.9g} Nm]" for x, y in zip(twists, torques)) + "], x]"


@pytest.mark.parametrize("points", [4, 100])
def test_a_rig_moves_a_shaft_with_a_table_as_a_run_does_in_quick_steps(tmp_path, points):
    rig = rig_of(tmp_path / "table", table_of(points))
    plan = plan_of(rig.config).plan
    alone, quick, missed = Run(plan.system, 1e-4, {name: (table.x, table.y) for name, table in plan.inputs.items()}), 0, 0.0
    for k in range(1, 151):
        rig.advance(0.001)
        quick += rig.world.line["made"][0] == 1.0
        missed = max(missed, np.abs(plan.system.bodies_from_speeds @ rig.v - alone.to(0.001 * k).speeds).max())
    assert missed < 1e-9 and quick >= 149
    assert rig.true("s.torque") == pytest.approx(alone.result().torque("s")[-1], abs=1e-7)
    assert abs(rig.energy()["residual"]) < 1e-9 * abs(alone.result().e_in).max()
