# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recordings on different clocks are aligned, and each difference appears in the rows of its quantity."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rig_nodes.analysis.alignment import CORRELATION, EVENTS, align
from rig_nodes.analysis.compare_tables import metric_tables, reasons
from rig_nodes.analysis.run_report import recording_of
from rig_nodes.analysis.side_by_side import Source, compare, short_names
from rig_nodes.bags.reader import Bag
from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import main
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.recorded import record
from rig_nodes.runs.sequence import load_sequence

SAMPLE = Path(__file__).parents[2] / "bags" / "sample"
OFFSET, DRIFT = 0.73, 50e-6


@pytest.fixture(scope="module")
def recording():
    bag = Bag(SAMPLE)
    return recording_of(bag, bag.transmission)


@pytest.fixture(scope="module")
def demo():
    """Two shifts under load."""
    return record(load_rig("hydmag"), load_sequence("demo", rig="hydmag")).recording


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
    shown = capsys.readouterr().out
    assert "offset +730." in shown
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
    assert text.count("<svg") == 2 and "http" not in text  # the figure of the one shift, wide and for a phone


def test_a_file_that_begins_after_the_first_order_has_the_shifts_that_it_holds(recording):
    other = on_other_clock(recording, orders=False)
    begin = round(0.5 / other.period)
    late = replace(
        other, t0=other.t0 + begin * other.period, channels={name: values[begin:] for name, values in other.channels.items()}
    )
    rig = Bag(SAMPLE).record
    found = compare([Source("run", recording, rig), Source("file", late, rig)])
    rows = [row for row in found.metrics if row["metric"] == "t_c_s"]
    assert len(recording.orders) == 2 and [row["shift"] for row in rows] == [1] and abs(rows[0]["difference"]) < 1e-3


def test_later_shifts_are_compared_from_their_own_orders(demo):
    """The second order comes 0.2 s later in the other run, which is else the same."""
    gap = round((demo.orders[2][0] - 0.5) / demo.period)
    spare = round(0.2 / demo.period)
    held = {name: np.concatenate([v[:gap], np.full(spare, v[gap]), v[gap:]]) for name, v in demo.channels.items()}
    *before, last = demo.orders
    other = replace(demo, channels=held, orders=[*before, (last[0] + 0.2, *last[1:])])
    rig = Bag(SAMPLE).record
    found = compare([Source("a", demo, rig), Source("b", other, rig)])
    assert found.clocks[1].rest == pytest.approx(0.2, abs=1e-6)
    after = last[0] - 0.15
    for curve in found.curves:
        mine, its = (values[curve.time > after] for values in curve.values)
        assert np.nanmax(np.abs(mine - its)) < 1e-6 * max(1.0, np.nanmax(np.abs(mine))), curve.name
    assert {row["difference"] for row in found.metrics if not row["reason"].startswith("both: ")} == {0.0}


def spoiled(recording, **changed):
    return replace(recording, channels={**recording.channels, **changed})


def test_a_burst_of_wrong_values_does_not_move_the_clock(demo):
    other = on_other_clock(demo, orders=False)
    name = other.transmission.input.torque
    values = other.channels[name].copy()
    at = round((demo.orders[1][0] + 0.4 + OFFSET - other.t0) / other.period)
    values[at : at + 800] = 9999.0
    clock = align(demo, spoiled(other, **{name: values}))
    assert clock.offset == pytest.approx(OFFSET, abs=1e-3) and clock.drift == pytest.approx(DRIFT, abs=20e-6)


def test_rows_that_are_missing_on_the_other_clock_are_named_and_the_shift_is_compared_from_its_own_order(demo):
    other = on_other_clock(demo, orders=False)
    at, lost = round((demo.orders[2][0] - 1.0 + OFFSET - other.t0) / other.period), 366
    shorter = {name: np.delete(values, np.s_[at : at + lost]) for name, values in other.channels.items()}
    clock = align(demo, replace(other, channels=shorter))
    _, first, second = (at for at, *_ in demo.orders)
    moved = [float(clock.of_first(np.array(at))) - at for at in (first, second)]
    assert moved[1] - moved[0] == pytest.approx(-lost * other.period, abs=2e-3)
    assert len(clock.notes) == 1 and "rows are missing" in clock.notes[0] and f"{second:.2f} s" in clock.notes[0]
    assert "ppm" not in clock.notes[0]


