# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A mesh with efficiency, compared with closed forms: the output power is the input power times the efficiency.

The Modelica Standard Library's LossyGear does the same (Pelchen, Schweiger, Otter: Modeling and simulating the efficiency
of gearboxes, 2002).
"""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rig_nodes.base.errors import RigError
from rig_nodes.driveline.builder import Driveline
from rig_nodes.driveline.run import run
from rig_nodes.driveline.vibration import modes

JA, JB, R = 0.5, 3.0, 4.0
EFFICIENCIES = [0.95, 0.5, 0.4, 0.3]


def pair(efficiency, back=None, speed=0.0, ratio=R):
    d = Driveline()
    d.inertia("a", JA, speed=ratio * speed)
    d.inertia("b", JB)
    d.mesh("m", "a", "b", ratio, efficiency, back)
    return d.build()


def gain(at_a, at_b, passes):
    """Returns the acceleration of b, where b gets the share `passes` of a's torque times the ratio."""
    return (at_b + passes * R * at_a) / (JB + passes * R**2 * JA)


def closes(r):
    flowed = 1e-9 + np.abs(np.diff(r.e_in)).sum() + r.stored.max()
    return np.abs(r.residual()).max() < 1e-9 * flowed and r.capped == 0


@pytest.mark.parametrize("efficiency", EFFICIENCIES)
@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize("drives", ["a", "b"])
def test_the_efficiency_is_exact_in_all_four_quadrants(efficiency, direction, drives):
    at_a, at_b = (20.0, -3.0) if drives == "a" else (-20.0, 30.0)
    r = run(pair(efficiency, speed=10.0 * direction), 0.2, 1e-3, {"a": at_a * direction, "b": at_b * direction})
    exact = gain(at_a, at_b, efficiency if drives == "a" else 1.0 / efficiency) * direction
    assert r.speed("b") == pytest.approx(10.0 * direction + exact * r.t, rel=1e-8)
    assert r.speed("a") == pytest.approx(R * r.speed("b"), rel=1e-12)
    into, out = JA * R * exact - at_a * direction, JB * exact - at_b * direction
    assert r.torque("m", "a") == pytest.approx(into, rel=1e-7) and r.torque("m", "b") == pytest.approx(out, rel=1e-7)
    assert (into * direction < 0.0) == (drives == "a")
    comes = r.torque("m", drives)[-1] * (r.angle(drives)[-1])
    goes = r.torque("m", "b" if drives == "a" else "a")[-1] * r.angle("b" if drives == "a" else "a")[-1]
    assert goes == pytest.approx(-efficiency * comes, rel=1e-7)
    assert r.e_fric[-1].sum() == pytest.approx(-comes - goes, rel=1e-7) and closes(r)


@pytest.mark.parametrize("efficiency", EFFICIENCIES)
def test_a_loaded_mesh_sticks_between_the_torques_of_its_two_directions(efficiency):
    """Under a load at b it breaks away forwards at load / (R efficiency) at a, and backwards at load * efficiency / R."""
    load, upper = 30.0, 30.0 / (R * efficiency)
    r = run(pair(efficiency), 4.0, 1e-2, {"b": -load, "a": ([0.0, 2.0, 4.0], [load / R, load / R + 2.0 * upper, 0.0])})
    moves = [e for e in r.events if e.t > 0.0]
    starts = 2.0 * (upper - load / R) / (2.0 * upper)
    assert moves[0].kind == "break" and moves[0].t == pytest.approx(starts, abs=1e-7)
    assert np.abs(r.speeds[r.t < starts]).max() < 1e-20 and r.speed("b")[np.searchsorted(r.t, 2.0)] > 0.1
    down = run(pair(efficiency), 2.0, 1e-2, {"b": -load, "a": ([0.0, 2.0], [load / R, 0.0])})
    assert [e.kind for e in down.events] == ["lock", "break"] and down.speed("b")[-1] < 0.0
    assert down.events[1].t == pytest.approx(2.0 * (1.0 - efficiency), abs=1e-7) and closes(r) and closes(down)


