# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What happens in a run, in its order, what must not happen, and signals within their bounds."""

from rig_nodes import assert_events, assert_never, assert_stays


def test_the_gears_come_in_their_order(run):
    assert_events(run, "shift to I ordered", "shift_done", "shift to II ordered", "shift_done", "sequence_done")
    assert_never(run, "rig_tripped")


def test_torque_and_supply_stay_within_bounds(run):
    assert_stays(run, "M_wej", below="300 Nm", above="-50 Nm")
    assert_stays(run, "p_p", above="3.5 MPa", start=1.0)
