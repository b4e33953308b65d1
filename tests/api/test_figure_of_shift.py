# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The figure of a shift shows the report's own numbers, and no label hides what it shows."""

import functools
import json
import shutil
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import rig_nodes
from rig_nodes.analysis import asked_of_input, bounds_of, moments_of, phases_of, quality_of, read_report, shown_transmission
from rig_nodes.cli.main import main
from rig_nodes.view import Pages, figure_of_shift
from rig_nodes.view.figure import SOLID

from ..labels import hidden, struck

SAMPLE = Path(__file__).resolve().parents[2] / "bags" / "sample"
CASES = ("good", "tie-up", "hole", "interrupted", "three gears")
DRAWN = [pytest.param(case, marks=pytest.mark.campaign if case == "hole" else ()) for case in CASES]


@pytest.fixture(scope="module")
def runs():
    """A run by its case; none is simulated before it is asked for."""
    made = {}

    def run(case):
        if case not in made:
            t12 = {"tie-up": "-300 ms", "hole": "-120 ms", "interrupted": "200 ms"}.get(case)
            settings = {"alfa46": {"t12": t12}} if t12 else {}
            made[case] = rig_nodes.load("three_speed" if case == "three gears" else "hydmag", **settings).simulate("demo", seed=1)
        return made[case]

    return run


@pytest.fixture(scope="module")
def figures(runs):
    """A shift's figure by case and number; none is drawn before it is asked for."""
    return functools.cache(lambda case, number: runs(case).plot(shift=number))


def described(run, number=1):
    return figure_of_shift(run.report, number, Pages(run.record), run.signals, run.signals.span)


@pytest.mark.parametrize("case", CASES)
def test_marked_extremes_and_phases_are_those_of_the_report(runs, case):
    run = runs(case)
    row, of = run.report["shifts"][0], described(run)
    torque = next(panel for panel in of.panels if panel.title == "shaft torque")
    high, low = torque.rings
    curve = torque.curves[0]
    course = (curve.t >= -0.01) & (curve.t <= 1e3 * row["course_s"] + 0.01)
    assert high.y == pytest.approx(row["input_torque_high_nm"], abs=0.05) == pytest.approx(curve.y[course].max(), abs=0.05)
    assert low.y == pytest.approx(row["input_torque_low_nm"], abs=0.05) == pytest.approx(curve.y[course].min(), abs=0.05)
    for ring in (high, low):
        assert np.interp(ring.t, curve.t, curve.y) == pytest.approx(ring.y, abs=0.2)
    for panel in of.panels:
        for ring in panel.rings:
            on = [abs(float(np.interp(ring.t, one.t, one.y)) - ring.y) for one in panel.curves if one.colour == ring.colour]
            assert min(on) < 0.002 * max(abs(ring.y), 1.0), ring.text
    rings = {panel.title: panel.rings for panel in of.panels}
    assert rings["speed"][0].y == pytest.approx(row["output_speed_low_rpm"], abs=0.5)
    for ring in rings["pressure"]:
        curve = next(one for one in of.panels[0].curves if one.signal == ring.text.split()[0] and one.style == SOLID)
        assert ring.y == curve.y[(curve.t >= 0.0) & (curve.t <= 1e3 * (row["t_c_s"] + row["t_o_s"]))].max()
    assert bool(rings["pressure"]) == (case != "three gears"), "p2 overshoots"
    found = {one.kind: (one.start, one.end) for one in of.stretches}
    assert found["fill"] == pytest.approx((0.0, 1e3 * row["kiss_s"]), abs=1.0)
    start = 1e3 * (row["departure_s"] + (row["interrupted_s"] or 0.0))
    assert found["inertia phase"] == pytest.approx((start, 1e3 * row["t_c_s"]), abs=1.0)
    assert found["settling"] == pytest.approx((1e3 * row["t_c_s"], 1e3 * (row["t_c_s"] + row["t_o_s"])), abs=1.0)
    assert ("interrupted" in found) == (row["interrupted_s"] > 0.0)


