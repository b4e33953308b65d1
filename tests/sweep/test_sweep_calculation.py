# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A sweep that makes a calculation of the rig's folder on each run, in place of shift metrics."""

import json

import pyarrow.parquet
import pytest

import rig_nodes
from rig_nodes.cli.main import main

CODE = '''\
"""Calculations of a rig for tests."""
from rig_nodes.runs.calculations import Table


def ends(config, recording):
    """Speed and work at the end of the run."""
    speed, work = float(recording["n_in"][-1]), float(recording["motor_work"][-1])
    return Table("at the end", {"of": "", "speed": "rpm", "work": "J"}, [("run", speed, work)])


def ratio(config):
    """A number."""
    return Table("one", {"ratio": "-"}, [(1.0,)])


CALCULATIONS = {"ends": ends, "ratio": ratio}
'''


@pytest.fixture
def folder(tmp_path):
    folder = tmp_path / "rig"
    (folder / "sequences").mkdir(parents=True)
    (folder / "rig.yaml").write_text("description: as three_speed, with calculations\nbase: three_speed\n")
    (folder / "calculations.py").write_text(CODE)
    (folder / "sequences" / "short.yaml").write_text(
        "description: the motor alone\nparameters:\n  speed: 300 rpm\n"
        "steps:\n  - motor: {speed: '${speed}'}\n  - wait: {for: 800 ms}\n"
    )
    return folder


def test_each_members_table_is_in_the_results_with_and_without_bags(folder, tmp_path, capsys):
    words = ["sweep", "short", "--rig", str(folder), "--vary", "speed=200 rpm, 400 rpm", "--calculate", "ends", "--jobs", "1"]
    assert main([*words, "--out", str(tmp_path / "plain")]) == 0
    output = capsys.readouterr().out
    assert output.endswith(f"; look at it with: ./rig report {tmp_path / 'plain'} --html page.html\n")
    assert "2 of 2 members finished\n" in output and "speed [rpm]" in output and "work [J]" in output
    assert main([*words, "--out", str(tmp_path / "bags"), "--bags"]) == 0
    for name in ("plain", "bags"):
        table = pyarrow.parquet.read_table(tmp_path / name / "results.parquet")
        assert table["speed"].to_pylist() == [200.0, 400.0] and table["table.of"].to_pylist() == ["run", "run"]
        assert table["table.speed"].to_pylist() == pytest.approx([200.0, 400.0], abs=3.0)
        assert table.schema.field("table.work").metadata[b"unit"] == b"J" and "k" not in table.column_names
        assert table["table.work"].to_pylist()[1] > 3 * table["table.work"].to_pylist()[0] > 0.0
    plan = json.loads((tmp_path / "plain" / "sweep.json").read_text())
    assert plan["plan"]["calculate"] == "ends" and plan["calculation"]
    found = rig_nodes.sweep(folder, "short", {"speed": ["200 rpm", "400 rpm"]}, calculate="ends")
    assert found["table.speed"].tolist() == table["table.speed"].to_pylist() and found.units["table.work"] == "J"
    assert "t_c_s" not in str(found) and "table.work" in str(found)
    capsys.readouterr()
    assert main(["sweep", str(tmp_path / "plain")]) == 0
    assert "2 of 2 members are finished already" in capsys.readouterr().err
    assert main(["report", str(tmp_path / "plain")]) == 0
    assert "speed" in capsys.readouterr().out


@pytest.mark.parametrize(
    "name, sentence",
    [
        ("end", "there is no calculation 'end'; did you mean 'ends'"),
        ("ratio", "the calculation ratio takes no recording, so no run changes it"),
    ],
)
def test_a_calculation_that_cannot_be_made_of_runs_is_refused_before_any_run(folder, name, sentence, tmp_path, capsys):
    words = ["sweep", "short", "--rig", str(folder), "--vary", "speed=200 rpm, 400 rpm", "--calculate", name]
    assert main([*words, "--out", str(tmp_path / "s")]) == 2
    assert sentence in capsys.readouterr().err and not (tmp_path / "s").exists()
