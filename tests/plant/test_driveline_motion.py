# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Prescribed motion together with clutches, brakes, sets and varying inertias, against closed forms."""

import math

import numpy as np
import pytest

from rig_nodes.base.errors import RigError
from rig_nodes.driveline.builder import Driveline
from rig_nodes.driveline.run import run


def closes(r):
    flowed = 1e-9 + np.abs(np.diff(r.e_in)).sum() + r.stored.max()
    return np.abs(r.residual()).max() < 1e-9 * flowed and r.capped == 0


def shaken(*moved, **j):
    d = Driveline()
    for name, inertia in j.items():
        d.inertia(name, inertia)
    for name in moved or ("a",):
        d.motion("m" if name == "a" else f"m{name}", name)
    return d


def sine(t):
    return 10.0 * math.sin(6.0 * t)


def test_a_clutch_breaks_away_when_the_acceleration_asks_more_than_it_holds():
    """It carries 0.5 * 60 |cos 6t| Nm, up to 1.2 * 20 Nm: after its lock-up it first breaks away at (pi - acos 0.8) / 6 s."""
    exact = (math.pi - math.acos(0.8)) / 6.0
    for step in (1e-2, 5e-3, 2.5e-3, 1e-3, 1e-4):
        d = shaken(a=1.0, b=0.5)
        d.clutch("k", "a", "b", stick=1.2)
        r = run(d.build(), 0.96, step, {"m": sine, "k": 20.0})
        assert [e.kind for e in r.events] == ["close", "lock", "break", "lock", "break"] and closes(r)
        assert r.events[2].t == pytest.approx(exact, abs=0.4 * step**2)  # of second order, 4e-9 s at 0.1 ms
        assert r.speed("a") == pytest.approx(10.0 * np.sin(6.0 * r.t), abs=1e-12)


def test_two_clutches_that_cross_at_one_instant_share_their_friction():
    d = shaken(a=1.0, b=0.1, c=1.0)
    d.clutch("bc", "b", "c", 2.0, stick=1.2)
    d.clutch("ab", "a", "b", 2.0, stick=(1.0, 1.2), friction=([0.0, 1.0, 20.0], [1.0, 0.8, 0.9]))
    d.clutch("ab again", "a", "b", 2.0, stick=1.2)
    r = run(d.build(), 2.0, 2e-3, {"m": lambda t: 8.0 * math.sin(9.0 * t), "bc": 12.0, "ab": 12.0, "ab again": 2.0})
    crossed = [(e.t, e.element) for e in r.events if e.kind == "cross"]
    assert len(crossed) == 10 and closes(r)
    for (t, one), (other_t, other) in zip(crossed[::2], crossed[1::2]):
        assert {one, other} == {"ab", "ab again"} and t == pytest.approx(other_t, abs=1e-9)


def test_clutches_of_two_ratios_cannot_both_hold_a_body_to_one_that_is_moved():
    """The stronger one holds, 2 w_a = w_c, and the other slips against it as soon as the body moves."""
    d = shaken(a=1.0, c=0.2)
    d.clutch("strong", "a", "c", 2.0)
    d.clutch("weak", "a", "c", 1.0)
    r = run(d.build(), 1.0, 1e-3, {"m": sine, "strong": 40.0, "weak": 5.0})
    assert r.speed("c") == pytest.approx(2.0 * r.speed("a"), abs=1e-11) and closes(r)
    weak = -5.0 * np.sign(r.speed("a"))
    assert r.torque("weak")[1:] == pytest.approx(weak[1:])
    gain = 60.0 * np.cos(6.0 * r.t)
    assert r.torque("strong")[1:] == pytest.approx(0.2 * 2.0 * gain[1:] - weak[1:], abs=1e-2)


def test_a_brake_on_a_moved_body_adds_its_torque_to_that_of_the_motion():
    d = shaken(a=2.0)
    d.brake("b", "a")
    r = run(d.build(), 1.0, 1e-3, {"m": sine, "b": 7.0})
    middle = 0.5 * (r.t[1:] + r.t[:-1])
    asked = 2.0 * 60.0 * np.cos(6.0 * middle) + 7.0 * np.sign(np.sin(6.0 * middle))
    away = np.abs(np.sin(6.0 * middle)) > 0.01
    assert r.torque("m")[1:][away] == pytest.approx(asked[away], abs=1e-3)
    assert r.e_fric[-1, 0] == pytest.approx(7.0 * np.abs(np.diff(r.angle("a"))).sum(), rel=1e-4) and closes(r)
    # the brake sticks while the motion holds the body still
    still = run(d.build(), 1.0, 1e-3, {"m": ([0.0, 0.5, 1.0], [0.0, 0.0, 3.0]), "b": 7.0})
    assert [(e.kind, e.t) for e in still.events] == [("lock", 0.0), ("break", pytest.approx(0.5))] and closes(still)


