# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The table of a shift has the extremes of the curves that stand beside it, on every installed rig with gears."""

import numpy as np
import pytest

from rig_nodes.analysis.measured_error import instruments_of, uncertainty
from rig_nodes.analysis.quality import peak_ratio
from rig_nodes.analysis.shift import shifts
from rig_nodes.base.names import installed
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.recorded import record
from rig_nodes.runs.sequence import load_sequence

RIGS = [name for name in installed("rigs") if load_rig(name).structure.shifts]
RPM = 30.0 / np.pi


@pytest.mark.parametrize("rig", RIGS)
def test_each_curve_between_order_and_settled_torque_has_its_extremes_in_the_table(rig):
    config = load_rig(rig)
    recording, box = record(config, load_sequence("demo", None, rig)).recording, config.transmission
    rows = [row for row in shifts(recording) if row["course_s"]]
    assert rows
    for row in rows:
        settled = (row["t_c_s"] or 0.0) + (row["t_o_s"] or 0.0)
        assert row["course_s"] >= settled - 1e-9, "the curve goes on until the torque has settled"
        first, last = (round((row["t_order_s"] + since - recording.t0) / recording.period) for since in (0.0, row["course_s"]))
        curves = {end: np.asarray(recording.channels[end][first : last + 1]) for end in (box.input.torque, box.output.speed)}
        torque, speed = (np.convolve(curve, np.full(19, 1.0 / 19.0), "valid") for curve in curves.values())
        errors = uncertainty(row, instruments_of(config.as_dict()), box)
        assert row["input_torque_high_nm"] == pytest.approx(torque.max(), abs=errors["input_torque_high_nm"])
        assert row["input_torque_low_nm"] == pytest.approx(torque.min(), abs=errors["input_torque_low_nm"])
        if row["output_speed_low_rpm"] is not None:
            assert row["output_speed_low_rpm"] == pytest.approx(speed.min() * RPM, abs=errors["output_speed_low_rpm"] + 0.5)
        if (ratio := peak_ratio(row, box)) is not None and row["input_torque_max_nm"] is not None:
            assert ratio >= row["input_torque_max_nm"] / row["input_torque_high_nm"] * ratio - 1e-9, "the verdict sees every peak"
        for key, value in (("t_high_s", row["input_torque_high_nm"]), ("t_low_s", row["input_torque_low_nm"])):
            if row[key] is not None:
                at = round((row["t_order_s"] + row[key] - recording.t0) / recording.period)
                near = np.mean(recording.channels[box.input.torque][at - 10 : at + 11])
                assert near == pytest.approx(value, abs=errors["input_torque_high_nm"] + 1.0), key
