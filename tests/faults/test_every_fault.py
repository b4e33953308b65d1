# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Each type of fault on a rig that can have it: its sign is seen in the measured signals, and after its end the rig is as before.

The noise of a run follows from its seed, so that two runs differ by the fault alone. No trip is watched, so that each can be seen.
"""

import runpy
from functools import cache
from pathlib import Path

import pytest

import rig_nodes
from rig_nodes.base.errors import RigError
from rig_nodes.plant.faults.fault import FAMILIES
from rig_nodes.rig.configuration import load_rig
from rig_nodes.rig.faults import faults_of, read_fault

SHOWN = runpy.run_path(str(Path(__file__).parents[2] / "docs" / "fault_pictures.py"))  # of which the site draws its pictures
COURSES, outside, shown, readings, type_of = (SHOWN[name] for name in ("COURSES", "outside", "shown", "readings", "type_of"))
OTHERS = [rig for rig in COURSES if rig != "hydmag"]  # of which tests/faults/test_orders_of_faults.py has more


@pytest.fixture(scope="module")
def begun():
    with SHOWN["bench"]() as function:
        yield function


@pytest.fixture(scope="module")
def healthy(begun):
    """Returns a function that gives what :func:`course` returns without a fault, by rig and whether the controller is outside."""
    return cache(lambda rig, place: course(begun(rig, place), rig))


def course(session, rig, fault=""):
    """Returns what is measured during a rig's course with a fault, and at the end without it."""
    of = COURSES[rig]
    ill = shown(session, of, fault)
    if fault:
        session.fault(fault, off=True)
    return ill, dict(zip(of.names, readings(session, of, of.after)[-1]))


def test_the_tables_have_every_type_once():
    own = {f"{one.part}.{one.name}" for family in FAMILIES.own for one in FAMILIES.own_module(family).FAULTS}
    rigs = {rig: load_rig(rig) for rig in COURSES}
    seen = [type_of(rigs[rig], fault) for rig, of in COURSES.items() for fault in of.signs]
    assert sorted(seen) == sorted(own)


@pytest.mark.parametrize(("rig", "fault"), [(rig, fault) for rig, of in COURSES.items() for fault in of.signs])
def test_its_sign_is_seen_and_it_leaves_nothing_behind(begun, healthy, rig, fault):
    expected, settled = healthy(rig, outside(fault))
    session, of = begun(rig, outside(fault)), COURSES[rig]
    before = len(session.events)
    ill, after = course(session, rig, fault)
    signal, low, high = of.signs[fault]
    difference = (ill - expected)[:, of.names.index(signal)]
    assert difference.min() < low if low is not None else difference.max() > high
    assert session.status == "running", session.reason
    assert {name: after[name] for name in of.names if abs(after[name] - settled[name]) > of.settled[name]} == {}
    assert [name for _, name, *_ in session.events[before:] if name.startswith("fault")] == [
        "fault_ordered",
        "fault_on",
        "fault_ordered",
        "fault_off",
    ]


@pytest.mark.parametrize("rig", OTHERS)
def test_how_time_is_divided_and_snapshots_change_no_bit(rig):
    of = COURSES[rig]
    faults = "; ".join(f"{fault}, onset=intermittent, period=60 ms, at=150 ms" for fault in of.signs)

    def moved(pieces):
        with rig_nodes.load(rig, faults=faults, trips={"watched": "off"}).session(seed=1) as session:
            for key, value, _ in (*of.start, *of.shown):
                if key:
                    session.set(key, value)
            for ms in pieces:
                session.advance(ms / 1000)
                if pieces[0] == 7:
                    session.restore(session.snapshot())
            return session.rig.state_hash(), session.rig.row().tobytes()

    assert moved([600]) == moved([1] * 600) == moved([7] * 85 + [5])


@pytest.mark.parametrize("rig", OTHERS)
def test_numbers_of_suspect_parameters_are_of_one_device_each(rig):
    owners = {}
    for one in faults_of(load_rig(rig)).values():
        owners.setdefault(one.spn, set()).add(one.owner)
    assert {spn: names for spn, names in owners.items() if len(names) > 1} == {}


@pytest.mark.parametrize(
    ("rig", "settings", "fault", "why"),
    [
        ("cylinder_bench", {}, "cylinder.spring", "it has no springs"),
        ("cylinder_bench", {}, "clutch_pack.worn", "its cylinder has no way to go"),
        ("spring_bench", {}, "cylinder.leaking", "the testing machine moves its springs"),
        ("spring_bench", {}, "clutch_pack.glazed", "nothing presses it: the testing machine moves its springs"),
        ("clutch_bench", {"effects.seal_friction": "off"}, "cylinder.sticking", "effects.seal_friction is off"),
        ("hydmag_hydrostatic", {"hydrostatic.boost_pressure": "0 MPa"}, "hydrostatic.boost", "it has no boost supply"),
    ],
)
def test_what_a_rig_lacks_for_a_fault_is_said(rig, settings, fault, why):
    with pytest.raises(RigError, match=f"fault {fault} refused: {why}"):
        read_fault(load_rig(rig, settings), fault, "--fault")
