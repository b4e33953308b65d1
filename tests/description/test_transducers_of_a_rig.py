# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The transducers that a user adds to a rig: what their signs mean, their ranges, their order and their errors."""

import pytest

from rig_nodes.testbench.configuration import load_rig


@pytest.fixture
def variant(tmp_path):
    """A function that writes a rig on hydmag with some lines of its own, and returns its folder."""

    def write(text: str):
        into = tmp_path / "variant"
        into.mkdir(exist_ok=True)
        (into / "rig.yaml").write_text(f"description: a variant\nbase: hydmag\n{text}")
        return into

    return write


def test_the_sign_of_a_current_speaks_of_a_clutch_only_where_the_rig_says_so(variant):
    added = "{type: current, logged: no, shows: valve_zr_p1.current, at: motor, range: [0 A, 1 A], text: Current of something.}"
    signals = load_rig(variant(f"transducers:\n  I_own: {added}\n")).catalogue.signals
    assert signals["I_own"].sign == "positive when it flows from its supply"
    assert signals["I_zr_p1"].sign == "positive opens supply to the clutch"
