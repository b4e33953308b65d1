# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The figures of whole runs and of comparisons: they hold every extreme of the report, and answer the rig's question first."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

import rig_nodes
from rig_nodes.rigs.hydmag.laboratory import time_courses
from rig_nodes.view import Pages, draw_figure, figure_of_shift, figures_of_compare, figures_of_run, write_compare_file
from rig_nodes.view.figure import DASHED, DOTTED, SOLID, Curve, Description, Panel, column_of
from rig_nodes.view.page_of_report import compare_page
from rig_nodes.view.palette import CLUTCHES
from rig_nodes.view.recorded import derivative

from ..labels import hidden, struck

RIGS = dict.fromkeys(
    (
        "hydmag",
        "ural2",
        "chain_saw",
        "chapter9",
        "frame_saw",
        "hydmag_coupling",
        "hydmag_engine",
        "hydmag_hydrostatic",
        "three_speed",
    ),
    "demo",
)
RIGS |= {rig: rig for rig in ("cylinder_bench", "clutch_bench", "spring_bench")}
ON_A_PHONE = "hydmag", "ural2", "cylinder_bench"  # one with shifts, one without, a bench; the others are for the campaign
EVERY_RIG = [rig if rig in ON_A_PHONE else pytest.param(rig, marks=pytest.mark.campaign) for rig in RIGS]
SAWS = [rig for rig in EVERY_RIG if (rig if isinstance(rig, str) else rig.values[0]) in ("ural2", "chain_saw", "frame_saw")]


def over_bands(figure: Figure) -> list[str]:
    """Returns a sentence for each label that lies over the highest or the lowest point of a band."""
    renderer, found = FigureCanvasAgg(figure).get_renderer(), []
    for axes in figure.axes:
        labels = [(text.get_text(), text.get_window_extent(renderer)) for text in axes.texts]
        for area in (one for one in axes.collections if isinstance(one, PolyCollection) and not one.get_hatch()):
            points = axes.transData.transform(np.concatenate([path.vertices for path in area.get_paths()]))
            points = points[(points[:, 0] >= axes.bbox.x0) & (points[:, 0] <= axes.bbox.x1)]
            ends = [points[at] for at in (points[:, 1].argmin(), points[:, 1].argmax())] if len(points) else []
            found += [f"'{one}' is over an end of a band" for one, box in labels if any(box.contains(*end) for end in ends)]
    return found


@pytest.fixture(scope="module")
def drawn():
    """Run and figures of a rig; none is simulated before it is asked for."""
    made = {}

    def of(rig):
        if rig not in made:
            run = rig_nodes.load(rig).simulate(RIGS[rig], seed=1)
            made[rig] = run, figures_of_run(run.report, Pages(run.record), run.folder, run.signals.span)
        return made[rig]

    return of


@pytest.fixture(scope="module")
def compared(drawn):
    """Two runs, the second with another delay, and their comparison."""
    run, _ = drawn("hydmag")
    other = rig_nodes.load("hydmag", **{"alfa46.t12": "-150 ms"}).simulate("demo", seed=2)
    return run, other, run.compare(other)


@pytest.mark.parametrize("rig", EVERY_RIG)
def test_a_figure_shows_the_extremes_of_all_its_signals(drawn, rig):
    run, figures = drawn(rig)
    pages, count = Pages(run.record), 0
    for figure in figures:
        for curve in (one for panel in figure.panels for one in panel.curves if one.column == 0):
            source = pages.rates[curve.signal][1] if curve.signal in pages.rates else curve.signal
            if source not in run.signals:
                continue  # the heat of a clutch
            values = np.asarray(run.signals[source])
            if curve.signal in pages.rates:
                _, values = derivative(np.asarray(run.signals[source].time), values)
            values, count = pages.signal(curve.signal).shown(values), count + 1
            low, high = curve.band or (curve.y, curve.y)
            assert (low.min(), high.max()) == pytest.approx((np.nanmin(values), np.nanmax(values))), curve.signal
    assert count > 1


