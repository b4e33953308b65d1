# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The figures of whole runs: they hold every extreme of the report, and answer the rig's question first."""

import numpy as np
import pytest

import rig_nodes
from rig_nodes.view import Pages, draw_figure, figure_of_shift, figures_of_compare, figures_of_run

from ..labels import hidden, struck

RIGS = {"hydmag": "demo", "ural2": "demo", "cylinder_bench": "cylinder_bench"}
OTHERS = dict.fromkeys(
    ("chain_saw", "chapter9", "frame_saw", "hydmag_coupling", "hydmag_engine", "hydmag_hydrostatic", "three_speed"), "demo"
)
OTHERS |= {rig: rig for rig in ("clutch_bench", "spring_bench")}
NO_PLACE = {  # oscillating torques fill their plot; the three strokes of the springs lie within 20 pixels
    "chain_saw": ["shoe_clutch_torque"],
    "ural2": ["shoe_clutch_torque"],
    "spring_bench": ["F_ps, measured"],
}


@pytest.fixture(scope="module")
def drawn():
    """Run and figures of a rig; none is simulated before it is asked for."""
    made = {}

    def of(rig):
        if rig not in made:
            run = rig_nodes.load(rig).simulate((RIGS | OTHERS)[rig], seed=1)
            made[rig] = run, figures_of_run(run.report, Pages(run.record), run.folder, run.signals.span)
        return made[rig]

    return of


@pytest.mark.parametrize("rig", RIGS)
def test_a_figure_shows_the_extremes_of_all_its_signals(drawn, rig):
    run, figures = drawn(rig)
    pages = Pages(run.record)
    for figure in figures:
        for curve in (one for panel in figure.panels for one in panel.curves if one.signal in run.signals):
            if curve.column == 0 and not curve.text.startswith("d"):
                values = pages.signal(curve.signal).shown(np.asarray(run.signals[curve.signal]))
                low, high = curve.band or (curve.y, curve.y)
                assert (low.min(), high.max()) == pytest.approx((np.nanmin(values), np.nanmax(values))), curve.signal


def test_the_table_of_a_rig_without_shifts_has_the_extremes_of_the_curves(drawn):
    run, (first, *_) = drawn("ural2")
    rows = {row["signal"]: row for row in run.report["signals"]}
    for curve in (one for panel in first.panels for one in panel.curves if one.column == 0):
        low, high = curve.band or (curve.y, curve.y)
        row = rows[curve.signal]
        assert (low.min(), high.max()) == pytest.approx((row["lowest"], row["highest"]), abs=1e-6), curve.signal


@pytest.mark.parametrize("rig", RIGS)
def test_no_two_curves_look_alike_each_axis_has_four_numbers_and_labels_hide_nothing(drawn, rig):
    for figure in drawn(rig)[1]:
        for panel in figure.panels:
            looks = [(one.colour, one.style, one.column) for one in panel.curves]
            assert len(set(looks)) == len(looks), panel.title
        picture = draw_figure(figure)
        assert hidden(picture) == hidden(draw_figure(figure, width=370)) == []
        for axes in picture.axes:
            for axis, (low, high) in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
                assert sum(low <= one <= high for one in axis.get_majorticklocs()) >= 4


@pytest.mark.parametrize("rig", RIGS | OTHERS)
def test_no_curve_or_line_strikes_a_label_through_where_a_place_is_free(drawn, rig):
    run, figures = drawn(rig)
    pages, shifts = Pages(run.record), range(1, len(run.report["shifts"]) + 1)
    figures = [*(figure_of_shift(run.report, shift, pages, run.signals, run.signals.span) for shift in shifts), *figures]
    assert [one for figure in figures for one in struck(draw_figure(figure))] == NO_PLACE.get(rig, [])


def test_a_saw_opens_on_its_own_page_with_three_turns_beside_the_run(drawn):
    _, (first, run) = drawn("ural2")
    assert first.title.startswith("Shafts: ") and run.title.startswith("Run: ")
    whole, turns = first.columns
    assert (
        whole.title == "time [s]"
        and turns.title.startswith("angle of n_engine around ")
        and (turns.first, turns.last) == (0.0, 1080.0)
    )
    shafts = next(one for one in first.panels if one.title == "Torque of the engine's shafts")
    assert all(one.band is not None for one in shafts.curves if one.column == 0), "what is fast is a band"
    close = next(one for one in shafts.curves if one.column == 1)
    inside = (close.t >= 0.0) & (close.t <= 1080.0)
    turning = np.abs(np.fft.rfft(np.interp(np.linspace(0.0, 1080.0, 1000), close.t[inside], close.y[inside])))
    assert int(turning[1:].argmax()) + 1 == 3, "one oscillation a turn"


def test_a_bench_shows_its_result_with_the_line_through_it(drawn):
    run, (first, *_) = drawn("cylinder_bench")
    assert first.title == "Force of the cylinder over its pressure" and first.columns[0].title == "pressure [MPa]"
    curves = {one.signal: one for one in first.panels[0].curves}
    rows = run.report["bench"]["cylinder"]
    assert curves["f_p_n"].y.tolist() == [row["f_p_n"] for row in rows]
    slope, rest = np.polyfit([1e-6 * row["cylinder_pa"] for row in rows], [row["f_p_n"] for row in rows], 1)
    assert curves["line"].y == pytest.approx(slope * curves["line"].t + rest)
    assert f"{slope:.4g} N/MPa" in first.sentence
    assert "constant: " in drawn("cylinder_bench")[1][1].conditions, "what stands still is said in words"


def test_recordings_are_drawn_from_their_own_orders_with_their_differences(drawn):
    run, _ = drawn("hydmag")
    other = rig_nodes.load("hydmag", **{"alfa46.t12": "-150 ms"}).simulate("demo", seed=2)
    compared = run.compare(other)
    first, second = figures_of_compare(compared.found, Pages(run.record))
    assert "I → II" in first.title and "II → I" in second.title
    over, apart = (next(one for one in first.panels if one.title == title) for title in ("Shaft torque", "less the first"))
    high = [one.y.max() for one in over.curves if one.signal == run.report["basis"].get("input", "M_wej")]
    expected = [one.report["shifts"][0]["input_torque_high_nm"] for one in (run, other)]
    assert high == pytest.approx(expected, abs=2.0), "the peaks of the tables"
    assert all(one.style != over.curves[0].style for one in apart.curves)
    for panel in first.panels:
        looks = [(one.colour, one.style) for one in panel.curves]
        assert len(set(looks)) == len(looks)
    assert hidden(draw_figure(first)) == hidden(draw_figure(second)) == []
    with pytest.raises(rig_nodes.RigError, match="there is no shift 3; the first recording has 2 shifts"):
        compared.plot(3)
