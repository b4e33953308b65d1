# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rig report RUN`: its output, its files and its refusals."""

from __future__ import annotations

import argparse
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from synthetic_shift import FakeBag, Shift

from rig_nodes.analysis.gathered import LOGGER
from rig_nodes.analysis.run_report import build_report, write_report
from rig_nodes.api.run import Run
from rig_nodes.bags.cdr import encoder
from rig_nodes.bags.reader import Bag
from rig_nodes.bags.writer import BagWriter
from rig_nodes.base.errors import RigError
from rig_nodes.cli import report as command
from rig_nodes.cli.main import main

from ..dated import with_dates

SAMPLE = Path(__file__).resolve().parents[2] / "bags" / "sample"


class RunBag(FakeBag):
    """One upshift; ``opened`` lists the paths from which it was opened."""

    opened: list[str] = []
    recovered, library, end = "", "another recorder", {}

    def __init__(self, path):
        self.opened.append(str(path))
        super().__init__(Shift().recording(1), events=[(1.0, "/controller/events", "shift_ordered", "", 2.0)])

    def run_info(self):
        return {"configuration": {"rig": "hydmag"}, "seed": 7}

    def newest(self, topic):
        return None

    def disorder(self):
        return []

    def false_blocks(self):
        return {}


@pytest.fixture
def rig_report(monkeypatch):
    monkeypatch.setattr(command, "gather", lambda path, annex_a, recover: RunBag(path))

    def call(*arguments):
        parser = argparse.ArgumentParser()
        command.add_arguments(parser)
        return command.main(parser.parse_args([str(argument) for argument in arguments]))

    return call


def test_prints_a_table_and_keeps_what_only_the_run_knew(rig_report, tmp_path, capsys):
    run = {
        "seed": 7,
        "lost": 0,
        "ticks": 10,
        "overruns": 1,
        "end": {"reason": "interrupted"},
        "lateness_ms": {"p50": 0.1, "p99": 0.2, "max": 0.3},
    }
    write_report(tmp_path, build_report(FakeBag(Shift().recording()), run))
    before = json.loads((tmp_path / "report.json").read_text())
    assert before["shifts"] == []
    assert rig_report(tmp_path) == 0
    after = json.loads((tmp_path / "report.json").read_text())
    assert len(after["shifts"]) == 1
    assert after["run"] == before["run"]
    out = capsys.readouterr().out
    assert "E_loss J" in out and "end: interrupted" in out


def test_run_without_a_report_gets_one_from_its_bag(rig_report, tmp_path, capsys):
    mcap = tmp_path / "demo_0.mcap"
    mcap.touch()
    assert rig_report(mcap, "--json") == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed == json.loads((tmp_path / "report.json").read_text())
    assert printed["run"]["seed"] == 7
    assert printed["run"]["end"]["reason"] == "the run left no report"
    assert RunBag.opened[-1] == str(mcap)


def test_broken_report_is_refused(rig_report, tmp_path):
    (tmp_path / "report.json").write_text("not json")
    with pytest.raises(RigError, match="is no report"):
        rig_report(tmp_path)


@pytest.fixture
def sample(tmp_path):
    """A copy of the sample run with its report."""
    folder = shutil.copytree(SAMPLE, tmp_path / "sample")
    assert main(["report", str(folder)]) == 0
    return folder


def run_of(folder):
    return json.loads((folder / "report.json").read_text())["run"]


