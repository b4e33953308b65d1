"""`rig report RUN`: what it prints, what it keeps and what it refuses."""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from pathlib import Path

import pytest
from synthetic_shift import FakeBag, Shift

from rig_nodes.analysis.report import build_report, write_report
from rig_nodes.cli import report as command
from rig_nodes.errors import RigError


class RunBag(FakeBag):
    """One up-shift; the path that was asked for is remembered."""

    opened: list[str] = []
    recovered = ""

    def __init__(self, path):
        self.opened.append(str(path))
        super().__init__(Shift().recording(1), events=[(1.0, "/alfa46/events", "shift_ordered", "", 2.0)])

    def run_info(self):
        return {"configuration": {"rig": "hydmag"}, "seed": 7}


@pytest.fixture
def rig_report(monkeypatch):
    monkeypatch.setattr(command, "Bag", RunBag)

    def call(*arguments):
        parser = argparse.ArgumentParser()
        command.add_arguments(parser)
        return command.main(parser.parse_args([str(argument) for argument in arguments]))

    return call


def test_prints_a_table_and_keeps_what_only_the_run_knew(rig_report, tmp_path, capsys):
    run = {"seed": 3, "lost": 0, "ticks": 10, "overruns": 1, "end": {"reason": "interrupted"},
           "lateness_ms": {"p50": 0.1, "p99": 0.2, "max": 0.3}}
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
    mcap = tmp_path / "demo.mcap"
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


def test_a_cut_bag_is_reported_as_far_as_it_is_whole(tmp_path):
    """What is left of a killed recorder's run is still worth a report."""
    sample = Path(__file__).resolve().parents[2] / "bags" / "sample" / "sample.mcap"
    data = sample.read_bytes()
    (tmp_path / "cut.mcap").write_bytes(data[:len(data) * 4 // 5])
    done = subprocess.run([sys.executable, "-m", "rig_nodes.cli.main", "report", str(tmp_path / "cut.mcap")], text=True,
                          capture_output=True)
    assert done.returncode == 0, done.stderr
    assert "recover" in done.stderr and "I -> II" in done.stdout