def test_signals_that_show_something_else_are_named(recording):
    other = on_other_clock(recording, orders=False)
    draw = np.random.default_rng(7)
    torque = other.transmission.input.torque
    clock = align(recording, spoiled(other, **{torque: draw.standard_normal(other.rows)}))
    assert clock.offset == pytest.approx(OFFSET, abs=2e-3) and any(torque in note for note in clock.notes)
    noise = {name: draw.standard_normal(other.rows) for name in other.channels}
    with pytest.raises(RigError, match=f"do not show the same shifts.*{torque}.*check the orders, columns and units") as refusal:
        align(recording, spoiled(other, **noise))
    assert "ppm" not in str(refusal.value) and "\n" not in str(refusal.value)


def test_every_empty_cell_has_its_reason_with_its_place(demo):
    at = round((demo.orders[2][0] + 0.3 - demo.t0) / demo.period)
    channels = {name: values.copy() for name, values in demo.channels.items()}
    for values in channels.values():
        values[at : at + 350] = np.nan
    rig = Bag(SAMPLE).record
    found = compare([Source("runs/a", demo, rig), Source("runs/b", replace(demo, channels=channels), rig)])
    assert all(row["reason"] for row in found.metrics if None in (row["first"], row["other"]))
    lines = reasons(found, demo.transmission)
    place = f"shift 2: no n_wej, M_wyj, t_d, .*: b: the file has no rows for 35 ms at {demo.orders[2][0] + 0.3:.2f} s"
    assert any(re.match(place, line) for line in lines), lines


def test_what_rounding_leaves_of_equal_values_is_no_difference(recording):
    almost = {name: values * (1.0 + 3e-16) for name, values in recording.channels.items()}
    rig = Bag(SAMPLE).record
    found = compare([Source("runs/a", recording, rig), Source("runs/b", replace(recording, channels=almost), rig)])
    assert {row["rms"] for row in found.signals} == {0.0}
    assert all(row["difference"] == 0.0 for row in found.metrics if row["difference"] is not None)
    head, rows = metric_tables(found, recording.transmission)[0]
    assert head[2:4] == ["a", "b"] and not any("e-" in cell for row in rows for cell in row)


def test_recordings_are_named_by_as_much_of_their_paths_as_tells_them_apart():
    assert short_names(["runs/demo-1", "runs/demo-2"]) == ["demo-1", "demo-2"]
    assert short_names(["a/demo", "b/demo"]) == ["a/demo", "b/demo"]
    assert short_names(["a/demo", "a/demo"]) == ["a/demo (1)", "a/demo (2)"]


def test_one_run_alone_and_other_orders_are_refused(recording, capsys):
    assert main(["compare", str(SAMPLE)]) == 2
    assert "name two or more" in capsys.readouterr().err
    with pytest.raises(Exception, match="align them by correlation"):
        align(recording, replace(recording, orders=recording.orders[:-1]), EVENTS)


def test_runs_that_took_other_times_between_orders_have_no_drift(recording):
    later = [(at + 0.1 * n, a, b) for n, (at, a, b) in enumerate(recording.orders)]
    clock = align(recording, replace(recording, orders=later))
    assert clock.drift == 0.0 and clock.rest == pytest.approx(0.1 * (len(later) - 1)) and len(later) > 1


def test_the_faults_of_compared_runs_are_told_of_each(tmp_path, capsys):
    sequence = tmp_path / "shift.yaml"
    shift = "[{oil: {pressure: 4 MPa}}, {wait: {for: 300 ms}}, {shift: {to: I}}, {wait: {for: 800 ms}}]"
    sequence.write_text(f"description: one shift\nsteps: {shift}\n")
    runs = {"healthy": [], "ill": ["--fault", "clutch_s1.worn,at=0.5s", "--fault", "motor.weak,at=99s"], "also": []}
    for name, faults in runs.items():
        assert main(["simulate", str(sequence), *faults, "--out", str(tmp_path / name)]) == 0
    both = [str(tmp_path / "healthy"), str(tmp_path / "ill")]
    capsys.readouterr()
    assert main(["compare", *both, "--json", str(tmp_path / "out.json"), "--html", str(tmp_path / "out.html")]) == 0
    worn = "ill: fault injected: clutch_s1.worn: thickness that the whole pack has lost 0.8 mm, abrupt, from 0.500 s on"
    told = ["healthy: no fault injected", f"{worn}; fault ordered, but never begun: motor.weak, at=99s"]
    shown = capsys.readouterr().out
    assert all(f"\n  {line}\n" in shown for line in told) and told[1] in (tmp_path / "out.html").read_text()
    assert json.loads((tmp_path / "out.json").read_text())["starts"][:2] == told
    assert main(["compare", both[0], str(tmp_path / "also")]) == 0
    assert "fault" not in capsys.readouterr().out
