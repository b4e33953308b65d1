# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Large systems: clutches that share torque, chains of fifty bodies, several elements that lock and break away in one step."""

import math

import numpy as np
import pytest
from scipy.linalg import expm

from rig_nodes.driveline.builder import Driveline
from rig_nodes.driveline.run import run
from rig_nodes.driveline.vibration import modes


def closes(r):
    flowed = 1e-9 + np.abs(np.diff(r.e_in)).sum() + r.stored.max()
    return np.abs(r.residual()).max() < 1e-9 * flowed and r.capped == 0


def test_two_clutches_between_the_same_bodies_are_one_of_both_their_capacities():
    both, one = Driveline(), Driveline()
    for d in (both, one):
        d.inertia("a", 0.7, speed=90.0)
        d.inertia("b", 0.3)
        d.clutch("c", "a", "b")
    both.clutch("d", "a", "b")
    drive = {"a": ([0.0, 1.0, 2.0], [0.0, 0.0, 120.0]), "b": -3.0}
    r, whole = run(both.build(), 2.0, 1e-2, drive | {"c": 10.0, "d": 20.0}), run(one.build(), 2.0, 1e-2, drive | {"c": 30.0})
    assert r.speeds == pytest.approx(whole.speeds, abs=1e-9)
    assert r.torques.sum(axis=1) == pytest.approx(whole.torque("c"), abs=1e-8)
    assert np.abs(r.torque("c")).max() <= 10.0 + 1e-9 and np.abs(r.torque("d")).max() <= 20.0 + 1e-9
    times = {name: [e.t for e in r.events if e.element == name and e.t > 0.0] for name in "cd"}
    assert times["c"] == pytest.approx(times["d"])
    assert times["c"] == pytest.approx([e.t for e in whole.events if e.t > 0.0])
    assert closes(r) and "break" in [e.kind for e in r.events]


@pytest.mark.parametrize("kind", ["clutches", "shafts"])
def test_a_body_of_a_billionth_of_its_neighbours_inertia_acts_as_none_between_two_in_series(kind):
    """Two clutches in series act as the weaker one, two springs as one whose compliance is the sum of theirs."""
    series, one, inputs, other = Driveline(), Driveline(), {"a": lambda t: 20.0 * math.sin(5.0 * t)}, {}
    for d in (series, one):
        d.inertia("a", 0.7, speed=90.0)
        d.inertia("b", 0.3)
    series.inertia("between", 0.3e-9)
    if kind == "clutches":
        series.clutch("first", "a", "between")
        series.clutch("second", "between", "b")
        one.clutch("both", "a", "b")
        inputs |= {"first": ([0.0, 0.5, 0.5, 2.0], [40.0, 40.0, 15.0, 15.0]), "second": 30.0}
        other = {"both": ([0.0, 0.5, 0.5, 2.0], [30.0, 30.0, 15.0, 15.0])}
    else:
        series.shaft("first", "a", "between", stiffness=1000.0)
        series.shaft("second", "between", "b", stiffness=3000.0)
        one.shaft("both", "a", "b", stiffness=750.0)
    r = run(series.build(), 2.0, 1e-3, inputs)
    whole = run(one.build(), 2.0, 1e-3, {"a": inputs["a"], **other})
    assert r.speeds[:, :2] == pytest.approx(whole.speeds, abs=1e-6 * 90.0) and closes(r)


def test_three_clutches_in_a_ring_share_what_they_carry():
    d = Driveline()
    for name, j, speed in (("a", 0.5, 30.0), ("b", 0.4, 10.0), ("c", 0.3, -20.0)):
        d.inertia(name, j, speed=speed)
    for a, b in ("ab", "bc", "ac"):
        d.clutch(a + b, a, b, stick=1.1)
    r = run(d.build(), 2.0, 5e-3, {"ab": 8.0, "bc": 5.0, "ac": 6.0, "a": lambda t: 40.0 * math.sin(6.0 * t)})
    momentum = 0.5 * 30.0 + 0.4 * 10.0 - 0.3 * 20.0 + 40.0 / 6.0 * (1.0 - math.cos(12.0))
    assert r.speeds[-1] @ [0.5, 0.4, 0.3] == pytest.approx(momentum, abs=1e-2)
    assert closes(r) and np.any(np.all(np.abs(r.modes) >= 2, axis=1))


def chain(count, **clutch):
    d = Driveline()
    for i in range(count):
        d.inertia(f"J{i}", 0.1, speed=float(count - i))
    for i in range(count - 1):
        d.clutch(f"c{i}", f"J{i}", f"J{i + 1}", **clutch)
    return d.build()


