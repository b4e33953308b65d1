# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""MDF files of all versions are read with what they say about their samples: validity, statuses, groups, axes and date."""

from __future__ import annotations

import os
from datetime import UTC, datetime

import asammdf
import can
import numpy as np
import pytest

from rig_nodes.bags.exchange.foreign import read_foreign
from rig_nodes.bags.reader import Bag
from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import main

T = np.arange(400) * 2e-3
HEADS = {"M_wej": "Nm", "n_wej": "1/min", "M_wyj": "Nm", "n_wyj": "1/min", "p1": "bar", "p2": "bar"}
COLUMNS = "columns: {M_wej: M_wej, p1: p1}\n"


def values(name):
    return 10.0 + len(name) + np.sin(3.0 * T + len(name)) + (name == "p2")


def signal(name, unit="bar", samples=None, t=T, **more):
    return asammdf.Signal(values(name) if samples is None else samples, t, unit, name, **more)


def written(path, *groups, version="4.10", change=lambda mdf: None):
    """Writes groups of signals, or (signals, name of the group), and returns the file."""
    with asammdf.MDF(version=version) as mdf:
        for group in groups:
            signals, name = group if isinstance(group, tuple) else (group, None)
            mdf.append(signals, acq_name=name)
        change(mdf)
        made = mdf.save(path.with_suffix(".mf4" if version >= "4" else ".mdf"), overwrite=True)
    os.replace(made, path)
    return path


def imported(path, *words, profile=None):
    if profile:
        (path.parent / "p.yaml").write_text("rig: hydmag\n" + profile)
        words = (*words, "--profile", str(path.parent / "p.yaml"))
    assert main(["import", str(path), "--out", str(path.parent / "run"), *words]) == 0
    return Bag(path.parent / "run").logger()


@pytest.mark.parametrize(
    "version, ending",
    [
        ("2.00", ".dat"),
        ("2.14", ".mdf"),
        ("3.00", ".dat"),
        ("3.10", ".MDF"),
        ("3.20", ".mdf"),
        ("3.30", ".dat"),
        ("4.00", ".mf4"),
        ("4.10", ".mf4"),
        ("4.11", ".mdf"),
        ("4.20", ".mf4"),
        ("4.11", ".recorded"),
    ],
)
def test_an_mdf_file_of_any_version_and_ending_is_read(version, ending, tmp_path):
    path = written(tmp_path / f"a{ending}", [signal(name, unit) for name, unit in HEADS.items()], version=version)
    rows = imported(path, "--rig", "hydmag")
    assert rows.period == 2e-3 and {*rows.channels} == {*HEADS}
    assert np.allclose(rows.channels["M_wej"], values("M_wej")) and np.allclose(rows.channels["p2"], 1e5 * values("p2"))
    assert np.allclose(rows.channels["n_wej"], values("n_wej") * np.pi / 30.0)


def test_samples_that_the_file_marks_invalid_are_missing_and_only_short_gaps_are_bridged(tmp_path, capsys):
    invalid = np.zeros(len(T), bool)
    invalid[100], invalid[200:240] = True, True
    wrong = np.where(invalid, 9999.0, values("M_wej"))
    path = written(tmp_path / "a.mf4", [signal("M_wej", "Nm", wrong, invalidation_bits=invalid), signal("p1")])
    rows = imported(path, profile="bridge: 5 ms\n" + COLUMNS)
    assert (
        "41 of 800 values are missing: 1 were bridged by straight lines, 40 in gaps over 5 ms stay empty" in capsys.readouterr().out
    )
    torque = rows.channels["M_wej"]
    assert np.flatnonzero(np.isnan(torque)).tolist() == list(range(200, 240)) and np.nanmax(torque) < 20.0
    assert torque[100] == pytest.approx((torque[99] + torque[101]) / 2.0) and not np.isnan(rows.channels["p1"]).any()


def test_gaps_in_the_group_of_another_clock_stay_empty_and_are_counted(tmp_path, capsys):
    invalid = np.zeros(len(T), bool)
    invalid[100], invalid[200:240] = True, True
    kept = np.delete(np.arange(len(T)), [10, *range(300, 320)])
    path = written(
        tmp_path / "a.mf4",
        [signal("M_wej", "Nm")],
        [signal("p1", samples=np.where(invalid, 9999.0, values("p1"))[kept], t=T[kept], invalidation_bits=invalid[kept])],
    )
    rows = imported(path, profile="bridge: 5 ms\n" + COLUMNS)
    assert "62 of 800 values are missing: 2 were bridged by straight lines, 60 in gaps over 5 ms" in capsys.readouterr().out
    pressure = rows.channels["p1"]
    assert np.flatnonzero(np.isnan(pressure)).tolist() == [*range(200, 240), *range(300, 320)] and np.nanmax(pressure) < 20e5
    assert not np.isnan(rows.channels["M_wej"]).any()