def cut(folder):
    """Cuts the bag to 4/5; returns the bytes of the whole bag and the number of lost messages."""
    (mcap,) = folder.glob("*.mcap")
    data, held = mcap.read_bytes(), sum(Bag(mcap).counts.values())
    mcap.write_bytes(data[: len(data) * 4 // 5])
    return data, held - sum(Bag(mcap, recover=True).counts.values())


def test_a_bag_that_is_damaged_later_does_not_pass_for_a_whole_one(sample, capsys):
    """A report can be made from the rest, but the existing report of the whole bag is more complete and is kept."""
    before = (sample / "report.json").read_bytes()
    whole, gone = cut(sample)
    assert gone > 1000
    capsys.readouterr()
    assert main(["report", str(sample)]) == 1
    captured = capsys.readouterr()
    assert "I -> II" in captured.out and f"messages lost: {gone}" in captured.out and "bag: damaged; " in captured.out
    assert "end: unknown from what is left of the bag; the reason in its report: " in captured.out
    assert "is damaged" in captured.err and "left as it is" in captured.err
    assert (sample / "report.json").read_bytes() == before

    # without the files beside the bag the lost messages are unknown
    for name in ("report.json", "metadata.yaml"):
        (sample / name).unlink()
    assert main(["report", str(sample)]) == 1
    captured = capsys.readouterr()
    assert "messages lost: unknown" in captured.out and "end: unknown" in captured.out
    run = run_of(sample)
    assert run["lost"] is None and "messages recovered up to" in run["recovered"]
    (sample / "sample_0.mcap").write_bytes(whole)
    assert main(["report", str(sample)]) == 0
    assert run_of(sample)["lost"] == 0 and "recovered" not in run_of(sample)


def test_the_report_of_another_run_in_the_folder_is_neither_used_nor_overwritten(sample, capsys):
    path = sample / "report.json"
    other = json.loads(path.read_text())
    other["run"] |= {"seed": 77, "sequence": "another", "end": {"reason": "broken off by hand"}}
    path.write_text(json.dumps(other))
    capsys.readouterr()
    assert main(["report", str(sample / "sample_0.mcap")]) == 0
    captured = capsys.readouterr()
    assert "broken off by hand" not in captured.out and "I -> II" in captured.out
    assert "is of another run" in captured.err and json.loads(path.read_text()) == other


def test_a_report_that_cannot_be_written_is_printed_all_the_same(rig_report, tmp_path, capsys):
    with pytest.raises(RigError, match="report.json: it cannot be written"):
        rig_report(tmp_path / "nowhere" / "demo_0.mcap")
    assert "0 -> II" in capsys.readouterr().out


def test_a_run_that_was_stopped_before_its_time_began_says_so(tmp_path, capsys):
    BagWriter(tmp_path, "run").close()
    report = build_report(Bag(tmp_path), {"end": {"reason": "interrupted by Ctrl-C"}})
    assert report["run"]["problems"] == ["nothing was recorded: the run was stopped before its time began"]
    assert (report["shifts"], report["energy"]) == ([], {"run": None, "shifts": []})
    for verb in ("report", "view"):
        assert main([verb, str(tmp_path)]) == 2
        assert capsys.readouterr().err.endswith("nothing was recorded: the run was stopped before its time began\n")
    assert not (tmp_path / "view.rrd").exists()


def test_an_imported_file_is_reported_with_the_rig_that_its_user_named(tmp_path, capsys):
    recording = Shift().recording(1)
    names = ("M_wej", "n_wej", "M_wyj", "n_wyj", "p1", "p2")
    head = ";".join(f"{name} [{unit}]" for name, unit in zip(names, ("Nm", "rad/s", "Nm", "rad/s", "Pa", "Pa")))
    rows = np.array([recording.channels[name] for name in names]).T
    path = tmp_path / "series 19.CSV"
    path.write_text("\n".join([head, *(";".join(f"{x:.8g}" for x in row) for row in rows)]).replace(".", ","))

    def report_of(folder, *options):
        arguments = ["--period", "0.1 ms", "--orders", "1:I-II", "--rig", "hydmag", "--out", str(tmp_path / folder)]
        assert main(["import", str(path), *arguments, *options]) == 0
        assert main(["report", str(tmp_path / folder), "--annex-a", "--factor", "1.2"]) == 0
        return capsys.readouterr().out, json.loads((tmp_path / folder / "report.json").read_text())

    out, report = report_of("run")
    assert "I -> II" in out and "factor 1.2" in out
    assert "computed with inertias (0.709 and 0.1273 kg m2) and instrument errors (1.01 Nm, 1" in out
    assert "of rig 'hydmag', named by --rig for the file series 19.CSV, ratios 1.3824 and 1.0250" in out
    (row,) = report["shifts"]
    assert report["basis"]["rig"] == "hydmag" and report["basis"]["inertia_driven"] == 0.1273
    assert row["t_c_s"] == pytest.approx(0.70, abs=2e-3)
    _, other = report_of("other", "--set", "z5.inertia=0.06 kg m2", "--set", "instruments.torque_class=2 %")
    assert other["basis"]["rig"] == "hydmag" and other["basis"]["inertia_driven"] == pytest.approx(0.06)
    # (6.108): J (41/40)^2 (w2^2 - w1^2) / 2 of the output, 1500 rpm over 47/34 and 41/40
    w1, w2 = 157.08 * 34 / 47, 157.08 * 40 / 41
    by_hand = 0.5 * (0.1273 - 0.06) * (41 / 40) ** 2 * (w2**2 - w1**2)
    assert other["shifts"][0]["e_loss_j"] - row["e_loss_j"] == pytest.approx(by_hand, rel=0.01)
    assert other["uncertainty"][0]["output_torque_nm"] == pytest.approx(10.01)


def test_options_that_do_not_fit_are_refused(rig_report, tmp_path):
    with pytest.raises(RigError, match="give --annex-a too"):
        rig_report(tmp_path, "--factor", "1.1")
    with pytest.raises(RigError, match="upper edge of a band"):
        rig_report(tmp_path, "--annex-a", "--factor", "0.9")


def test_a_loggers_file_is_sent_to_import(rig_report, tmp_path):
    (tmp_path / "a.csv").write_text("t [s];p1 [bar]\n0;1\n1;1\n")
    with pytest.raises(RigError, match=r"is a logger's file; a run, which has a report, is made of it by ./rig import .*a.csv"):
        rig_report(tmp_path / "a.csv")


@pytest.mark.parametrize(
    "beside",
    [
        {"lateness_ms": 5},
        {"left_out": 3},
        {"left_out": {"/a": "many"}},
        {"lateness_ms": {"p50": "slow"}},
        {"recorded_from_s": "late"},
        {"lost": 1, "lost_by_topic": 7},
        {"unreadable": 3, "unrecorded_topics": 4, "other_clocks": 5, "behind": 6},
    ],
)
def test_a_report_that_others_have_written_is_read_as_far_as_it_can_be(beside, rig_report, tmp_path, capsys):
    (tmp_path / "report.json").write_text(json.dumps({"run": {"seed": 7, **beside}}))
    assert rig_report(tmp_path) == 0
    printed = capsys.readouterr().out
    assert "end: " in printed and "left out by the recorder" not in printed and "lateness of ticks" not in printed


@pytest.mark.parametrize("text", ["", '{"published": {"/motor/', "[]", '{"reason": ""}'])
def test_what_a_process_could_not_write_to_its_end_tells_nothing(text, rig_report, tmp_path, capsys):
    (tmp_path / "logs").mkdir()
    (tmp_path / "logs" / "container.json").write_text(text)
    assert rig_report(tmp_path) == 0
    assert "end: the run left no report" in capsys.readouterr().out


def test_a_shift_0_is_none_of_a_folder_of_runs(sample, tmp_path, capsys):
    folder = tmp_path / "series"
    for n in (1, 2):
        shutil.copytree(sample, folder / f"series-{n}")
    assert main(["report", str(folder), "--picture", str(tmp_path / "a.svg"), "--shift", "0"]) == 2
    assert "--shift 0: these runs have" in capsys.readouterr().err and not (tmp_path / "a.svg").exists()


def test_a_run_of_which_a_logger_jumps_in_its_rows_has_its_other_results(tmp_path, capsys):
    bag, blocks = Bag(SAMPLE), 0
    columns = len(bag.columns(LOGGER))
    encode = encoder("rig_msgs/msg/SampleBlock").encode
    with BagWriter(tmp_path, "run", topics=bag.catalogue.all_topics) as writer:
        for time, topic, data in bag.timeline():
            if topic == LOGGER:
                blocks += 1
                if blocks > 100:
                    data = encode(time, blocks - 1, (blocks - 1) * 50 + 2**60, 1e-4, 50, columns, [0.0] * 50 * columns)
            writer.write(topic, bag.types[topic], data, time)
        writer.end("ended", "the sequence ended")
    assert main(["report", str(tmp_path)]) == 3
    assert " rows are missing between its blocks, more than the " in capsys.readouterr().out


def test_the_times_of_a_bag_with_dates_are_those_of_the_run(tmp_path, capsys):
    dated = with_dates(SAMPLE, tmp_path / "run_0.mcap")
    assert ", recorded, 2.6 s, seed 1; ended" in repr(Run(dated))
    whole = dated.read_bytes()
    dated.write_bytes(whole[: len(whole) // 2])
    assert main(["report", str(dated)]) == 1
    captured = capsys.readouterr()
    assert "messages recovered up to 1.535 s" in captured.out
