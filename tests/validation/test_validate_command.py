# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rig validate`: its output for people and programs, its refusals, its figures, and its end by Ctrl-C."""

import json
import os
import signal
import subprocess
import sys
from math import pi
from types import SimpleNamespace

import numpy as np
import pytest
from synthetic_shift import Shift

from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import main
from rig_nodes.rigs.hydmag.laboratory import document, time_courses
from rig_nodes.rigs.hydmag.laboratory.evaluate import evaluate
from rig_nodes.rigs.hydmag.laboratory.pictures import figures
from rig_nodes.rigs.hydmag.laboratory.programme import Result, summary
from rig_nodes.rigs.hydmag.laboratory.records import Record
from rig_nodes.rigs.hydmag.laboratory.targets import load_targets
from rig_nodes.runs.procedure import load_procedure
from rig_nodes.view import Line, chart, draw_figure
from rig_nodes.view.figure import SOLID

RPM = pi / 30.0
TARGETS = {target.id: target for target in load_targets()}
COMMAND = [sys.executable, "-m", "rig_nodes", "validate"]


def shift(rpm, nm, **values):
    return Record("grid_up", {"shift": "I-II", "n_wej": rpm * RPM, "m_wyj": float(nm)}, values)


# --- the command ----------------------------------------------------------------------------------


def test_rows_come_back_as_json_and_misses_do_not_fail(capsys):
    arguments = ["--rows", "coast_down_tangent_time", "ch9_load_law_minimum", "--set", "w0.inertia=1.4 kg m2"]
    assert main(["validate", *arguments, "--jobs", "1", "--json", "-"]) == 0
    out = capsys.readouterr()
    content = json.loads(out.out)
    rows = {row["id"]: row for row in content["rows"]}
    assert rows["coast_down_tangent_time"]["verdict"] == "outside"
    assert {"id", "basis", "value", "low", "high", "verdict"} <= set(rows["coast_down_tangent_time"])
    assert {row["basis"] for row in rows.values()} == {"calibrated", "information"}
    counts = content["summary"]["calibrated"]
    assert counts["inside"] + counts["outside"] + counts["not compared"] == counts["rows"]
    assert content["versions"]["rig_nodes"] and "coast_down" in out.err
    assert main(["validate", *arguments, "--jobs", "1"]) == 0
    out = capsys.readouterr().out
    assert "misses:" in out and "coast_down_tangent_time" in out and "accepted: 4.1" in out


def test_rows_go_into_a_file_and_figures_into_a_folder(capsys, tmp_path):
    file = tmp_path / "rows.json"
    assert main(["validate", "--rows", "cylinder_*", "--jobs", "1", "--json", str(file), "--pictures", str(tmp_path / "p")]) == 0
    assert "consistency inside 2 of 2" in capsys.readouterr().out
    # the pressure at which the cylinder begins to push, by (8.2) 0.098 MPa, within the class of the pressure transducer
    start = next(row for row in json.loads(file.read_text())["rows"] if row["id"] == "cylinder_force_start")
    assert start["value"] == pytest.approx(0.098e6, abs=0.0625e6 + 0.002e6)
    assert (tmp_path / "p" / "fig_8_8.svg").is_file() and (tmp_path / "p" / "fig_8_9.svg").is_file()


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--rows", "peaks"], "row 'peaks'"),
        (["--procedures", "grid"], "procedure 'grid'; did you mean "),
        (["--jobs", "0"], "jobs is 0, expected a whole number of at least 1"),
        (["--rows", "bench_*", "--set", "motor.speed=1"], "motor.speed"),
        (["--rows", "bench_*", "--json", "/no/such/folder/x.json"], "/no/such/folder/x.json"),
        (["--procedures", "delay_series", "--set", "alfa46.t12=0 ms"], "series '1' of delay_series sets it itself"),
    ],
)
def test_bad_arguments_are_refused_in_one_sentence(arguments, sentence, capsys):
    assert main(["validate", *arguments]) == 2
    err = capsys.readouterr().err.splitlines()
    assert sentence in err[-1] and err[-1].startswith("rig: ") and not any("Traceback" in line for line in err)