@pytest.mark.parametrize("version", ["3.30", "4.10"])
def test_texts_are_read_as_gears_and_named_when_they_are_left_out(version, tmp_path, capsys):
    gears = signal("gear", "", np.array([b"I"] * 100 + [b"II"] * 300), encoding="utf-8")
    status = signal("status", "", np.array([b"OK"] * 400), encoding="utf-8")
    path = written(tmp_path / "a.dat", [signal("M_wej", "Nm"), signal("p1"), gears, status], version=version)
    imported(path, profile="gear: gear\n" + COLUMNS)
    assert "1 column was left out: 'status' (text)" in capsys.readouterr().out
    assert [(round(t, 3), name) for t, _, name, _, _ in Bag(tmp_path / "run").events()][-1] == (0.2, "shift_ordered")
    with pytest.raises(RigError, match="holds no channel of numbers"):
        read_foreign(written(tmp_path / "b.dat", [status], version=version))


def test_a_channel_without_any_valid_sample_has_no_values(tmp_path):
    def invalid(mdf):
        mdf.groups[0].channels[1].flags |= 1

    path = written(tmp_path / "a.mf4", [signal("M_wej"), signal("p1")], change=invalid)
    found = {one.name: one.values for one in read_foreign(path).channels}
    assert np.isnan(found["M_wej"]).all() and np.allclose(found["p1"], values("p1"))


@pytest.mark.parametrize(
    "texts",
    [
        {"lower_0": 65534, "upper_0": 65535, "text_0": b"sensor error"},
        {"val_0": 65534, "text_0": b"sensor error", "val_1": 65535, "text_1": b"not available"},
    ],
    ids=["range", "values"],
)
def test_a_status_in_place_of_a_value_is_missing_but_an_enumeration_is_read(texts, tmp_path):
    raw = np.arange(len(T)).astype("<u2")
    raw[[7, 9]] = 65534, 65535
    formula = {**texts, "default_addr": {"a": 0.1, "b": 1.0}}
    gear = {"val_0": 1, "text_0": b"I", "val_1": 2, "text_1": b"II"}
    states = (1 + (T > 0.4)).astype("<u1")
    path = written(
        tmp_path / "a.mf4",
        [signal("p1", "bar", raw, conversion=formula, raw=True), signal("gear", "", states, conversion=gear, raw=True)],
    )
    pressure, gears = (one.values for one in read_foreign(path).channels)
    assert np.flatnonzero(np.isnan(pressure)).tolist() == [7, 9] and pressure[20] == pytest.approx(3.0)
    assert np.array_equal(gears, states)


def test_two_channels_of_one_name_have_their_groups_name_and_neither_is_taken_unasked(tmp_path, capsys):
    other = np.full(len(T), 50.0)
    for version, names, chosen in (("4.10", ("ECU", "bench"), "bench/p1"), ("3.30", (None, None), "group 2/p1")):
        folder = tmp_path / version
        folder.mkdir()
        groups = [([signal("p1", "bar", other), signal("M_wej", "Nm")], names[0]), ([signal("p1", t=T + 1e-4)], names[1])]
        path = written(folder / "a.mdf", *groups, version=version)
        (folder / "p.yaml").write_text("rig: hydmag\n" + COLUMNS)
        assert main(["import", str(path), "--profile", str(folder / "p.yaml"), "--out", str(folder / "run")]) == 2
        error = capsys.readouterr().err
        assert "'p1' is there 2 times, as '" in error and f"'{chosen}'; name one of these" in error and error.count("\n") == 1
        rows = imported(path, profile=COLUMNS.replace("p1: p1", f"{chosen}: p1"))
        assert np.nanmax(rows.channels["p1"]) == pytest.approx(1e5 * values("p1").max(), rel=1e-3)
        assert "1 column was left out: '" in capsys.readouterr().out


def test_two_channels_of_one_name_in_one_group_are_told_apart(tmp_path):
    path = written(tmp_path / "a.mf4", [signal("p1"), signal("p1", samples=2.0 * values("p1"))])
    assert [one.head for one in read_foreign(path).channels] == ["group 1.1/p1", "group 1.2/p1"]