@pytest.mark.parametrize("efficiency, back", [(0.4, 0.0), (0.4, -0.5), (0.4, 2 - 1 / 0.4), (0.3, 2 - 1 / 0.3)])
def test_a_self_locking_mesh_holds_its_load_until_it_is_driven_down(efficiency, back):
    load = 60.0
    system = pair(efficiency, back)
    held = run(system, 5.0, 1e-2, {"b": lambda t: -load * (1.0 + 0.9 * math.sin(7.0 * t))})
    assert np.abs(held.speeds).max() < 1e-20 and held.torque("m", "b")[-1] == pytest.approx(load * (1.0 + 0.9 * math.sin(35.0)))
    down = run(system, 2.0, 1e-2, {"b": -load, "a": ([0.0, 2.0], [0.0, -30.0])})
    needs = -back * load / R
    if back < 0.0:
        assert [e.kind for e in down.events] == ["lock", "break"] and down.events[1].t == pytest.approx(needs / 15.0, abs=1e-6)
    assert down.speed("b")[-1] < 0.0 and closes(down)


def light_worm_behind_a_clutch():
    """Returns a self-locking mesh that its heavy wheel b drives, with a further wheel behind a clutch."""
    d = Driveline()
    d.inertia("a", 0.001, speed=10.0)
    d.inertia("b", 1.0)
    d.inertia("c", 1.0, speed=10.0)
    d.mesh("m", "a", "b", 1.0, 0.5, -0.5)
    d.clutch("c1", "b", "c")
    return d


@pytest.mark.parametrize("step", [0.05, 2e-3])
def test_a_self_locking_mesh_jams_at_once_when_a_heavy_wheel_drives_it_at_speed(step):
    """With J_a < -back J_b R^2 no torque of the teeth slows both sides down, so that an impulse stops them."""
    d = light_worm_behind_a_clutch()
    r = run(d.build(), 0.5, step, {"b": 5.0, "c1": 3.0})
    assert r.capped == 0 and [(e.element, e.kind) for e in r.events if e.element == "m loss"][-1] == ("m loss", "lock")
    assert np.abs(r.speeds[1:, :2]).max() < 1e-20 and np.abs(r.residual()).max() < 1e-12 * r.stored[0]
    # the clutch transmits its torque but no impulse, so that the wheel behind it slows down evenly
    assert np.interp(0.2, r.t, r.speed("c")) == pytest.approx(10.0 - 3.0 * 0.2, rel=1e-6)
    losses = r.e_fric.sum(axis=1)
    assert losses[1] == pytest.approx(0.5 * 1.001 * 100.0, rel=0.05) and np.diff(losses).min() >= 0.0


def test_a_load_that_turns_round_jams_the_mesh_when_it_begins_to_drive():
    d = Driveline()
    d.inertia("a", 0.001, speed=10.0)
    d.inertia("b", 1.0)
    d.inertia("c", 1.0)
    d.mesh("m", "a", "b", 1.0, 0.5, -0.5)
    d.shaft("s", "b", "c", stiffness=1000.0, damping=1.0)
    r = run(d.build(), 0.5, 2e-3, {"b": 5.0})
    (jam,) = (e.t for e in r.events if e.kind == "lock")
    before, after = np.searchsorted(r.t, jam) - 1, np.searchsorted(r.t, jam)
    assert r.capped == 0 and r.torque("m loss")[before] > 0.0 and r.speed("a")[before] > 0.3
    assert np.abs(r.speed("a")[after:]).max() < 1e-20 and np.abs(r.residual()).max() < 1e-12 * r.stored[0]


@pytest.mark.parametrize("step", [0.05, 2e-3])
def test_a_mesh_jams_beside_a_motion_that_does_not_prescribe_its_speed(step):
    d = light_worm_behind_a_clutch()
    d.motion("held", "c")
    r = run(d.build(), 0.5, step, {"b": 5.0, "c1": 3.0, "held": lambda t: 10.0 + 20.0 * t})
    assert r.capped == 0 and [e.kind for e in r.events if e.element == "m loss"] == ["close", "lock"]
    assert np.abs(r.speeds[1:, :2]).max() < 1e-20 and closes(r)
    assert r.torque("held")[1:] == pytest.approx(20.0 + 3.0) and r.speed("c")[-1] == pytest.approx(20.0)


