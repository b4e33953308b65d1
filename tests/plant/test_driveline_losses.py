# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Any number of losses by torque; and the short calculation of a step without events, compared with the full one."""

import numpy as np
import pytest
from numba import njit

from rig_nodes.driveline.algebra import (
    E_FRIC,
    E_SHAFT,
    E_VISC,
    HI0,
    HI1,
    KIN0,
    KIN1,
    LAM,
    LO0,
    LO1,
    LOCKED_HIGH,
    N_CAPPED,
    OPEN,
    STUCK,
    VISC,
)
from rig_nodes.driveline.builder import Driveline
from rig_nodes.driveline.kernel import driveline_step
from rig_nodes.driveline.losses import BASE, CONSTANT, FACTOR, ON, OWN, SHARE, SQUARE, WAY, WEIGHTS, loss_width
from rig_nodes.driveline.quiet import quiet_step
from rig_nodes.driveline.quiet_shafts import quiet_shafts_step
from rig_nodes.driveline.state import Loads, State, Structure
from rig_nodes.plant.engine.world import Sizes, driveline_dtype

J = (0.4, 0.3, 0.2, 1.5)
STEP_S = 1e-3
LOSSES = ((0.5, 0.02, 1e-4), (0.0, 0.03, 0.0), (0.2, 0.05, -1e-5))  # parabolas over the torque of a clutch


@njit
def _quiet(h, lines):
    return quiet_step(h, lines[0])


@njit
def _quiet_shafts(h, lines):
    return quiet_shafts_step(h, lines[0])


def record_of(system, losses=np.zeros((0, 0))):
    """Returns the driveline's record of a system, with all clutches closed at 500 Nm."""
    owned = tuple(int(row[OWN]) for row in losses)
    lines = np.zeros(
        1,
        driveline_dtype(
            Sizes(
                speeds=len(system.speeds), elements=len(system.elements), shafts=len(system.shafts), losses=len(losses), owned=owned
            )
        ),
    )
    line, start = lines[0], system.state()
    for name in ("minv", "w", "sh", "kc"):
        line[name] = getattr(system, name)
    line["v"], line["twist"], line["mode"], line["cap"] = start.v, start.twist, start.mode, system.limits()
    line["loss"] = losses.reshape(line["loss"].shape)
    for f in range(len(system.elements)):
        if f not in owned:
            close(line, f, 500.0)
    return lines


def close(line, f, torque):
    line["cap"][[KIN0, KIN1, HI0, HI1], f], line["cap"][[LO0, LO1], f] = torque, -torque


def step(lines, t=0.0, h=STEP_S):
    structure, loads, state = (of(*(lines[0][name] for name in of._fields)) for of in (Structure, Loads, State))
    driveline_step(h, t, structure, loads, lines[0]["loss"], state)


def chain(count):
    """Returns four bodies in a row, clutches between them, and `count` losses whose elements are in mixed order."""
    d = Driveline()
    for name, j in zip("abcd", J):
        d.inertia(name, j, speed=50.0)
    for name, a, b in (
        ("loss0", "b", None),
        ("ab", "a", "b"),
        ("loss2", "d", None),
        ("bc", "b", "c"),
        ("loss1", "c", None),
        ("cd", "c", "d"),
    ):
        if b:
            d.clutch(name, a, b)
        elif int(name[-1]) < count:
            d.brake(name, a)
    system = d.build()
    losses = np.zeros((count, loss_width(4, len(system.elements))))
    for k, clutch in enumerate(("ab", "bc", "cd")[:count]):
        losses[k, [CONSTANT, SHARE, SQUARE]] = LOSSES[k]
        losses[k, OWN] = losses[k, ON] = system.elements.index(f"loss{k}")
        losses[k, FACTOR], losses[k, WAY], losses[k, BASE] = 1.0, 0, 1e-9
        losses[k, WEIGHTS + system.elements.index(clutch)] = 1.0
    return system, losses