def test_a_chain_of_fifty_bodies_locks_to_its_common_speed():
    r = run(chain(50, drag=0.01), 3.0, 1e-3, {f"c{i}": 30.0 + 0.1 * i for i in range(49)})
    assert r.speeds[-1] == pytest.approx([25.5] * 50, abs=1e-9) and np.all(np.abs(r.modes[-1]) >= 2)
    assert sorted(e.element for e in r.events if e.kind == "lock") == sorted(r.system.elements)
    locked = np.abs(r.modes) >= 2
    assert np.abs(r.slips[locked]).max() < 1e-10 and closes(r)


@pytest.mark.parametrize(("bodies", "weakest"), [(50, 20), (80, 1)])
def test_a_long_chain_breaks_away_at_its_weakest_clutch(bodies, weakest):
    system, weak = chain(bodies, stick=1.2), f"c{weakest}"
    inputs = {f"c{i}": 100.0 for i in range(bodies - 1)} | {weak: ([0.0, 1.0, 2.0], [100.0, 100.0, 0.0]), "J0": 6.0}
    r = run(system, 2.0, 1e-3, inputs)
    carried = 6.0 * (bodies - 1 - weakest) / bodies  # by what is behind the weakest clutch
    away = [e for e in r.events if e.kind == "break" and e.t > 1.0]
    assert [e.element for e in away] == [weak] and away[0].t == pytest.approx(2.0 - carried / 120.0, abs=1e-9)
    assert r.torque(weak)[np.searchsorted(r.t, 1.0)] == pytest.approx(carried, rel=1e-9) and closes(r)


def test_clutches_hold_bodies_whose_inertias_are_ten_decades_apart():
    """Two heavy bodies beside two light ones, and a row in which they alternate."""
    pairs, row = Driveline(), Driveline()
    for name, inertia in (("heavy", 1e4), ("light", 1e-6)):
        pairs.inertia(f"{name} 1", inertia)
        pairs.inertia(f"{name} 2", inertia)
        pairs.clutch(name, f"{name} 1", f"{name} 2")
    r = run(pairs.build(), 0.1, 1e-3, {"heavy": 1e5, "light": 10.0, "heavy 1": 1e4, "light 1": 1e-6})
    assert r.speeds[-1] == pytest.approx([0.05] * 4, rel=1e-9)
    for i, inertia in enumerate([1e5, 1e-5] * 3):
        row.inertia(f"J{i}", inertia)
    for i in range(5):
        row.clutch(f"c{i}", f"J{i}", f"J{i + 1}")
    r = run(row.build(), 0.1, 1e-3, {"J0": 1.0} | {f"c{i}": 10.0 for i in range(5)})
    assert r.speeds[-1] == pytest.approx([0.1 / 3e5] * 6, rel=1e-5)


def test_a_chain_of_fifty_bodies_on_shafts_runs_and_has_its_modes():
    d = Driveline()
    for i in range(50):
        d.inertia(f"J{i}", 0.1)
    for i in range(49):
        d.shaft(f"s{i}", f"J{i}", f"J{i + 1}", stiffness=1e5, damping=0.1)
    system = d.build()
    r = run(system, 1.0, 1e-3, {"J0": 10.0})
    assert r.speeds[-1] @ np.full(50, 0.1) == pytest.approx(10.0, rel=1e-10) and closes(r)
    assert len(modes(system).frequencies) == 50


@pytest.mark.parametrize("how", ["in a row", "in any order", "a clutch holds two", "a gear set holds three"])
def test_a_long_chain_on_shafts_turns_as_the_matrix_exponential_says(how):
    """Twenty-four bodies, two of them with oil between them; where nothing holds bodies together, the method is another one."""
    count, oil = 24, 0.2
    inertia = 0.05 + 0.01 * (np.arange(count) % 5)
    begin = np.where(np.arange(count) < 13, 2.0, -1.0)
    order = np.random.default_rng(5).permutation(count) if how == "in any order" else np.arange(count)
    d, shafts, free = Driveline(), [], np.eye(count)
    for i in order:
        d.inertia(f"b{i}", inertia[i], speed=begin[i])
    for i in range(count - 1):
        if i == 11 and how == "a clutch holds two":
            d.clutch("holds", "b11", "b12")
            free = np.delete(free, 12, axis=1)
            free[12, 11] = 1.0
        else:
            shafts.append((i, 2e4 * (1 + i % 3), 0.5))
            d.shaft(f"s{i}", f"b{i}", f"b{i + 1}", stiffness=shafts[-1][1], damping=0.5)
    d.clutch("oil", "b3", "b17", drag=oil)
    mass = np.diag(inertia)
    if how == "a gear set holds three":
        d.inertia("carrier", 0.3, speed=2.0)
        d.relation("set", {"carrier": 1.0, "b5": -0.4, "b9": -0.6})
        mass += 0.3 * np.outer(ends := 0.4 * np.eye(count)[5] + 0.6 * np.eye(count)[9], ends)
    rows = np.array([np.eye(count)[i] - np.eye(count)[i + 1] for i, *_ in shafts]) @ free
    rub = (np.eye(count)[3] - np.eye(count)[17]) @ free
    n, s = free.shape[1], len(shafts)
    minv, k, c = np.linalg.inv(free.T @ mass @ free), *np.array(shafts)[:, 1:].T
    rates = np.zeros((n + s + 1, n + s + 1))
    rates[:n, :n] = -minv @ (rows.T @ np.diag(c) @ rows + oil * np.outer(rub, rub))
    rates[:n, n:-1], rates[n:-1, :n] = -minv @ rows.T @ np.diag(k), rows
    rates[:n, -1] = 20.0 * minv @ free[0]
    truth = expm(rates * 0.05) @ np.concatenate([np.linalg.pinv(free) @ begin, np.zeros(s), [1.0]])
    r = run(d.build(), 0.05, 1e-3, {"b0": 20.0} | ({"holds": 1e6} if how == "a clutch holds two" else {}))
    for i in range(count):
        assert r.speed(f"b{i}")[-1] == pytest.approx(free[i] @ truth[:n], abs=2e-8)
    assert closes(r)