@pytest.mark.parametrize("step", [0.05, 2e-3])
def test_a_motion_bears_its_share_of_the_impulse_that_stops_a_mesh(step):
    """It holds the speed of c while a = c + e stops: the impulse on c is that on e, J_e times 10 rad/s."""
    d = Driveline()
    d.inertia("a", 0.001, speed=10.0)
    d.inertia("b", 1.0)
    d.inertia("c", 0.5, speed=4.0)
    d.inertia("e", 0.002)
    d.mesh("m", "a", "b", 1.0, 0.5, -0.5)
    d.relation("sum", {"a": 1.0, "c": -1.0, "e": -1.0})
    d.motion("held", "c")
    r = run(d.build(), 0.5, step, {"b": 5.0, "held": lambda t: 4.0 - 30.0 * t})
    impulse, torque = 0.002 * 10.0, -30.0 * (0.5 + 0.002)
    assert r.capped == 0 and np.abs(r.speeds[1:, :2]).max() < 1e-20 and closes(r)
    assert r.speed("e")[1:] == pytest.approx(-r.speed("c")[1:])
    assert r.torque("held")[1:3] == pytest.approx([torque + impulse / step, torque])
    assert r.e_in[1] == pytest.approx(4.0 * impulse + torque * (4.0 * step - 15.0 * step**2))


def test_a_mesh_that_breaks_away_takes_the_loss_that_lasts():
    """With a set across the mesh two losses satisfy the equations; at the greater one a small disturbance would grow."""
    efficiency, back, ratio, set_ratio, j_a, j_b, j_c = 0.4, 0.3, 0.7, 2.8, 0.1, 2.0, 3.0
    d = Driveline()
    d.inertia("a", j_a)
    d.inertia("b", j_b)
    d.inertia("c", j_c)
    d.mesh("m", "a", "b", ratio, efficiency, back)
    d.relation("set", {"c": 1.0, "b": set_ratio, "a": -1.0 - set_ratio})
    at_a, at_b = -60.0, lambda t: 100.0 + 100.0 * t
    r = run(d.build(), 1.0, 2e-3, {"a": at_a, "b": at_b})
    (begun,) = (e.t for e in r.events if e.kind == "break")
    assert at_b(begun) * back == pytest.approx(-at_a * ratio) and closes(r)
    # in motion a drives by its inertia, although b overcame the load at a:
    # J_b b' - s J_c c' = T_b + ratio efficiency (T_a - J_a a' - (1 + s) J_c c')
    c = (1.0 + set_ratio) * ratio - set_ratio
    passed = ratio * efficiency
    inertia = j_b - set_ratio * j_c * c + passed * (j_a * ratio + (1.0 + set_ratio) * j_c * c)
    mean = at_b(0.5 * (1.0 + begun)) + passed * at_a
    assert r.speed("b")[-1] == pytest.approx(mean / inertia * (1.0 - begun), rel=1e-6)


@pytest.mark.parametrize("efficiency, back, body, words", [(0.5, -0.5, "b", "lock themselves"), (0.5, 0.0, "b", "'m'")])
def test_refuses_a_motion_against_a_mesh_that_locks_itself(efficiency, back, body, words):
    d = Driveline()
    d.inertia("a", 0.5)
    d.inertia("b", 1.0)
    d.mesh("m", "a", "b", 4.0, efficiency, back)
    d.motion("held", body)
    with pytest.raises(RigError, match=words):
        d.build()


@pytest.mark.parametrize("efficiency, back, body", [(0.5, -0.5, "a"), (0.5, 0.1, "b"), (1.0, 0.7, "b"), (0.7, 1.0, "a")])
def test_a_motion_moves_a_mesh_that_lets_power_through(efficiency, back, body):
    d = Driveline()
    d.inertia("a", 0.5)
    d.inertia("b", 1.0)
    d.mesh("m", "a", "b", 4.0, efficiency, back)
    d.motion("moved", body)
    r = run(d.build(), 1.0, 1e-2, {"moved": lambda t: 2.0 * t})
    assert r.speed(body)[-1] == pytest.approx(2.0) and closes(r)


