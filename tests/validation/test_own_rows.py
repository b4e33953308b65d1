# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Validation rows of a rig's folder: their values from a run, their verdicts, and refusals of faulty rows."""

import json

import numpy as np
import pytest

from rig_nodes.bags.logged import Recording
from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import main
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.recorded import Run
from rig_nodes.studies.validation import own_rows
from rig_nodes.studies.validation.tables import counts, terminal
from rig_nodes.studies.validation.which_rows import programme_of, rows_file

ROW = """\
rows:
  - id: ratio
    text: ratio of the second gear
    source: by hand
    role: predict
    sequence: demo
    gear: 2
    value: n_in / n_out
    printed: 1.6 -
    low: 1.59 -
    high: 1.61 -
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "rig.yaml").write_text("description: as three_speed, with rows of its own\nbase: three_speed\n")
    return tmp_path


def read(folder, text: str):
    (folder / "validation.yaml").write_text(text)
    return own_rows.load_rows(rows_file(folder), folder, load_rig(folder))


def test_the_three_speed_gearbox_meets_what_a_hand_calculates(capsys):
    assert main(["validate", "--rig", "three_speed", "--jobs", "1", "--json", "-"]) == 0
    content = json.loads(capsys.readouterr().out)
    rows = {row["id"]: row for row in content["rows"]}
    assert len(rows) == 8 and all(row["verdict"] == "inside" for row in rows.values())
    assert all({"id", "basis", "value", "low", "high", "verdict"} <= set(row) for row in rows.values())
    assert [rows[f"ratio_{k}"]["value"] for k in (1, 2, 3)] == pytest.approx([2.8, 1.6, 1.0], rel=2e-3)
    assert rows["shift_time_12"]["basis"] == "calibrated" and rows["shift_time_12"]["unit"] == "s"
    assert content["summary"]["predicted"] == {"inside": 7, "outside": 0, "not compared": 0, "rows": 7}


def test_a_proven_contradiction_of_the_source_is_neither_inside_nor_outside(folder):
    (row,) = read(folder, ROW.replace("role: predict", "role: contradiction"))
    shown, not_shown = own_rows.judge(row, 1.6, ""), own_rows.judge(row, 1.5, "")
    assert (shown.verdict, not_shown.verdict) == ("source contradicts itself", "outside")
    found = counts([shown, not_shown])
    assert found["contradiction"] == {"inside": 0, "outside": 1, "not compared": 0, "source contradicts itself": 1, "rows": 2}
    assert all(not any(one.values()) for basis, one in found.items() if basis != "contradiction")
    assert "source contradicts itself: 1 of 2" in terminal([shown, not_shown])


def test_a_changed_rig_misses_its_rows(capsys):
    more = ["--set", "loss_in.drag=20 Nm", "--rows", "input_torque_1", "ratio_1"]
    assert main(["validate", "--rig", "three_speed", "--jobs", "1", *more]) == 0
    out = capsys.readouterr().out
    assert "predicted inside 1 of 2" in out and "input_torque_1" in out and "accepted: 0.6 Nm to 5.9 Nm" in out


def test_a_variant_is_held_against_the_rows_of_its_base_until_it_has_its_own(folder):
    assert rows_file(folder).parent.name == "three_speed"
    assert [row.target.id for row in read(folder, ROW)] == ["ratio"] and rows_file(folder).parent == folder
    assert programme_of(rows_file("hydmag")) == programme_of(rows_file("chapter9")) == "rig_nodes.rigs.hydmag.laboratory"
    assert programme_of(rows_file(folder)) is None


def run_of(**channels) -> Run:
    """Returns a run of 3 s at 1 kHz: gear 1 is ordered at 1 s, gear 2 at 2 s."""
    config = load_rig("three_speed")
    rows = {name: np.zeros(3000) for name in config.transmission.channels} | {
        name: np.asarray(values, dtype=float) * np.ones(3000) for name, values in channels.items()
    }
    return Run(Recording(0.0, 1e-3, rows, [(1.0, 0, 1), (2.0, 1, 2)], config.transmission), {"state": "ended", "reason": ""})


def of(folder, value: str, where: str = "gear: 1", unit: str = "-"):
    text = ROW.replace("    value: n_in / n_out\n", f"    value: {value}\n").replace("gear: 2", where).replace(" -\n", f" {unit}\n")
    return read(folder, text)[0]


def test_values_are_taken_from_the_window_that_the_row_names(folder):
    ramp = np.arange(3000) * 1e-3
    run = run_of(n_in=ramp, n_out=2.0)
    assert own_rows._of_signals(of(folder, "n_in / n_out"), run)[0] == pytest.approx((1.7 + 1.999) / 4)
    assert own_rows._of_signals(of(folder, "n_in / n_out", "gear: 1\n    over: 1 s"), run)[0] == pytest.approx((1.0 + 1.999) / 4)
    assert own_rows._of_signals(of(folder, "n_in / n_out", "gear: 2"), run)[0] == pytest.approx((2.7 + 2.999) / 4)
    assert own_rows._of_signals(of(folder, "max(n_in) - min(n_in)", "from: 0.5 s\n    to: 1.5 s"), run)[0] == pytest.approx(0.999)
    assert own_rows._of_signals(of(folder, "-(n_out + 1) * 2 / 4"), run)[0] == pytest.approx(-1.5)


def test_what_cannot_be_taken_is_not_compared_with_the_reason(folder):
    run = run_of(n_in=1.0)
    assert own_rows._of_signals(of(folder, "n_in / n_out"), run) == (None, "divides by 0")
    assert own_rows._of_signals(of(folder, "n_in", "gear: 3", "rad/s"), run) == (None, "the run does not order the gear")
    assert own_rows._of_signals(of(folder, "n_in", "gear: 1\n    over: 2 s", "rad/s"), run) == (
        None,
        "the gear is not in for so long",
    )
    assert own_rows._of_signals(of(folder, "n_in", "from: 9 s\n    to: 10 s", "rad/s"), run) == (None, "the run ends before 9 s")
    row = own_rows.judge(of(folder, "n_in / n_out"), None, "divides by 0")
    assert (row.verdict, row.reason) == ("not compared", "divides by 0")


@pytest.mark.parametrize(
    "old, new, sentence",
    [
        ("n_in / n_out", "n_in / n_aus", r"validation.yaml:8: ratio.value names 'n_aus': there is no signal 'n_aus'"),
        ("n_in / n_out", "n_in ** 2", r"ratio.value is 'n_in \*\* 2', expected signals, numbers and"),
        ("n_in / n_out", "open('x')", "expected signals, numbers and"),
        ("n_in / n_out", "n_in.real", "expected signals, numbers and"),
        ("n_in / n_out", "3 * 4", "which names no signal"),
        ("n_in / n_out", "n_in", "ratio.low is '1.59 -', but n_in is given in rpm"),
        ("gear: 2", "gear: 5", "validation.yaml:7: ratio.gear names the gear '5'; known are neutral, 1, 2, 3"),
        ("    gear: 2\n", "", "needs the key gear, whose steady end is taken, or from and to"),
        ("    gear: 2\n", "    from: 1 s\n", "is given without the other; from and to are needed"),
        ("    gear: 2\n", "    from: 2 s\n    to: 1 s\n", "not before to, which is 1 s"),
        ("low: 1.59 -", "low: 1.62 -", "ratio.low is 1.62 -, above high, which is 1.61 -"),
        ("low: 1.59 -", "low: 1.59", "ratio.low is 1.59, expected a number with its unit"),
        (
            ROW[ROW.index("role:") :],
            ROW[ROW.index("role:") :].replace("predict", "calibrate").replace("1.59 -", "1.6 -").replace("1.61 -", "1.6 -"),
            "ratio.low is 1.6 - as high is; a row to calibrate by has a width",
        ),
        ("high: 1.61 -", "high: 1.61 rpm", "expected a ratio"),
        ("role: predict", "role: guess", "expected calibrate, predict or contradiction"),
        ("sequence: demo", "sequence: damo", "did you mean 'demo'"),
        (
            "    gear: 2\n    value: n_in / n_out\n",
            "    metric: t_c_s\n    shift: 1-2\n",
            "ratio.low is '1.59 -', but t_c_s is given in s",
        ),
        (
            "    gear: 2\n    value: n_in / n_out\n",
            "    metric: t_x_s\n    shift: 1-2\n",
            "there is no metric 't_x_s'; did you mean",
        ),
        ("    gear: 2\n    value: n_in / n_out\n", "    metric: k\n", "ratio.metric needs the key shift: two gears with a dash"),
        (
            "    value: n_in / n_out\n",
            "    metric: t_c_s\n    shift: 1-2\n",
            "ratio.gear goes with value; a metric is that of a shift",
        ),
        ("    value: n_in / n_out\n", "", "needs one of value, an expression of signals, metric, .* and calculation"),
        ("    source: by hand\n", "", "a row lacks the key 'source'"),
        (
            "    gear: 2\n",
            "    gear: 2\n    settings: {motor.ramb: 1 rpm/s}\n",
            "there is no value of motor 'ramb'; did you mean 'ramp'",
        ),
        (ROW, ROW + ROW.removeprefix("rows:\n"), "there is a row 'ratio' already"),
        (ROW, "programme: laboratory\n", "programme is 'laboratory', expected rows in its place"),
        (ROW, "rows: []\n", "rows must be a list"),
    ],
)
def test_wrong_rows_are_refused_in_one_sentence(folder, old, new, sentence):
    assert old in ROW
    (folder / "validation.yaml").write_text(ROW.replace(old, new))
    with pytest.raises(RigError, match=sentence) as refusal:
        if programme_of(rows_file(folder)) is None:
            own_rows.load_rows(rows_file(folder), folder, load_rig(folder))
    assert "\n" not in str(refusal.value)


def test_what_belongs_to_the_laboratory_is_refused_for_other_rigs(capsys):
    assert main(["validate", "--rig", "three_speed", "--procedures", "delay_series"]) == 2
    assert "procedures belongs to the laboratory's programme" in capsys.readouterr().err
    assert main(["validate", "--rig", "clutch_bench"]) == 2
    assert "the rig 'clutch_bench' has no validation.yaml" in capsys.readouterr().err
    assert main(["validate", "--rig", "three_speed", "--rows", "ratio_9"]) == 2
    assert "there is no row 'ratio_9'; did you mean 'ratio_" in capsys.readouterr().err
