# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A value that is no finite number ends every verb that moves a rig: a sentence with name and time, and exit code 1.

No setting of the rig causes such a value; the tests write it into the plant's state. tests/graph/test_cut.py tests this on the
graph, tests/fmu/test_rig_fmu.py in the FMU.
"""

import json

import numpy as np
import pytest

from rig_nodes.bags.reader import Bag
from rig_nodes.cli.main import main
from rig_nodes.rigs.hydmag.laboratory.calibration_rows import STAGES_FILE, Miss, calibration
from rig_nodes.runs import conformance
from rig_nodes.runs.rig import Rig
from rig_nodes.runs.trips import Tripped
from rig_nodes.studies.tune.bench import Bench, Point
from rig_nodes.studies.validation.calibrate import search


@pytest.fixture
def spoil(monkeypatch):
    """Makes a heat of every rig in this process NaN in the first step after a sample."""
    advance = Rig.advance_samples

    def spoil(after, only=lambda rig: True):
        def advance_spoiled(rig, samples=1):
            if rig.sample <= after < rig.sample + samples:
                first = after - rig.sample
                advance(rig, first)
                samples -= first
            if rig.sample >= after and only(rig):
                rig.clutches[1]["heat"] = np.nan
            advance(rig, samples)

        monkeypatch.setattr(Rig, "advance_samples", advance_spoiled)

    return spoil


def printed(capsys):
    """Returns the last sentence that a verb has printed for people, and all of its output."""
    out = capsys.readouterr()
    return out.err.splitlines()[-1], out


def test_all_runs_of_a_procedure_are_named_and_their_bags_are_whole(tmp_path, capsys, spoil):
    spoil(800)
    assert main(["procedure", "delay_series", "--series", "19", "--out", str(tmp_path / "p")]) == 1
    errors = capsys.readouterr().err.splitlines()
    assert [line.partition(": clutch_s1")[0] for line in errors] == ["rig: series 19"] * 2
    for folder in sorted(path for path in (tmp_path / "p").iterdir() if path.is_dir()):
        end = json.loads((folder / "report.json").read_text())["run"]["end"]
        assert end["state"] == "tripped" and "between 0.800 s and 0.801 s" in end["reason"]
        bag = Bag(folder)
        assert bag.check() == []
        assert all(np.isfinite(bag.series(name)[1]).all() for name in ("M_wej", "n_wej", "n_wyj", "p1", "p2"))


@pytest.mark.parametrize("bags", [[], ["--bags"]], ids=["table", "bags"])
def test_a_member_of_a_sweep_that_trips_is_a_row_with_the_reason(tmp_path, capsys, spoil, bags):
    pq = pytest.importorskip("pyarrow.parquet")
    spoil(300, lambda rig: rig.config.alfa46.values.t12 > -0.22)
    sweep = ["sweep", "sample", "--vary", "alfa46.t12=-250 ms, -200 ms", "--jobs", "1", *bags, "--out"]
    assert main([*sweep, str(tmp_path / "s")]) == 0, "a sweep goes on past a row that trips"
    assert "1 did not end: clutch_s2: temperature became nan between 0.300 s and 0.301 s" in capsys.readouterr().out
    rows = pq.read_table(tmp_path / "s" / "results.parquet").to_pylist()
    assert [row["end"] for row in rows] == ["ended", "tripped"]
    assert "between 0.300 s and 0.301 s" in rows[1]["reason"] and rows[1]["t_c_s"] is None
    spoil(300)
    assert main([*sweep, str(tmp_path / "none")]) == 1, "none of it came to its end"


def test_rows_of_runs_that_trip_are_not_inside_and_validate_fails(tmp_path, capsys, spoil):
    spoil(800)
    rows = tmp_path / "rows.json"
    assert main(["validate", "--rows", "delay_up_dip_begins", "delay_down_peak_19", "--jobs", "1", "--json", str(rows)]) == 1
    last, out = printed(capsys)
    assert "rig: 42 of the runs tripped, the first one delay_series 1: clutch_s1: temperature became nan" in last
    content = json.loads(rows.read_text())
    assert {row["verdict"] for row in content["rows"]} == {"not compared"}
    assert "delay_down_peak_19" in out.out and "between 0.800 s and 0.801 s" in out.out


@pytest.mark.parametrize("stage", ["losses", "clutches"])
def test_a_calibration_on_a_rig_that_trips_ends_and_changes_nothing(tmp_path, capsys, spoil, stage):
    spoil(1500)
    before = STAGES_FILE.read_bytes()
    assert main(["calibrate", "--stages", stage, "--generations", "0", "--jobs", "1", "--json", str(tmp_path / "c.json")]) == 1
    last, _ = printed(capsys)
    assert "rig: the rig tripped: clutch_s1: temperature became nan between 1.500 s and 1.501 s" in last
    assert not (tmp_path / "c.json").exists() and STAGES_FILE.read_bytes() == before


def test_a_search_goes_past_rigs_that_trip(config):
    loss = calibration().stages["losses"]["loss_at_rest"]

    def misses(rig):
        if rig.loss_in.at_rest > 5.0:
            raise Tripped("the rig tripped")
        return [Miss("row", 0.0, rig.loss_in.at_rest - 4.0)]

    assert loss.high > 6.0
    assert search(config, {"loss_at_rest": loss}, misses, 10, 1, 1)["loss_at_rest"] == pytest.approx(4.0, abs=0.01)


def test_settings_that_trip_the_rig_are_no_shift_on_the_tuners_bench(config, spoil):
    bench, point = Bench(config), Point("I-II", 150.0, 40.0)
    sound = bench.shift(point, config.alfa46)
    assert sound.valid and not sound.tripped
    spoil(bench._rig.sample - 200)  # after all measured events, before the window ends
    shift = bench.shift(point, config.alfa46)
    assert shift.tripped and not shift.valid and shift.peak is None
    assert shift.why.startswith("the rig tripped: clutch_s1: temperature became nan between ")


def test_a_tuning_of_a_rig_that_trips_says_so(tmp_path, capsys, spoil):
    pytest.importorskip("optuna")
    pytest.importorskip("pyarrow")
    (tmp_path / "s.json").write_text(json.dumps({"spread": {"clutches.bore": 2e-8}}))
    tune = ["tune", "--ways", "I-II", "--jobs", "1", "--rigs", "0", "--spreads", str(tmp_path / "s.json"), "--out"]
    spoil(400)
    assert main([*tune, str(tmp_path / "t")]) == 1
    assert "rig: the rig tripped: clutch_s1: temperature became nan between 0.400 s and 0.401 s" in printed(capsys)[0]
    assert not list((tmp_path / "t").glob("front*")) and not list((tmp_path / "t").glob("*.yaml"))


def test_a_controller_under_which_the_rig_trips_fails_its_check(capsys, spoil, monkeypatch):
    monkeypatch.setattr(conformance, "DESK_SAMPLES", 1600)  # of items that move no rig
    spoil(500)
    code = main(["controller", "check", "--in-process", "python:rig_nodes.controllers.examples.alfa46:Alfa46"])
    line = next(line for line in capsys.readouterr().out.splitlines() if "both gears" in line)
    assert code == 1 and line.startswith("FAILED  both gears")
    assert "the rig tripped: clutch_s1: temperature became nan between 0.500 s and 0.501 s" in line