@pytest.mark.parametrize("count", [1, 2, 3])
@pytest.mark.parametrize("drive", [80.0, -60.0])
def test_losses_in_a_row_of_gears_take_their_parabolas_of_what_each_passes_on(count, drive):
    system, losses = chain(count)
    lines = record_of(system, losses)
    line = lines[0]
    line["q"][:] = drive * system.bodies_from_speeds[0]
    before = 50.0
    for i in range(5):
        before = line["v"][0]
        step(lines, i * STEP_S)
    gain = (line["v"][0] - before) / STEP_S
    assert line["v"] == pytest.approx([line["v"][0]] * 4, rel=1e-13) and line["count"][N_CAPPED] == 0
    passed = drive - J[0] * gain
    for k, clutch in enumerate(("ab", "bc", "cd")):
        assert line["el"][LAM, system.elements.index(clutch)] == pytest.approx(passed, rel=1e-7)
        if k < count:
            constant, share, square = LOSSES[k]
            lost = constant + share * abs(passed) + square * passed**2
            assert line["cap"][KIN1, system.elements.index(f"loss{k}")] == pytest.approx(lost, rel=1e-6)
            passed -= lost
        passed -= J[k + 1] * gain
    assert passed == pytest.approx(0.0, abs=1e-5)


def test_a_loss_may_brake_the_element_that_another_one_owns():
    system, losses = chain(2)
    losses[1, ON] = losses[0, OWN]
    lines = record_of(system, losses)
    line = lines[0]
    line["q"][:] = 80.0 * system.bodies_from_speeds[0]
    step(lines)
    ab, bc = (line["el"][LAM, system.elements.index(name)] for name in ("ab", "bc"))
    both = sum(c + s * t + q * t * t for (c, s, q), t in zip(LOSSES, (ab, bc)))
    assert line["cap"][KIN1, system.elements.index("loss0")] == pytest.approx(both, rel=1e-6)
    assert line["cap"][KIN1, system.elements.index("loss1")] == pytest.approx(1e-9)


def test_the_short_way_of_a_quiet_step_is_the_whole_one():
    """Both calculate 400 steps of a driveline with three speeds, drag, and slipping beside locked elements."""
    d = Driveline()
    d.inertia("sun", 0.2, speed=120.0)
    d.inertia("ring", 0.0)
    d.inertia("carrier", 0.5, speed=40.0)
    d.inertia("wheel", 3.0, speed=40.0)
    d.planetary("set", "sun", "ring", "carrier", 2.0)
    d.clutch("slipping", "sun", "carrier", drag=0.01)
    d.brake("held", "ring")
    d.brake("load", "wheel", drag=0.02)
    d.clutch("joint", "carrier", "wheel")
    system = d.build()
    one, other = record_of(system), record_of(system)
    short = 0
    for lines in (one, other):
        line = lines[0]
        close(line, 0, 20.0)
        close(line, 2, 15.0)
        close(line, 3, 500.0)
        line["cap"][VISC] = system.drag
        for i in range(400):
            line["q"][0] = 30.0 * system.bodies_from_speeds[0] * np.sin(0.02 * i)
            line["q"][1] = 30.0 * system.bodies_from_speeds[0] * np.sin(0.02 * (i + 1))
            if lines is one and _quiet(STEP_S, lines):
                short += 1
            else:
                step(lines, i * STEP_S)
    assert short > 350 and (one[0]["mode"] != OPEN).all()
    for name in ("v", "el", "e_in"):
        assert one[0][name] == pytest.approx(other[0][name], rel=1e-10, abs=1e-10), name
    assert np.array_equal(one[0]["mode"], other[0]["mode"])