@pytest.mark.parametrize("case", DRAWN)
def test_the_drawn_phases_and_lines_are_those_of_the_report(runs, figures, case):
    run = runs(case)
    row = run.report["shifts"][0]
    phases = [(1e3 * (one.start - row["t_order_s"]), 1e3 * (one.end - row["t_order_s"])) for one in phases_of(row)]
    settled = 1e3 * row["t_c_s"], 1e3 * (row["t_c_s"] + row["t_o_s"])
    marks = sorted([1e3 * (t - row["t_order_s"]) for t in moments_of(row).values()] + [settled[1]])
    for figure in (figures(case, 1), *([run.plot(shift=1, dark=True)] if case == "good" else [])):
        for axes in figure.axes:
            spans = [
                (box.x0, box.x1) for patch in axes.patches for box in [patch.get_extents().transformed(axes.transData.inverted())]
            ]
            assert np.allclose(spans, [*phases, settled], atol=1.0)
            upright = [line.get_xdata()[0] for line in axes.lines if line.get_transform() == axes.get_xaxis_transform()]
            limit = bounds_of(row, shown_transmission(run.report))["t_c_s"][1]
            assert np.allclose(upright, [*marks, 1e3 * limit], atol=1.0)


@pytest.mark.parametrize("case", CASES)
def test_the_highest_torque_is_what_load_inertia_tie_up_and_losses_make(runs, case):
    run = runs(case)
    box = shown_transmission(run.report)
    for number, row in enumerate(run.report["shifts"], 1):
        if (parts := row["peak"]) is None:
            continue
        total = sum(value for key, value in parts.items() if key != "error_nm")
        assert abs(row["input_torque_high_nm"] - total) == pytest.approx(parts["error_nm"], abs=1e-9)
        share = 0.15 if case == "three gears" else 0.04  # the wheels inside are not counted, of which a planetary set has more
        assert parts["error_nm"] < share * row["input_torque_high_nm"]
        assert parts["load_nm"] <= asked_of_input(row, box) * (1.0 + 1e-9) and parts["losses_nm"] > 0.0
        assert run.shifts[number - 1]["peak.tie_up_nm"] == parts["tie_up_nm"] and run.shifts.units["peak.tie_up_nm"] == "Nm"
        assert f"inertia {parts['inertia_nm']:.0f}" in described(run, number).sentence or abs(parts["inertia_nm"]) < 0.5
    assert any(row["peak"] for row in run.report["shifts"])


def test_a_tie_up_is_a_part_of_the_highest_torque(runs):
    parts = {case: runs(case).report["shifts"][0]["peak"]["tie_up_nm"] for case in ("tie-up", "good", "hole", "interrupted")}
    assert list(parts.values()) == sorted(parts.values(), reverse=True) and parts["tie-up"] > 3.0 * parts["interrupted"] > 0.0


def test_drawing_a_shift_is_quick(runs, figures):
    figures("good", 1)._repr_png_()  # what is loaded with the first one
    began = time.process_time()
    runs("good").plot(shift=1)._repr_png_()
    assert time.process_time() - began < 2.0 * 0.6, "s of processor time, twice what it takes on a machine that does nothing else"


@pytest.mark.parametrize("case", DRAWN)
def test_curves_differ_axes_have_ticks_and_labels_hide_nothing(runs, figures, case):
    run = runs(case)
    for number in range(1, len(run.report["shifts"]) + 1):
        figure = figures(case, number)
        for panel in described(run, number).panels:
            looks = [(one.colour, one.style) for one in panel.curves]
            assert len(looks) == len(set(looks)), panel.title
        for axes in figure.axes:
            for ticks, (first, last) in ((axes.get_xticks(), axes.get_xlim()), (axes.get_yticks(), axes.get_ylim())):
                assert np.count_nonzero((ticks >= first) & (ticks <= last)) >= 4
        assert hidden(figure) == [] == struck(figure)
        written = {text.get_text() for axes in figure.axes for text in axes.texts}
        curves = [curve for panel in described(run, number).panels for curve in panel.curves if curve.text]
        assert all({curve.text, curve.short} & written for curve in curves)


