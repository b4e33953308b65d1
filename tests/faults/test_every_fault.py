# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Each type of fault on a two-speed gearbox: its sign is seen in the measured signals, and after its end the rig is as before.

The noise of a run follows from its seed, so that two runs differ by the fault alone. No trip is watched, so that each can be seen.
"""

import numpy as np
import pytest

import rig_nodes
from rig_nodes.plant.faults.fault import MESSAGES, faults
from rig_nodes.rig.faults import faults_of

CHANNELS = ("M_wej", "n_wej", "M_wyj", "n_wyj", "p1", "p2", "p_po", "I_zr_p1", "I_zr_p2", "p_p", "T_oil")
# what is allowed as a difference at the end: a little more than noise and a step of the converter
SETTLED = dict(zip(CHANNELS, (3.0, 0.5, 3.0, 0.5, 6e4, 6e4, 6e4, 0.02, 0.02, 3e4, 0.5)))
# fault -> the signal that shows it during an upshift, and by how much it is lower and higher at most than in the healthy run:
# one of the two is reached (the other is the largest that has nothing to do with the fault)
SIGNS = {
    "motor.weak": ("n_wej", -2.0, None),
    "motor.tripping": ("n_wej", -5.0, None),
    "clutch_s2.glazed": ("n_wyj", -2.0, None),
    "clutch_s2.worn": ("n_wyj", -10.0, None),
    "clutch_s2.tight": ("n_wyj", None, 10.0),
    "clutch_s2.spring": ("n_wyj", None, 1.0),
    "clutch_s1.seized": ("n_wyj", -5.0, None),
    "clutch_s2.warped": ("n_wyj", None, 10.0),
    "clutch_s2.leaking_line": ("p2", -1e6, None),
    "clutch_s2.leaking_piston": ("p2", -1e6, None),
    "load_pump.chattering": ("p_po", -5e4, None),
    "valve_zr_p2.stuck": ("p2", -2e6, None),
    "valve_zr_p2.sticking": ("p2", -1e6, None),
    "valve_zr_p2.slow": ("p2", -1e6, None),
    "valve_zr_p1.leaking": ("p1", None, 2e6),
    "valve_zr_p2.dead_band": ("p2", -3e4, None),
    "valve_zr_p2.spring": ("p2", None, 5e5),
    "valve_zr_p2.inlet": ("p2", -2e6, None),
    "valve_zr_p2.coil_open": ("I_zr_p2", -0.5, None),
    "valve_zr_p2.coil_shorted": ("p2", -1e6, None),
    "valve_zr_p2.coil_hot": ("I_zr_p2", -5e-3, None),
    "oil_supply.air": ("p2", -8e5, None),
    "oil_supply.cold": ("T_oil", -20.0, None),
    "oil_supply.worn": ("p_p", -8e5, None),
    "n_wyj.offset": ("n_wyj", None, 15.0),
    "n_wyj.drift": ("n_wyj", None, 5.0),
    "n_wyj.gain": ("n_wyj", None, 3.0),
    "p2.noise": ("p2", -5e5, None),
    "n_wyj.stuck": ("n_wyj", -10.0, None),
    "n_wyj.dropped": ("n_wyj", -35.0, None),
    "n_wyj.loose": ("n_wyj", -35.0, None),
    "n_wyj.swapped": ("n_wyj", None, 10.0),
    "p2.delayed": ("p2", -1e6, None),
    "n_wyj.losing_pulses": ("n_wyj", -3.0, None),
}
SIZES = {"motor.weak": "94 %"}  # where the usual size does nothing at this load


@pytest.fixture(scope="module")
def bench():
    """Yields a session in gear I under load, with a snapshot of it and the healthy course of :func:`course`."""
    with rig_nodes.load("hydmag", faults="on", trips={"watched": "off"}).session(seed=1) as session:
        session.set("oil", "4 MPa")
        session.advance(0.3)
        session.set("shift", "I")
        session.set("motor", "500 rpm")
        session.advance(0.5)
        session.set("load", "30 Nm")
        session.advance(1.2)
        start = session.snapshot()
        yield session, start, course(session)


def course(session, fault=None, **how):
    """Returns what is measured every 20 ms during an upshift with a fault, and after the downshift without it."""
    rows = []

    def go(seconds):
        for _ in range(round(seconds / 0.02)):
            session.advance(0.02)
            rows.append([session.read(name) for name in CHANNELS])

    if fault:
        session.fault(fault, **how)
    go(0.2)
    session.set("shift", "II")
    go(1.5)
    ill = np.array(rows)
    if fault:
        session.fault(fault, off=True)
    session.set("shift", "I")
    go(1.4)
    return ill, dict(zip(CHANNELS, rows[-1]))


def test_the_table_has_every_type_but_messages():
    known = faults_of(rig_nodes.load("hydmag", faults="on").config)
    types = {f"{known[name].fault.part}.{known[name].fault.name}" for name in SIGNS}
    assert types == {name for name, one in faults().items() if one.part != MESSAGES}


@pytest.mark.parametrize("fault", SIGNS)
def test_its_sign_is_seen_and_it_leaves_nothing_behind(bench, fault):
    session, start, (healthy, settled) = bench
    session.restore(start)
    ill, after = course(session, fault, **({"size": SIZES[fault]} if fault in SIZES else {}))
    signal, low, high = SIGNS[fault]
    difference = (ill - healthy)[:, CHANNELS.index(signal)]
    assert difference.min() < low if low is not None else difference.max() > high
    assert session.status == "running", session.reason
    assert {name: after[name] for name in CHANNELS if abs(after[name] - settled[name]) > SETTLED[name]} == {}
    assert [name for _, name, *_ in session.events[len(start.events) :] if name.startswith("fault")] == [
        "fault_ordered",
        "fault_on",
        "fault_ordered",
        "fault_off",
    ]