def test_the_table_of_a_rig_without_shifts_has_the_extremes_of_the_curves(drawn):
    run, (first, *_) = drawn("ural2")
    rows = {row["signal"]: row for row in run.report["signals"]}
    for curve in (one for panel in first.panels for one in panel.curves if one.column == 0):
        low, high = curve.band or (curve.y, curve.y)
        row = rows[curve.signal]
        assert (low.min(), high.max()) == pytest.approx((row["lowest"], row["highest"]), abs=1e-6), curve.signal


@pytest.mark.parametrize("rig", EVERY_RIG)
def test_no_two_curves_look_alike_each_axis_has_four_numbers_and_labels_are_free(drawn, rig):
    run, figures = drawn(rig)
    pages, shifts, crossed = Pages(run.record), range(1, len(run.report["shifts"]) + 1), []
    of_shifts = [figure_of_shift(run.report, shift, pages, run.signals, run.signals.span) for shift in shifts]
    for figure in (*of_shifts, *figures):
        for panel in figure.panels:
            looks = [(one.colour, one.style, one.column) for one in panel.curves]
            assert len(set(looks)) == len(looks), panel.title
        picture = draw_figure(figure)
        assert hidden(picture) == over_bands(picture) == []
        crossed += struck(picture)
        for axes in picture.axes:
            for axis, (low, high) in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
                assert sum(low <= one <= high for one in axis.get_majorticklocs()) >= 4
    assert crossed == []
    for figure in figures if rig in ON_A_PHONE else ():
        assert hidden(draw_figure(figure, width=370)) == []
    for figure in of_shifts if rig in ON_A_PHONE else ():
        picture = draw_figure(figure, width=370)
        assert hidden(picture) == struck(picture) == []


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


def test_a_fault_is_named_where_it_begins_and_ends_and_no_name_lies_over_another(drawn):
    run, (*_, figure) = drawn("cylinder_bench")
    first, last = figure.columns[0].first, figure.columns[0].last
    faults = [{"name": "clogged filter", "from_s": at, "to_s": end} for at, end in ((first, 0.5 * last), (0.98 * last, None))]
    report = {**run.report, "run": {**run.report["run"], "faults": faults}}
    figure = figures_of_run(report, Pages(run.record), run.folder, run.signals.span)[-1]
    assert [(one.t, one.sign) for one in figure.moments] == [
        (first, "clogged filter"),
        (0.5 * last, "clogged filter ends"),
        (0.98 * last, "clogged filter"),
    ]
    crowded = replace(figure, moments=(*figure.moments, *(replace(figure.moments[0], t=at) for at in (0.01 * last, 0.52 * last))))
    for width in (1100, 370):
        assert hidden(draw_figure(crowded, width=width)) == []


def test_recordings_are_drawn_from_their_own_orders_with_their_differences(compared):
    run, other, found = compared
    first, second = figures_of_compare(found.found, Pages(run.record))
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
        found.plot(3)


def test_the_page_of_a_comparison_says_which_shifts_it_does_not_draw(compared, monkeypatch):
    run, _, found = compared
    monkeypatch.setattr("rig_nodes.view.page_of_report.MOST", 1)
    text = compare_page(found.found, Pages(run.record))
    assert "Figures of the first 1 of 2 shifts." in text and text.count("<svg") == 2


