# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Each shift of a simulated run says how the rig stood at its order; shifts that began differently are named."""

import json
import re

import numpy as np
import pyarrow.parquet
import pytest

from rig_nodes.analysis.plate_heat import above_the_oil
from rig_nodes.analysis.runs_table import members_in, warnings_of
from rig_nodes.analysis.state_at_order import begun, unlike
from rig_nodes.bags.reader import Bag
from rig_nodes.cli.main import main
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.recorded import record
from rig_nodes.runs.sequence import load_sequence
from rig_nodes.studies.tune.bench import Point
from rig_nodes.studies.tune.problem import held
from rig_nodes.view.document import report_document
from rig_nodes.view.page_of_report import Facts, report_page

AGAIN = """\
description: up, down and up again
parameters: {pause: 2 s}
steps:
  - oil: {pressure: 4 MPa}
  - wait: {for: 500 ms}
  - shift: {to: I, timeout: 3 s}
  - motor: {speed: 900 rpm}
  - load: {torque: 40 Nm}
  - wait: {for: 2500 ms}
  - shift: {to: II, timeout: 3 s}
  - wait: {for: 5 s}
  - shift: {to: I, timeout: 3 s}
  - wait: {for: "${pause}"}
  - shift: {to: II, timeout: 3 s}
  - wait: {for: 500 ms}
"""
BOX = load_rig("hydmag").transmission
DIFFERENT = r"shifts I -> II began in different states: travel of the piston of S2 0\.0 mm in .*, \d\.\d mm in .*pause longer"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with the sequence, its run with a pause of 2 s, and its run with one of 12 s."""
    folder = tmp_path_factory.mktemp("again")
    (folder / "again.yaml").write_text(AGAIN)
    for name, pause in (("short", "2 s"), ("long", "12 s")):
        words = ["simulate", str(folder / "again.yaml"), "--with", f"pause={pause}", "--out", str(folder / "runs" / name)]
        assert main(words) == 0
    return folder


def report(folder, name):
    return json.loads((folder / "runs" / name / "report.json").read_text())


def test_a_shift_after_a_short_pause_says_that_the_piston_had_not_returned(folder, capsys):
    rows = report(folder, "short")["shifts"]
    first, last = (row["at_order"]["clutches"]["S2"] for row in (rows[0], rows[2]))
    bag = Bag(folder / "runs" / "short")
    t, piston = bag.series("s2_piston")
    assert first["piston_m"] == 0.0
    assert last["piston_m"] == pytest.approx(np.interp(rows[2]["t_order_s"], t, piston), abs=2e-6) and last["piston_m"] > 1e-3
    clutch = load_rig("hydmag").values("clutch_s2")
    assert last["fill_done"] == pytest.approx(last["piston_m"] / clutch.clearance)
    assert last["filled_m3"] == pytest.approx(last["piston_m"] * clutch.piston_area)
    assert last["plates_degc"] > rows[2]["at_order"]["oil_degc"] > 30.0
    assert main(["report", str(folder / "runs" / "short")]) == 0
    out = capsys.readouterr().out
    assert re.search(
        rf"shift 3, I -> II at .* did not begin at rest: piston of S2 {1e3 * last['piston_m']:.1f} mm off its stop", out
    )
    assert "shift 1, I -> II" not in "".join(line for line in out.splitlines() if "begin at rest" in line)
    assert re.search(DIFFERENT, out)


def test_after_a_long_pause_there_is_nothing_to_say_and_documents_say_what_there_is(folder, capsys):
    assert main(["report", str(folder / "runs" / "long")]) == 0
    out = capsys.readouterr().out
    assert "begin at rest" not in out and "different states" not in out
    assert "did not begin at rest: piston of S2" in report_document(report(folder, "short"), [])
    assert "did not begin at rest" in report_page(report(folder, "short"), Facts(), [], [])


def test_a_line_that_has_not_run_empty_is_named_when_the_piston_has_returned(folder, capsys):
    words = ["simulate", str(folder / "again.yaml"), "--with", "pause=6 s", "--out", str(folder / "middle")]
    assert main(words) == 0
    out = capsys.readouterr().out
    assert re.search(r"shift 3, I -> II at .* did not begin at rest: \d\.\d cm3 of oil still in the line of S2", out)
    assert re.search(r"began in different states: oil left in the line of S2 0\.0 cm3 in 1, \d\.\d cm3 in 3, .*pause longer", out)
    rows = json.loads((folder / "middle" / "report.json").read_text())["shifts"]
    assert rows[2]["kiss_s"] < rows[0]["kiss_s"] - 0.02


def test_a_comparison_and_a_series_of_runs_name_the_shifts_that_began_differently(folder, capsys):
    assert main(["compare", str(folder / "runs" / "short"), str(folder / "runs" / "long")]) == 0
    out = capsys.readouterr().out
    assert re.search(r"shift 3, I -> II began in different states: .*0\.0 mm in long, \d\.\d mm in short", out)
    assert any(re.search(DIFFERENT, sentence) for sentence in warnings_of(members_in(folder / "runs")))


def test_a_sweep_has_the_states_in_its_results_and_names_what_differs(folder, capsys):
    words = ["sweep", str(folder / "again.yaml"), "--vary", "pause=2 s, 12 s", "--jobs", "1", "--out", str(folder / "sweep")]
    assert main(words) == 0
    assert re.search(DIFFERENT, capsys.readouterr().out)
    table = pyarrow.parquet.read_table(folder / "sweep" / "results.parquet")
    column = table.column("at_order.S2.piston_m").to_pylist()
    rows = [row for name in ("short", "long") for row in report(folder, name)["shifts"]]
    wanted = [row["at_order"]["clutches"].get("S2", {}).get("piston_m") for row in rows]
    assert [value is None for value in column] == [value is None for value in wanted]
    assert [one for one in column if one is not None] == pytest.approx([one for one in wanted if one is not None], abs=5e-5)
    lines = [row["at_order"]["clutches"].get("S2", {}).get("line_m3") for row in rows]
    column = table.column("at_order.S2.line_m3").to_pylist()
    assert max(filter(None, lines)) > 1e-5  # by the pressure in the bag; that of the plant is in the sweep's
    assert [one for one in column if one is not None] == pytest.approx([one for one in lines if one is not None], abs=2e-7)
    assert table.schema.field("at_order.S2.piston_m").metadata[b"unit"] == b"m"
    assert main(["report", str(folder / "sweep")]) == 0
    assert re.search(DIFFERENT, capsys.readouterr().out)


def test_the_temperature_of_the_plates_by_their_heat_is_that_of_the_plant():
    run = record(load_rig("hydmag"), load_sequence("demo", rig="hydmag"), plant_states=("s2_mode",))
    (order,) = [t for t, _, gear in run.recording.orders if gear == 1 and t > 1.0]
    warm = run.at_orders[order]
    assert warm.plates["S2"] > warm.oil
    # a constant heat for long against the time constant: P / cooling
    t = np.arange(0.0, 60.0, 0.005)
    assert above_the_oil(t, 40.0 * t, 250.0, 40.0)[-1] == pytest.approx(1.0, rel=1e-3)


def test_what_a_measurement_cannot_know_is_left_out_of_its_report(folder, tmp_path):
    assert main(["export", "csv", str(folder / "runs" / "short"), "--clock", "1 ms", "-o", str(tmp_path / "m.csv")]) == 0
    words = ["import", str(tmp_path / "m.csv"), "--out", str(tmp_path / "run"), "--orders", "3:I-II"]
    assert main(words) == 0
    rows = json.loads((tmp_path / "run" / "report.json").read_text())["shifts"]
    assert rows and all("at_order" not in row for row in rows) and rows[0]["input_speed_change_rpm"] is not None


def made(piston, kiss=0.4, plates=40.0, change=0.0, oil=40.0):
    one = {"piston_m": piston, "fill_done": piston / 8e-3, "plates_degc": plates, "friction_change": change}
    at_order = {"oil_degc": oil, "clutches": {"S2": one}}
    return {"from_gear": 1, "to_gear": 2, "kiss_s": kiss, "input_torque_max_nm": 260.0, "at_order": at_order}


def test_only_what_results_show_beyond_their_error_is_named():
    errors = {"t_c_s": 2e-3, "input_torque_max_nm": 7.0, "input_speed_rpm": 1.0}
    small = made(2e-5)  # a quarter of a percent of the way, 1 ms of the fill
    assert begun(small, errors, BOX) == "" and "piston of S2" in begun(made(1e-3), errors, BOX)
    assert begun(made(0.0, plates=60.0, change=-0.02), errors, BOX) == ""  # 2 % of the friction; the peak is known to 2.7 %
    assert "plates of S2 at 80 degC" in begun(made(0.0, plates=80.0, change=-0.04), errors, BOX)
    moving = made(0.0) | {"input_speed_change_rpm": -12.0}
    assert begun(moving, errors, BOX) == "n_wej changed by -12.0 rpm in the 0.2 s before"
    assert unlike([("1", made(0.0), errors), ("2", small, errors)], BOX) == []
    (line,) = unlike([("1", made(0.0), errors), ("2", made(1.6e-3), errors), ("3", made(1.6e-3), errors)], BOX)
    assert "0.0 mm in 1, 1.6 mm in 2, 3, and t_c and E_loss depend on it; pause longer" in line
    (line,) = unlike([("a", made(0.0), errors), ("b", made(0.0, oil=80.0), errors)], BOX)
    assert "oil 40 degC in a, 80 degC in b" in line and "pause" not in line


def test_the_tuner_names_points_in_which_a_piston_had_not_returned(monkeypatch):
    points = [Point("I-II", speed, 40.0) for speed in (90.0, 100.0)]
    assert held(load_rig("hydmag"), points)[1] == []
    monkeypatch.setattr("rig_nodes.studies.tune.bench.Bench.started", lambda _, point: made(1e-3 if point.speed > 95.0 else 0.0))
    (note,) = held(load_rig("hydmag"), points)[1]
    assert "began in different states: travel of the piston of S2 0.0 mm in I-II 859 rpm 40 Nm" in note
