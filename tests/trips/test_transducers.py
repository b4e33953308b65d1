# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Transducers that fail: what the instruments say trips the rig by the name of the transducer, on every rig."""

import pytest

import rig_nodes
from rig_nodes.base import rig_folders
from rig_nodes.rig import STAYED, load_rig


def scattering():
    """Every transducer of every rig whose healthy reading never rests."""
    for rig in rig_folders():
        for trip in load_rig(rig).trips:
            if trip.name.startswith("dead_") and trip.quantity.terms[0][0].startswith(STAYED):
                yield rig, trip.name.removeprefix("dead_")


@pytest.fixture(scope="module")
def standing():
    """Returns a session of a rig that stands, with its snapshot; each rig is made once."""
    made = {}

    def session_of(rig):
        if rig not in made:
            made[rig] = rig_nodes.load(rig, faults="on").session(seed=1)
            made[rig].advance(0.3)
            made[rig] = made[rig], made[rig].snapshot()
        session, start = made[rig]
        session.restore(start)
        return session

    yield session_of
    for session, _ in made.values():
        session.__exit__(None, None, None)


@pytest.mark.parametrize("rig, name", list(scattering()))
def test_a_reading_without_its_noise_is_dead_or_stuck_even_on_a_rig_that_stands(standing, rig, name):
    limit = standing(rig).rig.config.value(f"trips.dead_{name}.limit")
    for fault, names in (("dropped", [f"dead_{name}"]), ("stuck", [f"stuck_{name}", f"dead_{name}"])):
        session = standing(rig)
        session.fault(f"{name}.{fault}")
        session.advance(0.6 * limit)
        assert session.status != "tripped", session.reason  # some of a healthy reading's last samples may be the same
        session.advance(0.4 * limit + 0.002)
        assert session.status == "tripped" and session.reason.split(":")[0].removeprefix("trip ") in names, (fault, session.reason)


@pytest.fixture(scope="module")
def loaded():
    """Returns a session of the two-speed gearbox in gear I under 150 Nm, with a snapshot of it."""
    with rig_nodes.load("hydmag", faults="on").session(seed=1) as session:
        session.set("oil", "4 MPa")
        session.advance(0.3)
        session.set("shift", "I")
        session.set("motor", "800 rpm")
        session.advance(1.0)
        session.set("load", "220 Nm")
        session.advance(2.0)
        yield session, session.snapshot()


@pytest.mark.parametrize(
    "fault, size, trip, within",
    [
        ("n_wyj.dropped", None, "contradicts_n_wej_I", 0.3),
        ("n_wyj.swapped", None, "contradicts_n_wej_I", 0.3),
        ("n_wyj.losing_pulses", "30 %", "contradicts_n_wej_I", 0.3),
        ("n_wej.offset", "10 %", "contradicts_n_wej_I", 0.3),
        ("n_wej.gain", "30 %", "contradicts_n_wej_I", 0.3),
        ("p1.offset", "-5 %", "contradicts_p1_low", 1.2),
        ("p1.offset", "5 %", "contradicts_p1_most", 1.2),
        ("p1.gain", "50 %", "contradicts_p1_most", 1.2),
        ("p1.swapped", None, "contradicts_p1_low", 1.2),
        ("p2.offset", "5 %", "contradicts_p2_high", 1.2),
        ("M_wyj.offset", "-30 %", "contradicts_M_wej_I", 2.2),
        ("M_wej.gain", "50 %", "contradicts_M_wej_I", 2.2),
        ("M_wej.swapped", None, "contradicts_M_wej_I", 2.2),
        ("I_zr_p1.offset", "-40 %", "coil_open_valve_zr_p1", 0.3),
        ("T_oil.dropped", None, "dead_T_oil", 10.2),
    ],
)
def test_a_reading_that_contradicts_others_trips_by_its_name(loaded, fault, size, trip, within):
    session, start = loaded
    session.restore(start)
    session.fault(fault, **({"size": size} if size else {}))
    session.advance(within)
    assert session.status == "tripped" and session.reason.startswith(f"trip {trip}: "), session.reason


def test_a_frozen_encoder_contradicts_the_ratio_of_the_next_gear(loaded):
    session, start = loaded
    session.restore(start)
    session.fault("n_wyj.stuck")
    session.advance(0.5)
    assert session.status == "running", session.reason
    session.set("shift", "II")
    session.advance(2.0)
    assert session.reason.startswith("trip contradicts_n_wej_II: ")


@pytest.mark.parametrize(
    "fault, trip", [("n_crank.dropped", "dead_n_crank"), ("n_motor.dropped", "dead_n_motor"), ("n_motor.stuck", "stuck_n_motor")]
)
def test_an_encoder_on_a_belt_is_told_by_the_other_one_or_its_own_scatter(standing, fault, trip):
    session = standing("frame_saw")
    session.set("motor", "900 rpm")
    session.advance(3.0)
    session.fault(fault)
    session.advance(0.3)
    assert session.reason.startswith(f"trip {trip}: "), session.reason


def test_noise_that_is_switched_off_leaves_readings_that_rest(loaded):
    session, start = loaded
    session.restore(start)
    session.set("instruments.noise", "off")
    session.advance(1.0)
    assert session.status == "running", session.reason
    session.set("instruments.noise", "on")
    session.fault("M_wej.stuck")
    session.advance(0.2)
    assert session.reason.startswith("trip stuck_M_wej: ")
