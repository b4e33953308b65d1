# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Each type of fault on a two-speed gearbox: its sign is seen in the measured signals, and after its end the rig is as before.

The noise of a run follows from its seed, so that two runs differ by the fault alone. No trip is watched, so that each can be seen.
"""

import runpy
from pathlib import Path

import pytest

from rig_nodes.rig.configuration import load_rig
from rig_nodes.rig.faults import faults_of

SHOWN = runpy.run_path(str(Path(__file__).parents[2] / "docs" / "fault_pictures.py"))  # of which the site draws its pictures
CHANNELS, SIGNS, outside, upshift, readings = (SHOWN[name] for name in ("CHANNELS", "SIGNS", "outside", "upshift", "readings"))
# what is allowed as a difference at the end: a little more than noise and a step of the converter
SETTLED = dict(zip(CHANNELS, (3.0, 0.5, 3.0, 0.5, 6e4, 6e4, 6e4, 0.02, 0.02, 3e4, 0.5)))


@pytest.fixture(scope="module")
def begun():
    with SHOWN["bench"]() as function:
        yield function


@pytest.fixture(scope="module")
def healthy(begun):
    """Returns what :func:`course` returns without a fault, by whether the controller is outside."""
    return {place: course(begun(place)) for place in (False, True)}


def course(session, fault=""):
    """Returns what is measured during an upshift with a fault, and after the downshift without it."""
    ill = upshift(session, fault)
    if fault:
        session.fault(fault, off=True)
    return ill, dict(zip(CHANNELS, readings(session, 1.4, "I")[-1]))


def test_the_table_has_every_type_that_the_rig_can_have():
    known = {name: (one.fault.part, one.fault.name) for name, one in faults_of(load_rig(SHOWN["RIG"])).items()}
    assert {known[name] for name in SIGNS} == set(known.values())


@pytest.mark.parametrize("fault", SIGNS)
def test_its_sign_is_seen_and_it_leaves_nothing_behind(begun, healthy, fault):
    session = begun(outside(fault))
    before = len(session.events)
    ill, after = course(session, fault)
    expected, settled = healthy[outside(fault)]
    signal, low, high = SIGNS[fault]
    difference = (ill - expected)[:, CHANNELS.index(signal)]
    assert difference.min() < low if low is not None else difference.max() > high
    assert session.status == "running", session.reason
    assert {name: after[name] for name in CHANNELS if abs(after[name] - settled[name]) > SETTLED[name]} == {}
    assert [name for _, name, *_ in session.events[before:] if name.startswith("fault")] == [
        "fault_ordered",
        "fault_on",
        "fault_ordered",
        "fault_off",
    ]