@pytest.mark.parametrize("kind, word", [(2, "an angle"), (3, "a distance"), (4, "a number of samples")])
def test_what_is_recorded_over_something_else_than_time_is_not_taken_as_seconds(kind, word, tmp_path, capsys):
    def other_axis(mdf):
        mdf.groups[0].channels[0].sync_type = kind

    path = written(
        tmp_path / "a.mf4", [signal("M_wej", "Nm"), signal("p1"), signal("clock", "ms", 2.0 * np.arange(len(T)))], change=other_axis
    )
    (tmp_path / "p.yaml").write_text("rig: hydmag\n" + COLUMNS)
    assert main(["import", str(path), "--profile", str(tmp_path / "p.yaml"), "--out", str(tmp_path / "no")]) == 2
    error = capsys.readouterr().err
    assert f"'M_wej' is recorded over {word} ('time' in s) and not over time; name a column of times" in error
    rows = imported(path, profile="time: {column: clock, unit: ms}\n" + COLUMNS)
    assert rows.period == 2e-3 and np.allclose(rows.channels["M_wej"], values("M_wej"))


def test_the_unit_of_the_axis_counts_in_versions_without_a_kind_of_axis(tmp_path):
    def unit_of_axis(unit):
        def change(mdf):
            mdf.groups[0].channels[0].conversion.unit = unit

        return change

    for unit, times, over in (("deg", False, "a quantity ('time' in deg)"), ("ms", True, "")):
        found = read_foreign(written(tmp_path / "a.dat", [signal("p1")], version="3.30", change=unit_of_axis(unit))).channels[0]
        assert (found.times is not None, found.over) == (times, over)
    assert found.times[1] == pytest.approx(2e-6)


@pytest.mark.filterwarnings("error")
def test_frames_of_a_bus_and_a_damaged_file_are_refused_in_one_sentence(tmp_path):
    with can.MF4Writer(tmp_path / "bus.mf4") as log:
        for k in range(5):
            log.on_message_received(can.Message(arbitration_id=0x101, data=bytes(8), timestamp=1.0 + k, channel=0))
    with pytest.raises(RigError, match=r"holds frames of a bus and no signals; decode it with the bus's database"):
        read_foreign(tmp_path / "bus.mf4")
    path = written(tmp_path / "a.mf4", [signal("p1")])
    path.write_bytes(path.read_bytes()[:300])
    with pytest.raises(RigError, match="cannot be read as MDF of version 2.00 to 4.20"):
        read_foreign(path)


def test_an_exported_run_has_the_date_of_the_run_or_of_the_measurement(tmp_path):
    recorded = datetime(2021, 5, 4, 12, 0, tzinfo=UTC)

    def dated(mdf):
        mdf.header.start_time = recorded

    imported(written(tmp_path / "a.mf4", [signal("M_wej", "Nm"), signal("p1")], change=dated), profile=COLUMNS)
    run, bag = tmp_path / "run", next((tmp_path / "run").glob("*.mcap"))
    assert main(["export", "mf4", str(run), "--out", str(tmp_path / "b.mf4")]) == 0
    with asammdf.MDF(tmp_path / "b.mf4") as mdf:
        assert mdf.header.start_time == recorded
    (tmp_path / "undated").mkdir()
    imported(
        written(
            tmp_path / "undated" / "a.mf4",
            [signal("M_wej", "Nm"), signal("p1")],
            change=lambda mdf: setattr(mdf.header, "start_time", datetime(1970, 1, 1, tzinfo=UTC)),
        ),
        profile=COLUMNS,
    )
    bag = next((tmp_path / "undated" / "run").glob("*.mcap"))
    os.utime(bag, (1.7e9, 1.7e9))
    assert main(["export", "mf4", str(bag.parent), "--out", str(tmp_path / "c.mf4")]) == 0
    with asammdf.MDF(tmp_path / "c.mf4") as mdf:
        assert mdf.header.start_time.timestamp() == pytest.approx(1.7e9 - T[-1], abs=0.1)


@pytest.mark.parametrize("version", ["3.30", "4.10"])
def test_a_file_with_fewer_records_than_it_states_is_refused(version, tmp_path):
    def longer(mdf):
        mdf.groups[0].channel_group.cycles_nr += 50000

    path = written(tmp_path / "a.mdf", [signal("M_wej", "Nm"), signal("p1")], version=version, change=longer)
    with pytest.raises(RigError, match="group 1 holds fewer records than the 50400 that it states; the file is cut off"):
        read_foreign(path)