def test_each_case_says_what_happened_and_what_limited_it(runs):
    said = {case: (of.title, of.grade, of.sentence) for case in CASES[:4] for of in [described(runs(case))]}
    assert {title for title, *_ in said.values()} == {"Upshift I → II under load"}
    assert [grade for _, grade, _ in said.values()] == ["fair", "fair", "poor", "failed"]
    assert "let p2 rise more slowly" in said["good"][2] and said["hole"][2].startswith("The output dipped to 83 % of its speed")
    assert said["interrupted"][2].startswith("The output stood still: the drive was interrupted")
    texts = {case: [one.text for panel in described(runs(case)).panels for one in panel.hatches] for case in CASES[:4]}
    assert texts["tie-up"][0].startswith("tie-up: S1 still brakes with up to ") and not texts["hole"]
    assert "alfa46.t12 0.2 s" in described(runs("interrupted")).conditions


def test_the_numbers_at_the_foot_are_the_table_with_its_limits(runs):
    found = {one.key: one for one in described(runs("good")).numbers}
    assert found["input_torque_high_nm"].value == "265.3 Nm" and found["input_torque_high_nm"].met is False
    assert found["t_c_s"].value == "672 ms" and (found["t_c_s"].limit, found["t_c_s"].met) == ("≤ 725", True)
    assert found["t_p_s"].met is None and found["t_p_s"].limit == "" and found["t_p_s"].name == "change of speed t_p"
    interrupted = described(runs("interrupted"))
    lengths = {one.kind: one.end - one.start for one in interrupted.stretches}
    (number,) = (one for one in interrupted.numbers if one.key == "t_p_s")
    both = lengths["interrupted"] + lengths["inertia phase"]
    assert number.name == "t_p with interruption" and float(number.value.split()[0]) == pytest.approx(both, abs=1.0)


def test_the_users_own_limits_are_those_of_the_figure(tmp_path, runs, capsys):
    run = runs("good")
    folder = shutil.copytree(run.folder, tmp_path / "run")
    limits = ("I-II:t_c=.. 600 ms", "t_o=.. 400 ms", "overlap=-50 ms ..", "input_torque_high_nm=100 Nm .. 200 Nm")
    assert main(["report", str(folder), "--json", *(part for one in limits for part in ("--limit", one))]) == 0
    report = json.loads(capsys.readouterr().out)
    row, first = report["shifts"][0], report["limits"][0]
    report["limits"].append(first | {"key": "e_loss_j", "low": None, "high": 100.0, "value": None, "verdict": "not found"})
    row["e_loss_j"] = None
    of, alone = (figure_of_shift(report, 1, Pages(run.record), run.signals, run.signals.span, part) for part in (False, True))
    assert "shift 1 at " in of.conditions and alone.conditions == of.conditions.replace("shift 1 at ", "at ")
    found = {one.key: (one.limit, one.met) for one in of.numbers}
    assert found["t_c_s"] == ("≤ 600", False) and found["overlap_s"] == ("≥ -50", None) and found["t_o_s"] == ("≤ 400", True)
    assert found["input_torque_high_nm"] == ("≥ 100 and ≤ 200", False) and found["e_loss_j"] == ("≤ 100", False)
    lines = {one.text: one.t for one in of.moments if one.limit}
    assert lines == {"t_c ≤ 600 ms": pytest.approx(600.0), "t_o ≤ 400 ms": pytest.approx(1e3 * row["t_c_s"] + 400.0)}
    torque = next(panel for panel in of.panels if panel.title == "shaft torque")
    low = bounds_of(row, shown_transmission(report))["input_torque_low_nm"][0]
    assert [one.y for one in torque.levels if one.limit] == pytest.approx([100.0, 200.0, low])
    missed = "order to lock-up t_c, input torque, highest, energy lost"
    assert f"Outside the limits that were given: {missed}." in of.sentence and "kept within" not in of.sentence


def test_a_good_shift_claims_only_what_was_judged(runs):
    run = runs("good")
    report = json.loads(json.dumps(run.report))
    report["quality"][0] = {"grade": "good", "peak_ratio": None, "reasons": []}

    def said():
        return figure_of_shift(report, 1, Pages(run.record), {}, run.signals.span).sentence

    assert said().startswith("Gear II was reached after 672 ms, and torque and speed kept within the limits.")
    report["shifts"][0]["in_gear"] = False  # then neither torque nor speed is judged
    assert said().startswith("Gear II was reached after 672 ms. ")


