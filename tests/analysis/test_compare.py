# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recordings on different clocks are aligned, and each difference appears in the rows of its quantity."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rig_nodes.analysis.alignment import CORRELATION, EVENTS, align
from rig_nodes.analysis.report import recording_of
from rig_nodes.analysis.side_by_side import Source, compare
from rig_nodes.bags.reader import Bag
from rig_nodes.cli.main import main

SAMPLE = Path(__file__).parents[2] / "bags" / "sample"
OFFSET, DRIFT = 0.73, 50e-6


@pytest.fixture(scope="module")
def recording():
    bag = Bag(SAMPLE)
    return recording_of(bag, bag.transmission)


def on_other_clock(recording, noise=0.0, orders=True):
    """Returns the recording as a logger with another zero and a faster clock would have written it, with noise of its own."""
    own = recording.t0 + recording.period * np.arange(recording.rows)
    t = np.arange(own[0] * (1.0 + DRIFT) + OFFSET, own[-1] * (1.0 + DRIFT) + OFFSET, recording.period)
    draw = np.random.default_rng(4)
    channels = {
        name: np.interp((t - OFFSET) / (1.0 + DRIFT), own, values) + noise * np.std(values) * draw.standard_normal(len(t))
        for name, values in recording.channels.items()
    }
    moved = [(at * (1.0 + DRIFT) + OFFSET, a, b) for at, a, b in recording.orders]
    return replace(recording, t0=float(t[0]), channels=channels, orders=moved if orders else [])


@pytest.mark.parametrize(("by", "noise", "ppm"), [(EVENTS, 0.0, 0.1), (CORRELATION, 0.0, 1.0), (CORRELATION, 0.02, 20.0)], ids=str)
def test_a_known_offset_and_drift_are_found(recording, by, noise, ppm):
    clock = align(recording, on_other_clock(recording, noise), by)
    assert clock.by == by
    assert clock.offset == pytest.approx(OFFSET, abs=1e-3)
    assert clock.drift * 1e6 == pytest.approx(DRIFT * 1e6, abs=ppm)


def test_without_orders_the_recordings_are_aligned_by_correlation(recording):
    assert align(recording, on_other_clock(recording, orders=False)).by == CORRELATION


def written(recording, path, catalogue, torque=0.0):
    """Writes a recording as a logger's CSV without orders, with a torque added to the output [Nm]."""
    names = list(recording.transmission.channels)
    heads = [f"{name} [{catalogue.signal(name).display_unit}]" for name in names]
    columns = [catalogue.signal(name).shown(recording.channels[name]) for name in names]
    columns[names.index(recording.transmission.output.torque)] = columns[names.index(recording.transmission.output.torque)] + torque
    t = recording.t0 + recording.period * np.arange(recording.rows)
    table = np.column_stack([t, *columns])[::5]
    np.savetxt(path, table, "%.7g", ";", header="t [s];" + ";".join(heads), comments="")


def test_a_measurement_over_a_run_shows_what_differs_in_the_rows_concerned(recording, tmp_path, capsys):
    path, out = tmp_path / "measured.csv", tmp_path / "out.json"
    written(on_other_clock(recording), path, Bag(SAMPLE).catalogue, torque=5.0)
    page = tmp_path / "out.html"
    assert main(["compare", str(SAMPLE), str(path), "--json", str(out), "--html", str(page)]) == 0
    assert "offset +730." in capsys.readouterr().out
    content = json.loads(out.read_text())
    assert content["offset_s"] == pytest.approx([0.0, OFFSET], abs=1e-3)
    torque = recording.transmission.output.torque
    rows = {row["signal"]: row for row in content["signals"]}
    assert rows[torque]["mean"] == pytest.approx(5.0, abs=0.1) and rows[torque]["in_errors"] > 3.0
    assert max(row["in_errors"] for name, row in rows.items() if name != torque and row["in_errors"] is not None) < 1.0
    metrics = {row["metric"]: row for row in content["metrics"]}
    assert metrics["output_torque_nm"]["difference"] == pytest.approx(5.0, abs=0.2)
    assert abs(metrics["t_c_s"]["difference"]) < 1e-3
    text = page.read_text()
    assert text.count("<svg") == 2 * len(rows) and "http" not in text


def test_a_measurement_over_a_run_has_a_view(recording, tmp_path):
    pytest.importorskip("rerun")
    path, view = tmp_path / "measured.csv", tmp_path / "out.rrd"
    written(on_other_clock(recording), path, Bag(SAMPLE).catalogue)
    assert main(["compare", str(SAMPLE), str(path), "--rrd", str(view)]) == 0
    assert view.stat().st_size > 10_000


def test_a_file_that_begins_after_the_first_order_has_the_shifts_that_it_holds(recording):
    other = on_other_clock(recording, orders=False)
    begin = round(0.5 / other.period)
    late = replace(
        other, t0=other.t0 + begin * other.period, channels={name: values[begin:] for name, values in other.channels.items()}
    )
    record = Bag(SAMPLE).record
    found = compare([Source("run", recording, record), Source("file", late, record)])
    rows = [row for row in found.metrics if row["metric"] == "t_c_s"]
    assert len(recording.orders) == 2 and [row["shift"] for row in rows] == [1] and abs(rows[0]["difference"]) < 1e-3


def test_one_run_alone_and_other_orders_are_refused(recording, capsys):
    assert main(["compare", str(SAMPLE)]) == 2
    assert "name two or more" in capsys.readouterr().err
    with pytest.raises(Exception, match="align them by correlation"):
        align(recording, replace(recording, orders=recording.orders[:-1]), EVENTS)


def test_runs_that_took_other_times_between_orders_have_no_drift(recording):
    later = [(at + 0.1 * n, a, b) for n, (at, a, b) in enumerate(recording.orders)]
    clock = align(recording, replace(recording, orders=later))
    assert clock.drift == 0.0 and clock.rest == pytest.approx(0.1 * (len(later) - 1)) and len(later) > 1
