# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What Annex D's printed pressures require: two bores of one drain, a peak after the shift, and a piston that is not back."""

import pytest

from rig_nodes.rig import load_rig
from rig_nodes.runs.calculations import calculations_of


def table(name, rig="hydmag"):
    return calculations_of("hydmag")[name].table(load_rig(rig))


def test_the_return_of_the_piston_asks_for_three_times_the_bore_of_the_fall():
    fall, back = table("drains").rows
    assert fall[3] == pytest.approx(0.278e-6, rel=0.01)
    # by hand: 5.63e-11 m3/Pa of piston and springs, sqrt(0.418 MPa) - sqrt(0.197 MPa) within 0.5385 s
    assert back[3] == pytest.approx(0.885e-6, rel=0.01)
    assert back[1] == pytest.approx(12.5e-6, rel=0.01)


def test_close_to_400_nm_can_only_be_transmitted_after_the_longest_downshift():
    torque = {time: rest[-1] for time, *rest in table("downshift_torque").rows}
    assert max(value for time, value in torque.items() if 0.2 <= time <= 0.26) < 285.0
    assert torque[0.35] < 380.0 < torque[0.407]


def test_with_the_friction_of_chapter_9_s1_never_transmits_it():
    assert max(row[-1] for row in table("downshift_torque", "chapter9").rows if row[0] >= 0.26) < 300.0


def test_a_level_on_the_plateau_needs_a_half_filled_s2_in_every_series():
    """A piston that is back and an empty line allow no level: S2's contact comes 0.17 to 0.31 s after the plateau's end."""
    rows = table("plateaus").rows
    assert len(rows) == 10
    name, _, ends, contact, current, oil, _ = rows[9]
    assert (name, ends) == ("ZR-P2-10", pytest.approx(0.33))
    # by hand: 0.3306 s + 0.2379 s; 215 mA + 525 mA * 238.5 / 250; 74.9 cm3/s for these 238.5 ms
    assert contact == pytest.approx(0.5685) and current == pytest.approx(0.716, abs=1e-3)
    assert oil == pytest.approx(17.9e-6, rel=0.01)
    assert all(0.3 < share < 0.7 for *_, share in rows)
