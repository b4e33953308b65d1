# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the operator's page keeps of a running rig's messages: the last seconds, in order and as they were sent, and no more."""

import pytest

from rig_nodes.bags import cdr, encoder
from rig_nodes.nodes.panel import tracks as panel_tracks
from rig_nodes.nodes.panel.tracks import KEPT, STRETCH, Tracks
from rig_nodes.rig import load_rig

STATE, OUTPUT, LATCHED = "/rig/state", "/load_pump/m_wyj", "/rig/run_info"


@pytest.fixture
def tracks():
    return Tracks(load_rig("hydmag").catalogue, STATE)


def fill(tracks, first, last, reason=""):
    """Gives tracks the messages of a stretch of time, a hundred a second of two topics; returns those of the second."""
    sent = []
    for k in range(round(100 * first), round(100 * last)):
        ns = 10_000_000 * k
        sent.append(encoder("rig_msgs/msg/Measurement").encode(ns, k, float(k)))
        state = encoder("rig_msgs/msg/RigState").encode(ns, k, 2, reason, False, 10 * k, 0, 0.0)
        tracks.add({STATE: [state], OUTPUT: sent[-1:]})
    return sent


def test_the_last_seconds_are_kept_as_they_were_sent_and_older_ones_are_forgotten(tracks):
    tracks.add({LATCHED: [b"said once"]})
    sent = fill(tracks, 0, 70)
    kept = list(tracks.messages[OUTPUT])
    assert kept == sent[-len(kept) :]
    assert KEPT <= 69.99 - cdr.stamp(kept[0]) * 1e-9 <= KEPT + 2 * STRETCH
    assert list(tracks.messages[LATCHED]) == [b"said once"]


def test_a_signal_that_is_shown_late_has_what_is_kept_and_goes_on(tracks):
    fill(tracks, 0, 40)
    tracks.show(["M_wyj"])
    fill(tracks, 40, 41)
    t, values = tracks.between("M_wyj", 16.0, 41.0)
    assert len(t) == 2500 and t[0] == pytest.approx(16.0)
    assert values == pytest.approx(t * 100)


def test_more_than_there_is_room_for_is_forgotten(tracks, monkeypatch):
    monkeypatch.setattr(panel_tracks, "BYTES", 200_000)
    fill(tracks, 0, 20, reason="x" * 100)
    kept = {name: list(tracks.messages[name]) for name in (STATE, OUTPUT)}
    assert 100_000 < sum(len(one) for ones in kept.values() for one in ones) <= 200_000
    assert all(cdr.stamp(ones[-1]) == 19_990_000_000 for ones in kept.values())


def test_a_rig_that_begins_anew_is_told_and_nothing_older_is_kept(tracks):
    fill(tracks, 10, 20)
    again = encoder("rig_msgs/msg/RigState").encode(0, 0, 2, "", False, 0, 0, 0.0)
    assert tracks.add({STATE: [again]})
    assert list(tracks.messages[OUTPUT]) == [] and list(tracks.messages[STATE]) == [again]
    assert not tracks.add({STATE: [again]})