def test_ctrl_c_ends_it_without_a_word():
    process = subprocess.Popen(
        [*COMMAND, "--rows", "coast_down_torque", "hold_*"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env=dict(os.environ),
    )
    controller, first = process.stderr.readline(), process.stderr.readline()
    os.killpg(process.pid, signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert controller == "controller alfa46 sends shares of the supply: level duty, as the controller declares\n"
    assert first.startswith("coast_down") and first.endswith(" left\n")
    assert (process.returncode, out) == (130, "") and "Traceback" not in err


# --- the document ---------------------------------------------------------------------------------


def test_every_row_has_its_section_and_what_it_accepts():
    for target in TARGETS.values():
        assert document.section(target) in document.SECTIONS, target.id
        assert document.accepted(evaluate(target, [])), target.id
    sections = {
        name: document.section(TARGETS[name])
        for name in (
            "rise_disturbed",
            "valve_delay_zr_p1",
            "hold_zr_p1_19",
            "delay_up_peak_spread",
            "up_t_dt_range",
            "bench_m_eks_linear",
            "ch9_load_law_minimum",
            "concl_dip_negligible",
        )
    }
    assert sections == {
        "rise_disturbed": "7.1",
        "valve_delay_zr_p1": "7.2",
        "hold_zr_p1_19": "7.3.2",
        "delay_up_peak_spread": "7.5",
        "up_t_dt_range": "7.5",
        "bench_m_eks_linear": "8",
        "ch9_load_law_minimum": "9",
        "concl_dip_negligible": "10",
    }


def test_numbers_are_in_the_laboratorys_unit():
    row = evaluate(
        TARGETS["up_peak_torque_range"],
        [shift(rpm, 80, input_torque_max_nm=300.0 + rpm / 1000) for rpm in (1000, 1200, 1500, 1800, 2000)],
    )
    assert document.accepted(row) == document.laboratory(row) == "244 Nm to 293 Nm"
    assert document.of_rig(row) == "302 Nm (0 of 5 inside; 2000 rpm)"
    delay = evaluate(
        TARGETS["delay_up_dip_begins"],
        [Record("delay_series", {"shift": "I-II", "n_wej": 500.0 * RPM, "m_wyj": 60.0, "series": "all"}, {"dip_begins_s": -0.18})],
    )
    assert document.of_rig(delay) == "-180 ms" and delay.verdict == "inside"
    assert document.laboratory(delay) == "-175 ms; accepted: -180 ms to -150 ms"


def hold(number, word):
    return Record("profile_series", {"valve": "ZR-P1", "series": number, "n_wej": 500.0 * RPM, "m_wyj": 30.0}, {"hold": word})


def test_the_document_counts_holds_and_explains_misses():
    records = [hold(7, "hold"), hold(8, "no hold"), hold(9, "hold"), hold(10, "no hold"), hold(11, None)]
    rows = [evaluate(TARGETS[f"hold_zr_p1_{n:02d}"], records) for n in (7, 8, 9, 10, 11)]
    result = Result(rows, records, ("profile_series",), [])
    why = {"hold_zr_p1_07": "The spool closes late."}
    text = document.document(rows, summary(result), why, "hydmag")
    stored = json.loads(json.dumps([row.as_dict() for row in rows]))
    assert document.document(document.rows_of(stored), summary(result), why, "hydmag") == text
    # half of the series without a hold phase and a third of those with one, of which the undecided one is wrong
    assert "predicted inside 2 of 5 (1 not compared) (hold phase 2 of 5, balanced accuracy 0.42 where" in text
    assert "| hold phase | always hold | 2 of 5 | 3 of 5 | - | - |" in text
    # laboratory: 7 and 8 without a hold phase, 9 to 11 with one
    assert "| ZR-P1 | hold | 1 | 1 | 1 |" in text and "| ZR-P1 | no hold | 1 | 1 | 0 |" in text
    assert "| predicted | 5 | 2 | 2 | 1 |" in text
    assert "2 rows are outside, 1 of them unexplained." in text
    miss = next(line for line in text.splitlines() if line.startswith("| `hold_zr_p1_07` | predicted"))
    assert "The spool closes late." in miss and "`hold_zr_p1_09`" in miss
    assert any(line.startswith("| `hold_zr_p1_10` | predicted") and "unexplained" in line for line in text.splitlines())
    assert any(line.startswith("| `hold_zr_p1_08`, `hold_zr_p1_09` |") for line in text.splitlines())


def test_explanations_name_rows_that_exist(tmp_path):
    assert set(document.load_explanations()) <= set(TARGETS)
    path = tmp_path / "e.yaml"
    path.write_text("up_t_dt_range: late\npeaks: high\n")
    with pytest.raises(RigError, match=r"e.yaml:2: 'peaks' is no row"):
        document.load_explanations(path)
    path.write_text("up_t_dt_range: 3\n")
    with pytest.raises(RigError, match="in words"):
        document.load_explanations(path)


# --- figures --------------------------------------------------------------------------------------


def test_a_chart_has_each_line_with_its_gaps_and_what_is_accepted_on_real_axes():
    lines = [Line("one", [1.0, 10.0, 100.0, 1000.0], [1.0, 10.0, None, 5.0]), Line("two", [1.0, 1000.0], [2.0, 3.0], dashed=True)]
    drawn = draw_figure(chart("a < b", "x", "y", lines, (None, 5.0), (True, True)))
    (axes,) = drawn.axes
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
    solid = next(one for one in axes.get_lines() if one.get_label() == "one" and one.get_linestyle() == "-")
    assert np.isnan(solid.get_ydata()[2]) and solid.get_ydata()[1] == 10.0
    looks = [(one.get_color(), one.get_linestyle()) for one in axes.get_lines() if one.get_label() in ("one", "two")]
    assert len(set(looks)) == 4
    words = {one.get_text() for one in axes.texts}
    assert {"one", "two", "accepted up to 5"} <= words
    for axis, (low, high) in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
        assert sum(low <= one <= high for one in axis.get_majorticklocs()) >= 4


def test_figures_show_the_grid_and_what_is_accepted():
    records = [shift(rpm, nm, t_dt_s=0.3 + nm * 1e-4) for rpm in (1000, 2000) for nm in (40, 80, 120)]
    found = dict(figures([*records, shift(1000, 0, t_dt_s=9.0)]))
    figure = found["fig_7_35"]
    (panel,) = figure.panels
    lines = [one for one in panel.curves if one.style == SOLID]
    assert [one.signal for one in lines] == ["1000 rpm", "2000 rpm"]
    assert lines[0].t.tolist() == [40.0, 80.0, 120.0] and lines[0].y[0] == pytest.approx(0.304)
    assert [one.y for one in panel.levels] == [0.26, 0.4]
    assert found["fig_7_36"].panels[0].curves[0].t == pytest.approx([1000.0, 2000.0])
    assert "fig_7_44" not in found


def test_every_figure_over_time_has_its_series_and_is_cut_around_its_order():
    for course in time_courses.COURSES:
        assert len(load_procedure(course.procedure).series([course.series])) == 1, course.figure
    recording = Shift(up=True, peak=250.0).recording()
    course = next(one for one in time_courses.COURSES if one.figure == "7_19")
    found = dict(time_courses.draw(course, SimpleNamespace(recording=recording)))
    assert set(found) == {"fig_7_19_torque", "fig_7_19_speed", "fig_7_19_pressure"}
    torque = found["fig_7_19_torque"].panels[0].curves[0]
    assert torque.signal == "M_wej" and torque.t[0] == pytest.approx(-0.1) and torque.t[-1] == pytest.approx(1.2)
    assert max(torque.y) == pytest.approx(250.0, rel=5e-3)
    downwards = next(one for one in time_courses.COURSES if one.figure == "7_25")
    assert time_courses.draw(downwards, SimpleNamespace(recording=recording)) == []
