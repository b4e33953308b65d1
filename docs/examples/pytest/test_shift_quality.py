# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The shifts of the demo keep their limits, with the rig's own settings and with a later engagement."""

import pytest

from rig_nodes import assert_shift


def test_both_shifts_keep_their_limits(run):
    assert_shift(run, "I-II", t_c="< 700 ms", k="> 0.9", input_torque_max_nm="< 300 Nm")
    assert_shift(run, "II-I", t_c="< 700 ms", e_loss_j="< 5000 J")


@pytest.mark.rig(settings={"alfa46.t12": "-200 ms"})
def test_a_later_engagement_is_still_a_shift(run):
    assert_shift(run, "I-II", k="0.9 .. 1.01")
