# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The plant's step is short enough: half of it changes no metric of a shift noticeably."""

import dataclasses

import numpy as np
import pytest

from rig_nodes.analysis.shift import shifts
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.recorded import record
from rig_nodes.runs.sequence import load_sequence

METRICS = (
    "t_dt_s",
    "t_p_s",
    "t_c_s",
    "t_o_s",
    "input_torque_max_nm",
    "output_speed_min_rpm",
    "k",
    "e_loss_j",
    "e_loss_settled_j",
    "overlap_s",
)
SHORT = 4e-4  # s: half a percent of a t_p of 50 ms would be less than three logger rows
FINER = 10  # rows interpolated between two logger rows, because the metrics count in whole rows


def finer(recording):
    """Returns the same recording with more rows."""
    rows = np.arange(recording.rows)
    dense = np.arange(FINER * (recording.rows - 1) + 1) / FINER
    channels = {name: np.interp(dense, rows, values) for name, values in recording.channels.items()}
    return dataclasses.replace(recording, period=recording.period / FINER, channels=channels)


@pytest.mark.parametrize("up, down", [("40 Nm", "80 Nm"), pytest.param("70 Nm", "140 Nm", marks=pytest.mark.campaign)])
def test_half_the_step_changes_no_metric_by_half_a_percent(noiseless, up, down):
    """Shifts up and down at two loads, without noise, which moves the metrics more than the step does."""
    sequence = load_sequence("grid_point", {"speed": "1500 rpm", "load_up": up, "load_down": down})
    whole, half = (
        shifts(finer(record(noiseless(load_rig("hydmag", {"kernel.step": step})), sequence).recording))
        for step in ("100 us", "50 us")
    )
    assert [(row["from_gear"], row["to_gear"], row["valid"]) for row in half] == [(1, 2, True), (2, 1, True)]
    for before, after in zip(whole, half, strict=True):
        moved = {
            name: (before[name], after[name])
            for name in METRICS
            if before[name] != pytest.approx(after[name], rel=5e-3, abs=SHORT if name == "t_p_s" else None)
        }
        assert not moved, f"from gear {before['from_gear']}: {moved}"
        assert after["input_torque_max_nm"] != before["input_torque_max_nm"], "the step was changed"
