# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A planetary set with efficiency, compared with closed forms: its loss is a share of the power by speeds relative to the carrier.

The closed forms follow from Willis' relation and from the balance of the torques on sun, ring and carrier.
"""

import itertools

import numpy as np
import pytest

from rig_nodes.base.errors import RigError
from rig_nodes.driveline.builder import Driveline
from rig_nodes.driveline.run import run

K, J = 2.5, {"sun": 0.2, "ring": 0.5, "carrier": 3.0}


def described(efficiency, back=None, held=""):
    d = Driveline()
    for name in J:
        if name != held:
            d.inertia(name, J[name])
    members = ["ground" if name == held else name for name in J]
    d.planetary("set", *members, K, efficiency, back)
    return d.build()


def closes(r):
    return abs(r.residual()).max() < 1e-9 * (abs(r.e_in).max() + r.stored.max()) and r.capped == 0


def passed(efficiency, held, drives):
    """Returns the share of the driving member's power that the driven one gets, and the driven torque over the driving one."""
    # torques: 1 on the sun, K e on the ring, the rest on the carrier; e is 1 / efficiency where power flows from ring to sun
    speeds = {
        "ring": {"sun": 1.0 + K, "carrier": 1.0},
        "sun": {"ring": (1.0 + K) / K, "carrier": 1.0},
        "carrier": {"sun": -K, "ring": 1.0},
    }[held]
    other = next(name for name in speeds if name != drives)
    for e in (efficiency, 1.0 / efficiency):
        at = {"sun": 1.0, "ring": K * e, "carrier": -(1.0 + K * e)}
        power = {name: at[name] * w for name, w in speeds.items()}
        share = -power[other] / power[drives]
        if 0.0 < share < 1.0:
            return share, -at[other] / at[drives]
    raise AssertionError(held)


@pytest.mark.parametrize("efficiency", [0.97, 0.5])
@pytest.mark.parametrize("held, drives", list(itertools.permutations(J, 2)))
@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_each_member_drives_each_other_with_the_efficiency_of_the_closed_form(efficiency, held, drives, direction):
    other = next(name for name in J if name not in (held, drives))
    share, torques = passed(efficiency, held, drives)
    ratio = share / torques  # speed of the driven over that of the driving member
    r = run(described(efficiency, held=held), 0.5, 1e-2, {drives: 40.0 * direction})
    inertia = J[drives] + J[other] * ratio**2 / share
    assert r.speed(drives)[-1] == pytest.approx(40.0 * direction * 0.5 / inertia, rel=1e-7)
    assert r.speed(other) == pytest.approx(ratio * r.speed(drives), rel=1e-10, abs=1e-12)
    into, out = r.torque("set", drives)[-1], r.torque("set", other)[-1]
    assert -out * r.speed(other)[-1] == pytest.approx(share * into * r.speed(drives)[-1], rel=1e-6) and closes(r)


@pytest.mark.parametrize("efficiency", [0.9, 0.4])
def test_a_free_set_divides_the_torque_of_its_sun_by_what_its_teeth_lose(efficiency):
    """The torques on the ring and on the carrier are K e and -(1 + K e) times the sun's torque on its teeth."""
    r = run(described(efficiency), 0.5, 1e-2, {"sun": 30.0, "carrier": -10.0})
    # unknown: accelerations of sun, ring and carrier, and the torque t of the sun on the teeth
    rows = [
        [J["sun"], 0.0, 0.0, 1.0],
        [0.0, J["ring"], 0.0, K * efficiency],
        [0.0, 0.0, J["carrier"], -(1.0 + K * efficiency)],
        [1.0, K, -1.0 - K, 0.0],
    ]
    *rates, t = np.linalg.solve(rows, [30.0, 0.0, -10.0, 0.0])
    assert t > 0.0 and rates[0] > rates[2], "the sun drives, ahead of the carrier"
    assert r.speeds[-1] == pytest.approx([0.5 * rate for rate in rates], rel=1e-7) and closes(r)
    assert r.torque("set", "sun")[-1] == pytest.approx(-t, rel=1e-7)


def test_a_self_locking_set_holds_its_load_until_its_sun_drives_it_down():
    """With its carrier held it acts as a mesh: a load at the ring cannot turn the sun where `back` is below 0."""
    load, back = 50.0, -0.3
    held = run(described(0.45, back, held="carrier"), 1.0, 1e-2, {"ring": load})
    assert np.abs(held.speeds).max() < 1e-18
    down = run(described(0.45, back, held="carrier"), 2.0, 1e-2, {"ring": load, "sun": ([0.0, 2.0], [0.0, -20.0])})
    away = [e.t for e in down.events if e.kind == "break"]
    assert away == pytest.approx([-back * load / K / 10.0], abs=1e-6) and down.speed("ring")[-1] > 0.0 and closes(down)


@pytest.mark.parametrize(
    "arguments, words",
    [
        (("set", "sun", "ring", "carrier", K, 0.0), "efficiency of planetary set 'set' is 0.0"),
        (("set", "sun", "ring", "carrier", K, 0.9, 1.2), "efficiency of planetary set 'set' from ring back to sun is 1.2"),
        (("set", "sun", "ring", "carrier", K, None, 0.9), "has an efficiency back and none there"),
        (("set", "sun", "sun", "carrier", K, 0.9), "three different bodies"),
        (("set", "sun", "x", "carrier", K, 0.9), "'x', which does not exist"),
        (("sun", "sun", "ring", "carrier", K, 0.9), "'sun' is already taken"),
    ],
)
def test_refuses_in_one_sentence(arguments, words):
    d = Driveline()
    for name, j in J.items():
        d.inertia(name, j)
    with pytest.raises(RigError, match=words) as refusal:
        d.planetary(*arguments)
    assert refusal.value.exit_code == 2 and "\n" not in str(refusal.value)


def test_its_picture_names_its_efficiency(tmp_path):
    d = Driveline()
    for name, j in J.items():
        d.inertia(name, j)
    d.planetary("set", "sun", "ring", "carrier", K, 0.9)
    d.draw(tmp_path / "set.svg")
    assert "efficiency 0.9" in (tmp_path / "set.svg").read_text()
