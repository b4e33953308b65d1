# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rows written directly into memory equal those of a bag of the same run, at the logger's rate or at the kernel's."""

import numpy as np
import pytest

from rig_nodes.analysis.run_report import recording_of
from rig_nodes.bags.reader import Bag
from rig_nodes.base.errors import RigError
from rig_nodes.rig.configuration import load_rig, with_overrides
from rig_nodes.runs.recorded import record
from rig_nodes.runs.sequence import load_sequence
from rig_nodes.runs.simulation import simulate

# waiting for signals of 100 Hz, 200 Hz and 1 kHz, with and without hold, for times and for shifts
WAITS = """
description: waits of every kind
steps:
  - oil: {pressure: 4 MPa}
  - wait: {until: {signal: p_p, above: 3.9 MPa}, timeout: 3 s}
  - shift: {to: I, timeout: 3 s}
  - motor: {speed: 300 rpm}
  - wait: {until: {signal: motor_torque, above: 5 Nm}, timeout: 3 s}
  - load: {torque: 20 Nm}
  - wait: {until: {signal: n_wej, above: 290 rpm, below: 310 rpm}, hold: 123 ms, timeout: 3 s}
  - shift: {to: neutral, timeout: 3 s}
  - wait: {until: {signal: s1_slip, above: 50 rpm}, timeout: 3 s}
  - shift: {to: II}
  - wait: {for: 37 ms}
  - motor: {off: true}
  - load: {off: true}
  - wait: {until: {signal: I_set_zr_p2, above: 700 mA}, timeout: 1 s}
  - wait: {until: {signal: n_wej, below: 200 rpm}, timeout: 5 s}
"""
FAILS = WAITS.replace("timeout: 5 s}", "timeout: 20 ms}")


def written(folder, text):
    path = folder / "waits.yaml"
    path.write_text(text)
    return load_sequence(path, default="hydmag")


@pytest.mark.parametrize("text, state", [(WAITS, "ended"), (FAILS, "failed")])
def test_rows_orders_and_events_are_those_of_the_bag(tmp_path, config, text, state):
    sequence = written(tmp_path, text)
    info = simulate(config, sequence, tmp_path / "bag", seed=3)
    bag = Bag(tmp_path / "bag")
    logged = recording_of(bag, load_rig("hydmag").transmission)
    run = record(config, sequence, seed=3)
    assert info["end"] == run.end and run.end["state"] == state
    assert run.recording.orders == logged.orders and [gear for *_, gear in logged.orders] == [1, 0, 2]
    for name, values in logged.channels.items():
        assert np.array_equal(run.recording.channels[name], values), name
    events = [(t, name, text, value) for t, topic, name, text, value in bag.events() if topic != "/rig/events"]
    # an event of the tick in which a run fails does not reach the bag
    assert sorted(events) == sorted(e for e in run.events if state == "ended" or e[0] <= events[-1][0])


def test_the_truth_stands_beside_the_rows(tmp_path, config):
    sequence = written(tmp_path, WAITS)
    config = with_overrides(config, {"effects.transducers": "off"})  # because an encoder rounds the speed to steps
    plain, run = record(config, sequence), record(config, sequence, plant_states=("s1_slip", "motor_torque", "gear_ordered"))
    channels = run.recording.channels
    assert all(np.array_equal(values, plain.recording.channels[name]) for name, values in channels.items())
    # wheel z3 on w0 less the intermediate shaft on wk
    slip = 34.0 / 47.0 * channels["n_wej"] - channels["n_wyj"]
    assert run.plant_states["s1_slip"].shape == slip.shape and np.abs(slip).max() > 5.0
    assert np.abs(run.plant_states["s1_slip"] - slip)[::10].max() < 1e-9, "in the first row of each millisecond"
    assert len(np.unique(run.plant_states["motor_torque"][20_000:20_010])) == 1 and run.plant_states["motor_torque"].max() > 5.0
    ordered = run.plant_states["gear_ordered"]
    assert ordered[np.flatnonzero(np.diff(ordered)) + 1].tolist() == [gear for *_, gear in run.recording.orders], "a command's"
    with pytest.raises(RigError, match="p1: only signals of state topics"):
        record(config, sequence, plant_states=("p1",))


def test_the_seed_is_that_of_the_noise(tmp_path, config):
    sequence = written(tmp_path, "description: x\nsteps: [{wait: {for: 20 ms}}]\n")
    first, again, other = (record(config, sequence, seed).recording.channels["p1"] for seed in (1, 1, 2))
    assert np.array_equal(first, again) and not np.array_equal(first, other)


def test_fewer_rows_are_every_tenth_of_them(tmp_path, config):
    sequence = written(tmp_path, "description: x\nsteps: [{oil: {pressure: 4 MPa}}, {wait: {for: 1200 ms}}]\n")
    whole, tenth = record(config, sequence), record(config, sequence, rows_per_second=1000)
    assert tenth.recording.period == 1e-3
    assert np.array_equal(tenth.recording.channels["p_p"], whole.recording.channels["p_p"][::10])


def test_every_row_of_a_kernel_at_125_khz(tmp_path):
    config = load_rig("hydmag", {"kernel.step": "8 us"})
    sequence = written(tmp_path, "description: x\nsteps: [{oil: {pressure: 4 MPa}}, {wait: {for: 95 ms}}]\n")
    recording = record(config, sequence, period=8e-6).recording
    assert recording.rows == 12_500  # 0.1 s, with the first tick
    supply = recording.channels["p_p"]
    # 50 ms time constant from 5 ms on: 4 MPa (1 - exp(-45/50)) at 50 ms
    assert supply[6250:6260].mean() == pytest.approx(4e6 * (1.0 - np.exp(-0.9)), rel=5e-3)
    with pytest.raises(RigError, match="step of 8 us does not divide the 100 us"):
        record(config, sequence)


@pytest.mark.parametrize("rows_per_second, sentence", [(1500, "do not fit into samples"), (40_000, "does not divide")])
def test_rows_that_fit_no_step_are_refused(tmp_path, config, rows_per_second, sentence):
    with pytest.raises(RigError, match=sentence):
        record(config, written(tmp_path, "description: x\nsteps: [{wait: {for: 20 ms}}]\n"), rows_per_second=rows_per_second)