@pytest.mark.parametrize("case", CASES)
def test_a_shift_is_good_when_it_keeps_its_bounds(runs, case):
    report = runs(case).report
    box = shown_transmission(report)
    for row in report["shifts"]:
        inside = all(
            (low is None or row[key] >= low) and (high is None or row[key] <= high)
            for key, (low, high) in bounds_of(row, box).items()
        )
        assert (quality_of(row, box)["grade"] == "good") == inside


def test_panels_without_signals_are_left_out(runs):
    run = runs("good")
    few = {name: run.signals[name] for name in ("M_wej", "n_wej", "n_wyj", "p2")}
    of = figure_of_shift(run.report, 1, Pages(run.record), few, run.signals.span)
    assert [panel.title for panel in of.panels] == ["pressure", "shaft torque", "speed"]
    assert [[curve.signal for curve in panel.curves] for panel in of.panels][:2] == [["p2"], ["M_wej"]]


def test_a_shift_that_was_cut_off_and_an_engagement_are_drawn_too():
    steps = [
        {"oil": {"pressure": "4 MPa"}},
        {"wait": {"until": {"signal": "p_p", "above": "3.9 MPa"}}},
        {"shift": {"to": "I"}},
        {"motor": {"speed": "1500 rpm"}},
        {"wait": {"until": {"signal": "n_wej", "near": "1500 rpm", "within": "8 rpm"}, "hold": "200 ms"}},
        {"shift": {"to": "neutral"}},
        {"wait": {"for": "300 ms"}},
        {"shift": {"to": "I"}},
        {"wait": {"for": "300 ms"}},
        {"shift": {"to": "II", "timeout": "300 ms"}},
    ]
    run = rig_nodes.load("hydmag").simulate(steps)
    engaged, cut_off = described(run, 1), described(run, 2)
    assert (engaged.title, engaged.grade) == ("Engagement of I from neutral", "")
    assert [curve.signal for curve in engaged.panels[0].curves] == ["p1", "I_set_zr_p1"]
    assert cut_off.grade == "failed" and cut_off.sentence.startswith("Gear II was not reached. Not valid: p2 never rose")
    assert len(cut_off.columns) == 1 and not cut_off.stretches and not cut_off.panels[0].rings
    assert len(run.plot(shift=2).axes) == len(cut_off.panels)


def test_the_command_writes_png_and_svg_and_refuses_the_rest(tmp_path, capsys):
    run = shutil.copytree(SAMPLE, tmp_path / "run")
    for name, start in (("shift.svg", b"<?xml"), ("shift.png", b"\x89PNG")):
        assert main(["report", str(run), "--picture", str(tmp_path / name)]) == 0
        assert (tmp_path / name).read_bytes().startswith(start)
    light = np.asarray(Image.open(tmp_path / "shift.png").convert("RGB"))
    assert main(["report", str(run), "--picture", str(tmp_path / "shift.png"), "--dark"]) == 0  # the older one is replaced
    dark = np.asarray(Image.open(tmp_path / "shift.png").convert("RGB"))
    assert light.shape == dark.shape and light[0, 0].min() > 240 and dark[0, 0].max() < 60, "the same figure on another ground"
    (tmp_path / "mine.png").write_bytes(b"\x89PNG\r\n of somebody")
    count = len(read_report(run)["shifts"])
    for refused, sentence in (
        (["--picture", str(tmp_path / "mine.png")], "it exists and is no older file of this kind"),
        (["--picture", str(tmp_path / "shift.jpg")], "a file that ends in .png or .svg"),
        (["--picture", str(tmp_path / "shift.png"), "--shift", "9"], f"there is no shift 9; the run has {count} shifts"),
        (["--shift", "1"], "--shift says which shift --picture draws; give --picture too"),
        (["--dark"], "--dark is the ground of --picture; give --picture too"),
    ):
        assert main(["report", str(run), *refused]) != 0
        assert sentence in capsys.readouterr().err
