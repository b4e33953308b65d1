# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A run is exported to files of other tools and imported again without a change."""

from __future__ import annotations

import csv
import json
import sys

import numpy as np
import pytest
from laboratory import SAMPLE
from small import measured, table

from rig_nodes import api
from rig_nodes.analysis.metrics import metric_keys
from rig_nodes.bags.exchange import groups
from rig_nodes.bags.exchange.groups import Signals, on_one_clock, on_own_clocks
from rig_nodes.bags.reader import Bag
from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import main

from ..dated import with_dates


@pytest.fixture(scope="module")
def bag():
    return Bag(SAMPLE)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("exported")


def exported(kind, folder):
    path = folder / f"sample.{kind}"
    if not path.exists():
        assert main(["export", kind, str(SAMPLE), "--out", str(path)]) == 0
    return path


@pytest.mark.parametrize("kind", ["csv", "parquet", "mat", "mf4"])
def test_an_exported_run_comes_back_with_the_same_bits_and_orders_and_its_metrics(kind, folder, bag, tmp_path):
    assert main(["import", str(exported(kind, folder)), "--out", str(tmp_path / "back")]) == 0
    back, ours = Bag(tmp_path / "back"), bag.logger()
    theirs = back.logger()
    assert (theirs.t0, theirs.period) == (ours.t0, ours.period) and {*ours.channels} < {*theirs.channels}
    for name, values in ours.channels.items():
        assert np.array_equal(theirs.channels[name], values), name
    assert np.allclose(theirs.channels["p_p"][::100], bag.series("p_p")[1][: -(-theirs.rows // 100)])
    assert back.events() == bag.events() and back.record == bag.record
    info = back.run_info()
    assert info["seed"] == bag.run_info()["seed"] and info["imported"]["rig_named_by"] == "the exported run"
    reports = [json.loads((one / "report.json").read_text()) for one in (SAMPLE, tmp_path / "back")]
    measured = [key for key in metric_keys() if key not in ("why", "undefined")]
    assert len(reports[1]["shifts"]) == len(reports[0]["shifts"]) > 0
    for row, recorded in zip(reports[1]["shifts"], reports[0]["shifts"]):
        for key in measured:
            # the sample's report may have been made on another type of processor, on which numpy adds in another order
            told = recorded[key]
            assert row[key] == (pytest.approx(told, rel=1e-9, abs=1e-12) if isinstance(told, float) else told), key


def test_a_csv_is_plain_and_the_file_beside_it_describes_it(folder, bag):
    path = exported("csv", folder)
    with open(path, newline="") as file:
        rows = list(csv.DictReader(file))
    torque = [float(row["M_wej [Nm]"]) for row in rows if row["M_wej [Nm]"]]
    assert np.array_equal(torque, bag.logger().channels["M_wej"])
    slip = [(float(row["t [s]"]), float(row["s1_slip [rad/s]"])) for row in rows if row["s1_slip [rad/s]"]]
    assert np.array_equal(np.array(slip).T, bag.series("s1_slip"))
    about = json.loads((folder / "sample.csv-metadata.json").read_text())
    assert about["url"] == "sample.csv" and [one["titles"] for one in about["tableSchema"]["columns"]] == list(rows[0])
    assert about["rig:rig"] == "hydmag" and about["rig:seed"] == "1"


def test_what_lies_beside_a_csv_of_another_content_is_not_taken_for_its_description(tmp_path):
    exported("csv", tmp_path)
    with pytest.raises(RigError, match="sample.csv-metadata.json: describes a run whose CSV file had another content; delete it"):
        measured(tmp_path, table(), name="sample.csv")
    (tmp_path / "sample.csv-metadata.json").unlink()
    assert measured(tmp_path, table(), name="sample.csv").events == []


def test_other_tools_find_units_and_provenance(folder, bag):
    parquet = pytest.importorskip("pyarrow.parquet").read_table(exported("parquet", folder))
    assert parquet.schema.field("p1").metadata[b"unit"] == b"Pa" and parquet.schema.metadata[b"rig"] == b"hydmag"
    assert np.array_equal(parquet.column("p1").drop_null().to_numpy(), bag.logger().channels["p1"])
    from scipy.io import loadmat

    found = loadmat(exported("mat", folder), simplify_cells=True)
    rows = found["instruments_hmg4000"]
    assert rows["units"]["p1"] == "Pa" and np.array_equal(rows["p1"], bag.logger().channels["p1"])
    assert found["rig_nodes_run"]["rig"] == "hydmag" and found["motor_command"]["names"]["motor_command"] == "motor.command"
    from asammdf import MDF

    with MDF(exported("mf4", folder)) as file:
        signal = file.get("p1")
        assert signal.unit == "Pa" and np.array_equal(signal.samples, bag.logger().channels["p1"])
        assert len(file.get("s1_slip").timestamps) == bag.counts["/clutch_s1/state"] and "rig: hydmag" in file.header.comment


def test_a_chosen_clock_gives_full_rows_in_the_units_of_people(folder, bag):
    path = folder / "five.csv"
    options = ["--signals", "p?,n_wej", "--clock", "5 ms", "--units", "shown"]
    assert main(["export", "csv", str(SAMPLE), "--out", str(path), *options]) == 0
    table = np.genfromtxt(path, delimiter=",", names=True, deletechars="")
    assert table.dtype.names == ("t_[s]", "n_wej_[rpm]", "p1_[MPa]", "p2_[MPa]")
    rows = bag.logger()
    assert np.allclose(np.diff(table["t_[s]"]), 5e-3)
    assert np.allclose(table["p1_[MPa]"], rows.channels["p1"][::50][: len(table)] * 1e-6)


def test_of_a_bag_whose_log_times_are_dates_time_counts_from_its_begin(bag, tmp_path):
    dated, told = with_dates(SAMPLE, tmp_path / "dated.mcap"), []
    for kind in ("csv", "mat", "mf4", "blf"):
        api.exported(dated, tmp_path / f"dated.{kind}", watch=lambda of: lambda done, text: told.append((of, done, text)))
    length = bag.last / 1e9
    whole = length, length, f"read up to {length:.0f} of {length:.0f} s"
    assert told == [whole, whole, whole, (None, length, f"read up to {length:.0f} s")]
    from asammdf import MDF

    with MDF(tmp_path / "dated.mf4") as file:
        assert file.header.start_time.timestamp() == pytest.approx(dated.stat().st_mtime - length, abs=1.0)


@pytest.mark.parametrize("clock", [None, 7_000_000])
def test_rows_do_not_depend_on_the_pieces_in_which_a_bag_is_read(monkeypatch, clock):
    def table():
        signals = Signals(SAMPLE, ["M_wej", "s1_*", "gear*", "motor.command"])
        parts = signals.parts()
        found = list(on_own_clocks(signals.groups, parts) if clock is None else on_one_clock(signals.groups, parts, clock))
        return len(found), np.concatenate([one.times for one in found]), np.concatenate([one.values for one in found])

    monkeypatch.setattr(groups, "LATE", 50_000_000)
    _, times, values = table()
    monkeypatch.setattr(groups, "IN_MEMORY", 1 << 17)
    pieces, other_times, other_values = table()
    assert pieces > 5 and np.all(np.diff(times) > 0)
    assert np.array_equal(times, other_times) and np.array_equal(values, other_values, equal_nan=True)


@pytest.mark.parametrize(
    "words, sentence",
    [
        ("csv nowhere --out new.csv", "nowhere: there is no such file or folder"),
        ("csv {run} --signals M_we --out new.csv", "has no signal 'M_we'; did you mean 'M_wej'"),
        ("csv {run} --signals x* --out new.csv", "has no signal 'x*'"),
        ("csv {run} --out there.csv", "there.csv: it exists; remove it first, or name another file"),
        ("mat {run} --out new.csv", "export mat writes a file that ends in .mat"),
        ("parquet {run} --out none/new.parquet", "there is no folder none"),
        ("csv {run} {run} --out new.csv", "export csv takes one run"),
        ("mat {run} --clock 5ms --out new.mat", "--clock is for csv and parquet"),
        ("csv {run} --clock 5Nm --out new.csv", "--clock: '5Nm' is a torque, expected a time"),
        ("csv {run} --clock 0 --out new.csv", "--clock: '0' has no unit, expected a time (s, ms, us, min)"),
        ("csv {run} --clock=-5ms --out new.csv", "--clock is '-5ms', expected a time of at least 1 us, e.g. '5 ms'"),
        ("csv {run} --clock nan --out new.csv", "--clock: 'nan' is not a time; write a number with its unit"),
        ("csv {run} --signals , --out new.csv", "--signals names none"),
        ("csv {run} --rig clutch_bench --out new.csv", "a run has its own rig"),
        ("dbc --signals p1", "are for runs (csv, parquet, mf4, mat), not for dbc"),
        ("csv {cut} --out new.csv", "have it recovered|rig bag recover|cut"),
        ("csv {events} --out new.csv", "events_0.mcap: its record of the rig cannot be used (ValueError: there is none"),
    ],
)
def test_what_cannot_be_exported_is_told_in_one_sentence_and_leaves_nothing(words, sentence, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "there.csv").write_text("mine")
    whole = (SAMPLE / "sample_0.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(whole[: len(whole) // 2])
    assert main(["bag", "cut", str(SAMPLE), "--out", "events", "--topics", "/controller/events"]) == 0
    before = sorted(path.name for path in tmp_path.iterdir())
    assert main(["export", *words.format(run=SAMPLE, cut="cut.mcap", events="events").split()]) == 2
    error = capsys.readouterr().err.splitlines()
    assert any(part in error[-1] for part in sentence.split("|")), error
    assert sorted(path.name for path in tmp_path.iterdir()) == before and (tmp_path / "there.csv").read_text() == "mine"


def test_without_asammdf_one_sentence_says_how_to_get_it(monkeypatch, tmp_path, capsys):
    monkeypatch.setitem(sys.modules, "asammdf", None)
    assert main(["export", "mf4", str(SAMPLE), "--out", str(tmp_path / "a.mf4")]) == 2
    assert "the Python package asammdf is not installed; pip install 'rig_nodes[mdf]'" in capsys.readouterr().err and not list(
        tmp_path.iterdir()
    )


def test_a_pyarrow_for_another_numpy_is_said_with_the_one_that_fits(monkeypatch, tmp_path, capsys):
    for name in [name for name in sys.modules if name.partition(".")[0] == "pyarrow"]:
        monkeypatch.delitem(sys.modules, name)
    (tmp_path / "pyarrow.py").write_text('raise ImportError("pyarrow requires NumPy 2.0 or newer, found 1.26.4")')
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr("numpy.__version__", "1.26.4")
    assert main(["export", "parquet", str(SAMPLE), "--out", str(tmp_path / "a.parquet")]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert "requires NumPy 2.0 or newer" in lines[-1] and "pip install pyarrow 'numpy<2' 'pyarrow<26'" in lines[-1]
    assert not (tmp_path / "a.parquet").exists()