def test_the_short_way_with_shafts_is_the_whole_one_and_keeps_the_energy():
    """Both move two damped shafts with a loss by torque and drag that grows in each step, slipping at first and locked later."""
    d = Driveline()
    for name, inertia, speed in (("rotor", 0.6, 150.0), ("input", 0.05, 150.0), ("output", 0.2, 100.0), ("pump", 0.4, 100.0)):
        d.inertia(name, inertia, speed=speed)
    d.shaft("front", "rotor", "input", stiffness=5000.0, damping=5.0)
    d.shaft("rear", "output", "pump", stiffness=20000.0)
    d.clutch("main", "input", "output", drag=0.002)
    d.brake("mesh", "input")
    system = d.build()
    main, mesh = (system.elements.index(name) for name in ("main", "mesh"))
    losses = np.zeros((1, loss_width(len(system.speeds), 2)))
    losses[0, [CONSTANT, SHARE, BASE, FACTOR]] = 0.5, 0.03, 1e-9, 1.0
    losses[0, [OWN, ON, WAY]] = mesh, mesh, 0
    losses[0, WEIGHTS + main] = 1.0
    one, other = record_of(system, losses), record_of(system, losses)
    drive, load = (system.bodies_from_speeds[system.bodies.index(name)] for name in ("rotor", "pump"))
    started, short = 0.5 * one[0]["v"] @ np.linalg.inv(system.minv) @ one[0]["v"], 0
    for i in range(4000):
        for lines in (one, other):
            line = lines[0]
            close(line, main, 200.0)
            line["cap"][VISC, main] = 0.002 + 1e-9 * i
            for end in range(2):
                line["q"][end] = 40.0 * drive - (35.0 + 5.0 * np.sin(0.01 * (i + end))) * load
        if _quiet_shafts(1e-4, one):
            short += 1
        else:
            step(one, 1e-4 * i, 1e-4)
        step(other, 1e-4 * i, 1e-4)
        assert np.array_equal(one[0]["mode"], other[0]["mode"])
    assert short > 3500 and one[0]["mode"][main] == STUCK
    for name in ("v", "twist", "el", "e_in", "shaft"):  # the short way leaves an error of PREDICTED in a loss
        assert one[0][name] == pytest.approx(other[0][name], rel=5e-5, abs=1e-6), name
    line = one[0]
    kept = 0.5 * line["v"] @ np.linalg.inv(system.minv) @ line["v"] + 0.5 * line["kc"][0] @ line["twist"] ** 2 - started
    lost = line["el"][[E_FRIC, E_VISC]].sum() + line["shaft"][E_SHAFT].sum()
    assert kept + lost == pytest.approx(line["e_in"].sum(), abs=1e-9 * abs(lost))


def test_the_short_way_holds_a_shaft_whose_brakes_share_a_load_above_the_limit_of_one():
    """Two brakes on a shaft and one behind a gear of 2, with limits of 4, 30 and 5 Nm, have the same torques in both ways."""
    d = Driveline()
    d.inertia("shaft", 0.4)
    d.inertia("wheel", 0.3)
    d.gear("shaft", "wheel", 2.0)
    for name, body in (("weak", "shaft"), ("strong", "shaft"), ("geared", "wheel")):
        d.brake(name, body)
    system = d.build()
    one, other = record_of(system), record_of(system)
    shared = 0
    for lines in (one, other):
        for f, limit in enumerate((4.0, 30.0, 5.0)):
            close(lines[0], f, limit)
    for i in range(400):
        for lines in (one, other):
            lines[0]["q"][:] = 20.0 * np.outer(np.sin(0.02 * np.array([i, i + 1])), system.bodies_from_speeds[0])
        if _quiet(STEP_S, one):
            shared += bool((abs(one[0]["mode"]) == LOCKED_HIGH).any())
        else:
            step(one, i * STEP_S)
        step(other, i * STEP_S)
        assert np.array_equal(one[0]["mode"], other[0]["mode"])
        assert one[0]["el"] == pytest.approx(other[0]["el"], rel=1e-12, abs=1e-12)
        weak, strong, geared = one[0]["el"][LAM]
        assert weak + strong + 0.5 * geared == pytest.approx(20.0 * np.sin(0.02 * (i + 1)), abs=1e-12)
        assert abs(weak) < 4.0 + 1e-12 and (abs(strong) == pytest.approx(abs(weak)) or abs(weak) > 3.9)
    assert shared > 250 and not one[0]["v"].any()