@pytest.mark.parametrize("sun, holds", [(0.45, True), (0.95, False)])
def test_refuses_a_motion_against_a_loop_of_meshes_whose_power_goes_round(sun, holds):
    """Of the power that circulates through a set and the mesh, the mesh would lose more than is supplied from outside."""
    d = Driveline()
    for name in ("a", "b", "c"):
        d.inertia(name, 1.0)
    d.relation("sum", {"c": 2.0, "a": -1.0, "b": 2.0})
    d.mesh("m", "b", "a", 0.7, sun)
    d.motion("moved", "c")
    if holds:
        with pytest.raises(RigError, match="lock themselves"):
            d.build()
    else:
        r = run(d.build(), 1.0, 1e-2, {"moved": lambda t: 2.0 * t})
        assert r.speed("a")[-1] == pytest.approx(-10.0) and closes(r)


@pytest.mark.parametrize("efficiency", EFFICIENCIES)
@pytest.mark.parametrize("step", [0.05, 1e-3])
def test_reversing_under_a_steady_torque_has_its_events_where_the_closed_form_has_them(efficiency, step):
    """While the mesh turns forwards, b drives it and a slows it down. It reverses without sticking; then a drives it backwards."""
    at_a, at_b, speed = -20.0, 3.0, 5.0
    r = run(pair(efficiency, speed=speed), 3.0, step, {"a": at_a, "b": at_b})
    slows = gain(at_a, at_b, 1.0 / efficiency)
    turns = -speed / slows
    assert [(e.element, e.kind) for e in r.events if e.t > 0.0] == [("m loss", "cross")]
    assert r.events[-1].t == pytest.approx(turns, rel=1e-7)
    assert r.speed("b")[-1] == pytest.approx(gain(at_a, at_b, efficiency) * (3.0 - turns), rel=1e-7) and closes(r)


@pytest.mark.parametrize("efficiency", EFFICIENCIES)
def test_a_torque_that_swings_through_0_while_the_mesh_turns_against_scipy(efficiency):
    inputs = {"a": lambda t: 30.0 * math.sin(5.0 * t), "b": lambda t: 10.0 * math.cos(3.0 * t)}
    r = run(pair(efficiency, 0.8 * efficiency, speed=60.0), 2.0, 1e-3, inputs)

    def rate(t, y):
        at_a, at_b = inputs["a"](t), inputs["b"](t)
        forwards = gain(at_a, at_b, efficiency)
        return [forwards if at_a - JA * R * forwards > 0.0 else gain(at_a, at_b, 1.0 / (0.8 * efficiency))]

    truth = solve_ivp(rate, (0.0, 2.0), [60.0], rtol=1e-10, atol=1e-10, max_step=1e-3)
    assert r.speed("b").min() > 1.0 and r.speed("b")[-1] == pytest.approx(truth.y[0, -1], abs=1e-4)
    assert np.sum(np.diff(np.sign(r.torque("m", "a"))) != 0) >= 3 and closes(r)


def test_two_meshes_in_a_row_behind_a_clutch_and_a_shaft():
    """At steady speed the load gets the product of both efficiencies."""
    d = Driveline()
    for name, j in (("motor", 0.2), ("input", 0.1), ("middle", 0.1), ("output", 0.3), ("load", 4.0)):
        d.inertia(name, j)
    d.clutch("c", "motor", "input")
    d.mesh("first", "input", "middle", 3.0, 0.9)
    d.mesh("second", "middle", "output", -2.0, 0.8)
    d.shaft("shaft", "output", "load", stiffness=2000.0, damping=20.0)
    d.torque("fan", "load", table=([-100.0, 100.0], [300.0, -300.0]))
    r = run(d.build(), 80.0, 1e-2, {"motor": 20.0, "c": ([0.0, 1.0], [0.0, 60.0])})
    steady = -20.0 * 3.0 * 2.0 * 0.9 * 0.8
    assert r.torque("shaft")[-1] == pytest.approx(steady, rel=1e-4)
    assert r.torque("fan")[-1] == pytest.approx(-steady, rel=1e-4)
    assert r.torque("second", "output")[-1] == pytest.approx(steady, rel=1e-4)
    lost = r.e_fric[-1, r.system.elements.index("second loss")] / (r.e_fric[-1, r.system.elements.index("first loss")])
    assert lost == pytest.approx(0.9 * 0.2 / 0.1, rel=0.02) and closes(r)