def test_the_file_for_rerun_has_the_figures_with_their_marks_phases_and_colours(compared, tmp_path, read_rrd):
    run, _, found = compared
    pages, row = Pages(run.record), run.report["shifts"][0]
    write_compare_file(found.found, pages, tmp_path / "compared.rrd")
    rrd = read_rrd(tmp_path / "compared.rrd")
    figure = figures_of_compare(found.found, pages)[0]
    place = next(n for n, panel in enumerate(figure.panels) if panel.title == "Shaft torque")
    curves = figure.panels[place].curves
    for k, curve in enumerate(curves):
        times, values = rrd.rows(f"/figure_0/{place}/{k}", "Scalars:scalars")
        np.testing.assert_allclose(values, curve.y[np.isfinite(curve.y)])
        assert times[0] == pytest.approx(1e6 * curve.t[np.isfinite(curve.y)][0], abs=2.0), "ns after the order"
    names = [rrd.data[f"/figure_0/{place}/{k}"]["SeriesLines:names"][0] for k in range(len(curves))]
    assert len(set(names)) == len(names) == 4 and not any("/" in name for name in names), "short names"
    (colour,) = {rrd.data[f"/figure_0/{place}/{k}"]["SeriesLines:colors"][0] >> 8 for k in (0,)}
    assert colour == int.from_bytes(bytes(pages.colour(curves[0].signal)), "big"), "that of the signal"
    marks, _ = rrd.rows(f"/figure_0/{place}/marks", "Scalars:scalars")
    np.testing.assert_allclose(np.unique(marks[1:]), [1e6 * one.t for one in figure.moments], atol=2.0)
    labels = " ".join(rrd.data["/figure_0/phases"]["StateConfiguration:labels"])
    assert f"fill {1e3 * row['kiss_s']:.0f} ms" in labels
    assert {"Shaft torque [Nm]", "less the first [Nm]"} <= set(rrd.views())


def test_a_figure_of_the_validation_has_the_colours_of_its_signals(drawn):
    run, _ = drawn("hydmag")
    pages = Pages(run.record)
    course = next(one for one in time_courses.COURSES if one.gears == time_courses.UP)
    parts = time_courses.draw(course, SimpleNamespace(recording=run.source().recording))
    curves = [curve for _, figure in parts for panel in figure.panels for curve in panel.curves]
    assert {one.signal: one.colour for one in curves} == {one.signal: pages.look(one.signal).colour for one in curves}
    assert len(curves) == 6


@pytest.mark.parametrize("rig", SAWS)
def test_a_saws_run_has_a_plot_for_what_is_measured_what_drives_and_what_the_clutch_carries(drawn, rig):
    run, figures = drawn(rig)
    pages = Pages(run.record)
    measured = {one.name for one in pages.structure.transducers}
    for panel in figures[-1].panels:
        names = {one.signal for one in panel.curves}
        assert len(names) <= 4 and (names <= measured or not names & measured or "peed" in panel.title), panel.title
    drawn_curves = [one for figure in figures for panel in figure.panels for one in panel.curves]
    whole = {one.signal: np.ptp(np.concatenate([one.y, *(one.band or ())])) for one in drawn_curves if one.column == 0}
    close = [one for one in drawn_curves if one.column == 1 and np.ptp(one.y) > 0.1 * whole[one.signal]]
    assert all(len(one.t) > 20 for one in close), "three turns of fewer samples have no shape"
    words = {one.text for one in drawn_curves}
    assert not [one for one in words if "_" in one and one not in measured], "names of the program where a device has one"


@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize("style", [DASHED, DOTTED])
def test_an_order_is_seen_on_an_actual_value_that_follows_it(style, dark):
    t = np.linspace(0.0, 10.0, 200)
    actual, order = (Curve("p", "", "", CLUTCHES[0], one, t, np.sin(t)) for one in (SOLID, style))
    seen = []
    for curves in ((actual,), (actual, order)):
        canvas = FigureCanvasAgg(draw_figure(Description("", "", "", "", (column_of(t, "s"),), (Panel("p", "MPa", curves),)), dark))
        canvas.draw()
        seen.append(np.asarray(canvas.buffer_rgba())[:, :, :3].astype(int))
    ground = seen[0][0, 0]
    covered = (np.abs(seen[0] - ground).sum(axis=2) > 200) & (np.abs(seen[1] - ground).sum(axis=2) < 100)
    assert covered.sum() > 100, "pixels of a line of 1000"