def test_a_shaft_with_bends_in_a_long_chain_turns_alike_in_steps_of_any_length():
    def end(step):
        d = Driveline()
        for i in range(20):
            d.inertia(f"b{i}", 0.1, speed=5.0 * (i < 10))
        for i in range(19):
            spring = {"table": ([-0.01, 0.01, 0.02], [-50.0, 50.0, 250.0])} if i == 9 else {"stiffness": 1e4}
            d.shaft(f"s{i}", f"b{i}", f"b{i + 1}", damping=0.3, **spring)
        r = run(d.build(), 0.1, step)
        assert closes(r)
        return r.speeds[-1]

    assert end(1e-3) == pytest.approx(end(2e-5), abs=1e-7)


@pytest.mark.parametrize("step", [0.5, 1e-3])
def test_elements_lock_break_away_and_lock_again_within_one_step(step):
    """Each of four pairs slips, locks, breaks away while a torque drives it, and locks again, at the times of its closed form."""
    d, inputs = Driveline(), {}
    drive = ([0.0, 0.2, 0.2, 0.3, 0.3, 1.0], [0.0, 0.0, 90.0, 90.0, 0.0, 0.0])
    for k in range(4):
        d.inertia(f"a{k}", 0.5, speed=10.0 + k)
        d.inertia(f"b{k}", 0.5)
        d.clutch(f"c{k}", f"a{k}", f"b{k}")
        inputs |= {f"c{k}": 30.0, f"a{k}": drive}
    r = run(d.build(), 1.0, step, inputs)
    for k in range(4):
        times = [(e.kind, e.t) for e in r.events if e.element == f"c{k}" and e.t > 0.0]
        # slip falls by 120 rad/s2, and grows by 60 while the drive is on
        assert [kind for kind, _ in times] == ["lock", "break", "lock"]
        assert [t for _, t in times] == pytest.approx([(10.0 + k) / 120.0, 0.2, 0.3 + 6.0 / 120.0], abs=1e-12)
    assert closes(r)


def test_a_hundred_clutches_in_a_row_bring_all_bodies_to_one_speed():
    d = Driveline()
    for i in range(101):
        d.inertia(f"b{i}", 1.0, speed=100.0 * (i == 0))
    for i in range(100):
        d.clutch(f"c{i}", f"b{i}", f"b{i + 1}", stick=1.2)
    r = run(d.build(), 2.0, 1e-2, {f"c{i}": 50.0 - 0.2 * i for i in range(100)})
    assert r.speeds[-1] == pytest.approx(100.0 / 101.0) and sum(e.kind == "lock" for e in r.events) >= 100
    assert r.speeds.sum(axis=1) == pytest.approx(100.0) and closes(r)


def test_thirty_meshes_in_a_row_each_take_their_share():
    """The bodies gain a together, and each mesh passes on 98 % of what arrives: 100 Nm = a (1 + 1 / 0.98 + 1 / 0.98^2 + ...)."""
    d = Driveline()
    for i in range(31):
        d.inertia(f"b{i}", 1.0, speed=10.0)
    for i in range(30):
        d.mesh(f"m{i}", f"b{i}", f"b{i + 1}", 1.0, 0.98)
    r = run(d.build(), 0.5, 1e-2, {"b0": 100.0})
    assert r.speeds[-1] == pytest.approx(10.0 + 0.5 * 100.0 / sum(0.98**-i for i in range(31)), rel=1e-8) and closes(r)