def test_two_moved_bodies_and_a_clutch_between_them():
    d = shaken("a", "b", a=1.0, b=1.0, c=0.1)
    d.clutch("k", "a", "b")
    d.clutch("pull", "b", "c")
    r = run(d.build(), 2.0, 1e-3, {"m": sine, "mb": lambda t: 5.0 * math.sin(6.0 * t) + 2.0, "k": 3.0, "pull": 20.0})
    # the slip, 5 sin 6t - 2, is 0
    crossings = [e.t for e in r.events if e.element == "k" and e.kind == "cross"]
    assert crossings[:2] == pytest.approx([math.asin(0.4) / 6.0, (math.pi - math.asin(0.4)) / 6.0], abs=1e-6)
    assert r.speed("c")[500:] == pytest.approx(r.speed("b")[500:], abs=1e-9) and closes(r)


def test_a_moved_member_of_a_set_drives_the_others_by_their_inertia():
    d = shaken("sun", sun=0.3, ring=0.5, carrier=0.8)
    d.planetary("set", "sun", "ring", "carrier", 2.0)
    system = d.build()
    r = run(system, 0.5, 1e-3, {"msun": sine, "carrier": 4.0})
    # w_sun + 2 w_ring = 3 w_carrier: the torques of the set on them are x times 1, 2 and -3
    gain = 60.0 * np.cos(6.0 * r.t)
    x = (gain - 3.0 * 4.0 / 0.8) / -(4.0 / 0.5 + 9.0 / 0.8)
    ring = 2.0 * x / 0.5
    assert r.speed("ring") == pytest.approx(
        np.interp(r.t, r.t, np.concatenate([[0.0], np.cumsum(0.5e-3 * (ring[1:] + ring[:-1]))])), abs=1e-4
    )
    assert r.speed("sun") == pytest.approx(10.0 * np.sin(6.0 * r.t), abs=1e-12) and closes(r)


def test_a_moved_crank_asks_for_the_torque_that_its_inertia_over_the_angle_needs():
    d = shaken(a=0.1)
    angle = np.linspace(0.0, 2.0 * math.pi, 3601)
    d.varying_inertia("j", "a", table=(angle, 0.5 + 0.2 * np.cos(angle)), period=2.0 * math.pi)
    r = run(d.build(), 2.0, 1e-3, {"m": sine})
    t = 0.5 * (r.t[1:] + r.t[:-1])
    speed, at = 10.0 * np.sin(6.0 * t), 10.0 / 6.0 * (1.0 - np.cos(6.0 * t))
    asked = (0.6 + 0.2 * np.cos(at)) * 60.0 * np.cos(6.0 * t) - 0.5 * 0.2 * np.sin(at) * speed**2
    assert r.torque("m")[1:] == pytest.approx(asked, abs=2e-2) and np.ptp(asked) > 60.0 and closes(r)


@pytest.mark.parametrize(
    "act, words",
    [
        (lambda d: d.motion("m", "ground"), "motion 'm' names the ground, which stands still"),
        (lambda d: d.slider_crank("p", "ground", mass=1.0, radius=0.1, rod=0.3), "varying inertia 'p' names the ground"),
        (
            lambda d: (d.motion("m", "a"), d.motion("n", "b"), d.mesh("g", "a", "b", 2.0, 0.9), d.build()),
            "speeds that the meshes, variators and free-wheels .'g'. can hold",
        ),
        (lambda d: (d.motion("m", "a"), d.motion("n", "b"), d.freewheel("f", "a", "b"), d.build()), "free-wheels .'f'. can hold"),
        (
            lambda d: (
                d.motion("m", "a"),
                d.motion("n", "c"),
                d.mesh("g", "a", "b", 2.0, 0.9),
                d.mesh("h", "b", "c", 1.0, 0.9),
                d.build(),
            ),
            "free-wheels .'g', 'h'. can hold",
        ),
    ],
)
def test_refuses_in_one_sentence(act, words):
    d = Driveline()
    for name in "abc":
        d.inertia(name, 1.0)
    with pytest.raises(RigError, match=words) as refusal:
        act(d)
    assert refusal.value.exit_code == 2 and "\n" not in str(refusal.value)
