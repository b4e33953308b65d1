# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The calibration of a rig's folder: the values that result from its validation rows, and refusals of faulty files."""

import json
import re

import pytest

import rig_nodes
from rig_nodes.cli.main import main
from rig_nodes.rig.configuration import load_rig

SEQUENCE = """\
description: the first gear at rest, then under load
steps:
  - oil: {pressure: 4 MPa}
  - wait: {for: 500 ms}
  - shift: {to: 1, timeout: 3 s}
  - motor: {speed: 600 rpm}
  - wait: {for: 2 s}
"""
# in addition to the output's torque, the input carries its drag and that of the open clutches: 4.5 Nm in all
ROWS = """\
rows:
  - id: input_drag
    text: torque at the input beyond what the output takes
    source: measured
    role: calibrate
    sequence: steady
    from: 2.5 s
    to: 3 s
    value: M_in - 1.02 * (M_out + 3) / 2.8
    printed: 4.5 Nm
    low: 4.4 Nm
    high: 4.6 Nm
"""
MAY_CHANGE = """\
stages:
  losses:
    drag: {of: [loss_in.drag], low: 0 Nm, high: 10 Nm, why: "assumed"}
"""
RIG = """\
description: as three_speed, with a calibration of its own
base: three_speed
parts:
  loss_in:
    drag: [9 Nm, "assumed"]
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "sequences").mkdir()
    for name, text in (
        ("rig.yaml", RIG),
        ("validation.yaml", ROWS),
        ("calibration.yaml", MAY_CHANGE),
        ("sequences/steady.yaml", SEQUENCE),
    ):
        (tmp_path / name).write_text(text)
    return tmp_path


def test_a_value_is_found_that_meets_the_row_and_written_where_the_rig_has_it(folder, capsys):
    assert main(["calibrate", "--rig", str(folder), "--generations", "0", "--jobs", "1", "--write"]) == 0
    out = capsys.readouterr().out
    assert "losses.drag" in out and "input_drag" in out and "written to the rig's configuration" in out
    found = load_rig(folder).loss_in.drag
    assert 2.5 < found < 4.0, "4.5 Nm less the drag of the open clutches at 600 rpm, about 1 Nm"
    assert '"calibrated: rig calibrate"' in (folder / "rig.yaml").read_text()
    assert main(["validate", "--rig", str(folder), "--jobs", "1", "--set", "effects.transducers=off"]) == 0
    assert "calibrated inside 1 of 1" in capsys.readouterr().out


def test_from_python_the_same_values_are_found_and_written(folder, tmp_path):
    options = ["--generations", "0", "--jobs", "1", "--json", str(tmp_path / "x.json")]
    assert main(["calibrate", "--rig", str(folder), *options]) == 0
    found = rig_nodes.calibrate(folder, generations=0)
    line = json.loads((tmp_path / "x.json").read_text())
    assert {"generator": line["generator"], **json.loads(json.dumps(found.as_dict()))} == line
    (parameter,), (row,) = found.parameters, found.rows
    assert parameter["name"] == "losses.drag" and parameter["value"] == line["values"]["losses.drag"]
    assert row["row"] == "input_drag" and abs(row["miss"]) < 0.1 and row["before"] != row["after"]
    assert load_rig(folder).loss_in.drag != parameter["value"], "nothing is written yet"
    found.write()
    assert load_rig(folder).loss_in.drag == pytest.approx(parameter["value"], rel=1e-3)


@pytest.mark.parametrize(
    "file, old, new, sentence",
    [
        (
            "calibration.yaml",
            "loss_in.drag",
            "loss_in.drug",
            r"calibration.yaml:3: there is no value of loss_in 'drug'; did you mean 'drag'",
        ),
        ("calibration.yaml", "loss_in.drag", "loss_in.torque_side", "loss_in.torque_side is no number that a search could change"),
        ("calibration.yaml", "loss_in.drag", "motor.speed", "motor.speed is set while the rig runs"),
        ("calibration.yaml", "high: 10 Nm", "high: 10 rpm", "expected a torque"),
        ("calibration.yaml", "low: 0 Nm", "low: 20 Nm", "low must be below high"),
        ("calibration.yaml", MAY_CHANGE, "stages: {}\n", "stages must be a map of names, each of the parameters that it searches"),
        ("calibration.yaml", MAY_CHANGE, "stages: {losses: 3}\n", "stages must be a map of names"),
        ("validation.yaml", "role: calibrate", "role: predict", "no row has the role calibrate, so there is nothing to search on"),
    ],
)
def test_a_wrong_calibration_is_refused_in_one_sentence(folder, capsys, file, old, new, sentence):
    text = (folder / file).read_text()
    assert old in text
    (folder / file).write_text(text.replace(old, new))
    assert main(["calibrate", "--rig", str(folder)]) == 2
    error = capsys.readouterr().err
    assert re.search(sentence, error) and error.count("\n") == 1


def test_a_rig_without_a_calibration_says_what_it_lacks(folder, capsys):
    assert main(["calibrate", "--rig", "clutch_bench"]) == 2
    assert "the rig 'clutch_bench' has no validation.yaml" in capsys.readouterr().err
    assert main(["calibrate", "--rig", "chapter9"]) == 2
    assert "the rows of 'chapter9' are those of 'hydmag'; ./rig calibrate --rig hydmag searches on these" in capsys.readouterr().err
    assert main(["calibrate", "--rig", str(folder), "--stages", "loses"]) == 2
    assert "there is no stage 'loses'; did you mean 'losses'" in capsys.readouterr().err
    assert main(["calibrate", "--rig", str(folder), "--trade-offs"]) == 2
    assert "trade-offs belong to the laboratory's rows" in capsys.readouterr().err


def test_check_reads_rows_and_calibration_too(folder, tmp_path, capsys):
    assert main(["check", str(folder), "--picture", str(tmp_path / "p.svg")]) == 0
    out = capsys.readouterr().out
    assert "validation rows: input_drag\n" in out and "calibration: losses.drag\n" in out
    (folder / "validation.yaml").write_text(ROWS.replace("M_out", "M_aus"))
    assert main(["check", str(folder), "--picture", str(tmp_path / "p.svg")]) == 2
    assert "names 'M_aus': there is no signal 'M_aus'" in capsys.readouterr().err
