# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A metric that its definition does not allow is withheld with its reason, and makes no shift invalid."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic_shift import I1, Shift

from rig_nodes.analysis.definitions import undefined_lines
from rig_nodes.analysis.metrics import named_metrics
from rig_nodes.analysis.shift import orders_of, shifts
from rig_nodes.rig.configuration import load_rig
from rig_nodes.rig.transmission import transmission_of

WITH_A_HELD_SPEED = {"t_o_s", "k", "e_loss_j", "e_loss_settled_j"}


@pytest.mark.parametrize(
    ("rig", "held"),
    [("hydmag", True), ("three_speed", True), ("hydmag_hydrostatic", True), ("hydmag_coupling", True), ("hydmag_engine", False)],
)
def test_the_rigs_description_decides_whether_a_drive_holds_the_inputs_speed(rig, held):
    assert (load_rig(rig).transmission.drive_yields == "") == held


def test_a_drive_behind_an_engine_shaft_does_not_count_when_it_is_on_the_output():
    structure = load_rig("hydmag_engine").structure
    record = load_rig("hydmag_engine").as_dict()
    motor = load_rig("hydmag").structure.device("motor")
    far = replace(motor, name="far", wires={**motor.wires, "body": structure.output.body})
    plain = replace(structure, devices=(*structure.devices, far)).plain()
    assert "combustion engine" in transmission_of({**record, "structure": plain, "far": {}}).drive_yields


def test_with_an_engine_the_losses_and_k_are_withheld_and_the_shift_is_valid():
    recording = Shift().recording()
    box = replace(recording.transmission, drive_yields="engine (combustion engine) yields to the load")
    (row,) = shifts(replace(recording, transmission=box))
    assert row["valid"] and row["t_c_s"] == pytest.approx(0.7, abs=2e-3) and row["input_torque_max_nm"] is not None
    assert {key for key in WITH_A_HELD_SPEED if row[key] is None} == WITH_A_HELD_SPEED == set(row["undefined"])
    (line,) = undefined_lines(["shift 1"], [row], named_metrics(), box)
    assert line.startswith("no t_o, k, E_loss, settled: ") and "yields to the load" in line


def test_a_loss_below_nothing_is_not_a_result():
    (good,) = shifts(Shift().recording())
    torque = Shift().channels()["M_wyj"] + 300.0  # a torque meter at the output that reads too much
    (row,) = shifts(Shift().recording(M_wyj=torque))
    assert good["e_loss_j"] > 0.0 and row["e_loss_j"] is None and row["valid"]
    assert "no loss is negative" in row["undefined"]["e_loss_j"]


def test_k_is_withheld_where_the_input_outran_its_old_speed():
    case = Shift(up=False)
    t = np.arange(int(case.length / 1e-4)) * 1e-4 - 1.0
    faster = np.interp(t, [case.fall - 0.01, case.fall], [1.0, 1.1])
    channels = case.channels()
    (row,) = shifts(case.recording(n_wej=channels["n_wej"] * faster, n_wyj=channels["n_wyj"] * faster))
    assert row["k"] is None and "n_wej rose" in row["undefined"]["k"]
    (line,) = undefined_lines(["shift 1", "shift 2"], [row, {}], named_metrics(), load_rig("hydmag").transmission)[:1]
    assert line.startswith("shift 1: no k: ")


def test_a_gear_engaged_from_neutral_in_step_with_the_output_is_no_shift():
    case = Shift()
    channels = case.channels()
    in_step = channels | {"n_wyj": channels["n_wej"] / I1, "p2": np.zeros_like(channels["p2"])}
    closing = np.interp(np.arange(len(in_step["p1"])) * 1e-4 - 1.0, [0.3, 0.6], [0.0, 2.3e6])
    recording = replace(case.recording(), channels=in_step | {"p1": closing}, orders=[(1.0, 0, 1)])
    assert orders_of(recording) == []
    pressed = replace(recording, channels=in_step | {"p1": np.full_like(closing, 2.3e6)})
    assert len(orders_of(pressed)) == 1, "a gear that was in although neutral was ordered is reported"
