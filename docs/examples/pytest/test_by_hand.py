# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A rig stepped by hand: the clutch of gear I holds what the motor gives."""


def test_gear_one_holds_when_the_motor_starts(rig):
    session = rig.session(seed=1)
    session.set("oil", "4 MPa")
    session.set("shift", "I")
    session.advance(1.0)
    session.set("motor", "800 rpm")
    for _ in range(100):
        session.advance(0.01)
        assert abs(session.true("s1_slip")) < 0.1
    assert session.read("n_wej") > 70.0