def test_a_mesh_without_loss_is_a_gear():
    d = Driveline()
    d.inertia("a", JA)
    d.inertia("b", JB)
    d.gear("a", "b", R)
    one, other = (run(s, 1.0, 1e-2, {"a": lambda t: 9.0 * math.sin(8.0 * t), "b": 5.0}) for s in (d.build(), pair(1.0)))
    assert other.speeds == pytest.approx(one.speeds, abs=1e-6)
    assert other.torque("m", "b") == pytest.approx(one.torque("a-b", "b"), abs=1e-6)


def test_a_mesh_joins_two_bodies_for_the_modes_and_at_the_start():
    d = Driveline()
    d.inertia("a", JA)
    d.inertia("b", JB, speed=2.0)
    d.inertia("c", 1.0)
    d.mesh("m", "a", "b", R, 0.5)
    d.shaft("s", "b", "c", stiffness=700.0)
    system = d.build()
    natural = math.sqrt(700.0 * (1.0 + 1.0 / (JB + R**2 * JA)))
    assert modes(system).frequencies * 2 * math.pi == pytest.approx([0.0, natural], rel=1e-9, abs=1e-9)
    assert run(system, 0.1, 1e-3).speeds[0] == pytest.approx([2.0 * R, 2.0, 0.0])


@pytest.mark.parametrize(
    "arguments, words",
    [
        (("m", "a", "x", 2.0, 0.9), "mesh 'm' names the body 'x', which does not exist"),
        (("m", "a", "ground", 2.0, 0.9), "mesh 'm' names the ground"),
        (("m", "a", "a", 2.0, 0.9), "joins 'a' with itself"),
        (("m", "a", "b", 0.0, 0.9), "ratio of mesh 'm' is 0.0"),
        (("m", "a", "b", 2.0, 0.0), "efficiency of mesh 'm' is 0.0"),
        (("m", "a", "b", 2.0, 1.1), "efficiency of mesh 'm' is 1.1"),
        (("m", "a", "b", 2.0, 0.9, 1.5), "from b back to a is 1.5"),
    ],
)
def test_refuses_in_one_sentence(arguments, words):
    d = Driveline()
    d.inertia("a", 1.0)
    d.inertia("b", 1.0)
    with pytest.raises(RigError, match=words) as refusal:
        d.mesh(*arguments)
    assert refusal.value.exit_code == 2 and "\n" not in str(refusal.value)


def test_the_loss_of_a_mesh_is_no_input():
    with pytest.raises(RigError, match="no input 'm loss'; inputs are: a, b"):
        run(pair(0.9), 1.0, 0.1, {"m loss": 3.0})


@pytest.mark.parametrize("jump", [8.0, 5.0 + 1e-13])
def test_a_torque_that_jumps_finds_the_loss_with_all_torques_that_follow_the_motion(jump):
    """A weight has the same effect as an input and as a table: the loss immediately after a jump includes it."""
    speeds = []
    for law in (False, True):
        d = Driveline()
        d.inertia("a", 0.05)
        d.inertia("b", 2.0)
        d.mesh("worm", "a", "b", 20.0, 0.6, -0.2)
        inputs = {"a": ([0.0, 0.1, 0.1, 0.2], [0.0, 5.0, jump, jump])}
        if law:
            d.torque("weight", "b", table=([0.0], [-30.0]))
        else:
            inputs["b"] = -30.0
        speeds.append(run(d.build(), 0.2, 1e-4, inputs).speed("a"))
    assert speeds[0][-1] > 1.0 and abs(speeds[1] - speeds[0]).max() < 1e-9
