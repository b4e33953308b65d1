# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The file that `rig view` writes: signals, states, events, report, layout, also of runs with parts missing."""

import json
import re
import tracemalloc
from itertools import combinations, pairwise

import numpy as np
import pytest

from rig_nodes.analysis.report_text import format_report
from rig_nodes.bags.reader import Bag
from rig_nodes.bags.writer import BagWriter
from rig_nodes.base.errors import BagError, RigError
from rig_nodes.cli.main import main
from rig_nodes.controllers import load_controller
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.sequence import load_sequence
from rig_nodes.runs.simulation import simulate
from rig_nodes.view import convert, layout
from rig_nodes.view.convert import make_view
from rig_nodes.view.curves import thinned
from rig_nodes.view.document import report_document
from rig_nodes.view.page_of_report import Facts, report_page
from rig_nodes.view.pages import Pages

HYDMAG = load_rig("hydmag")
BOX = HYDMAG.transmission
CATALOGUE = HYDMAG.catalogue


@pytest.fixture(scope="module")
def shown(viewed, read_rrd):
    """The view of the demo run, read back."""
    return read_rrd(viewed / "view.rrd")


@pytest.fixture
def orders(recorded):
    """Times [s] of the two gear changes: to II, and back to I."""
    return [t for t, _, name, _, _ in Bag(recorded).events() if name == "shift_ordered"][1:]


def path_of(name):
    return "/" + layout.entity(CATALOGUE.signal(name))


@pytest.mark.parametrize("name", [s.name for s in CATALOGUE.signals.values() if not s.states])
def test_curves_are_the_bags_values_in_peoples_units(shown, recorded, name):
    bag, signal = Bag(recorded), CATALOGUE.signal(name)
    if signal.logger is not None:
        logger = bag.logger()
        t, values = logger.time(), logger.channels[name]
    else:
        t, values = bag.series(name)
    times, curve = shown.rows(path_of(name), "Scalars:scalars")
    np.testing.assert_array_equal(times, np.round(t * 1e9))
    np.testing.assert_array_equal(curve, values * signal.scale)
    (label,) = shown.data[path_of(name)]["SeriesLines:names"]
    assert re.sub("[ -]", "_", label).lower() == re.sub("[ -]", "_", f"{name} [{signal.display_unit}]").lower()


def test_logger_channels_come_at_ten_kilohertz(shown):
    times, _ = shown.rows(path_of("M_wej"), "Scalars:scalars")
    assert set(np.diff(times)) == {100_000}


@pytest.mark.parametrize("name", [s.name for s in CATALOGUE.signals.values() if s.states])
def test_states_change_when_the_bag_says_so(shown, recorded, name):
    t, values = Bag(recorded).series(name)
    expected = []
    for time, value in zip(t, values):
        label = CATALOGUE.signal(name).states[int(value)]
        if not expected or expected[-1][1] != label:
            expected.append((round(time * 1e9), label))
    times, states = shown.rows(path_of(name), "StateChange:state")
    assert [(time, state.removeprefix("short ")) for time, state in zip(times, states)] == expected


def test_a_state_in_a_bar_that_is_too_short_for_its_name_has_its_colour_without_it(shown, recorded):
    first, last = window_of(shown)
    second, end, short = layout.column_width(2) / (last - first), Bag(recorded).logger().time()[-1], set()
    for name in ("rig_state", "gear", "s1_mode", "s2_mode"):
        place = path_of(name)
        looks = {
            state: (label, colour)
            for state, label, colour in zip(
                *(shown.data[place][f"StateConfiguration:{one}"] for one in ("values", "labels", "colors"))
            )
        }
        times, states = shown.rows(place, "StateChange:state")
        for begin, until, state in zip(times, [*times[1:], 1e9 * end], states):
            text, colour = looks[state]
            if state.startswith("short "):
                assert (text, colour) == (" ", looks[state.removeprefix("short ")][1])
                short.add(state)
            else:
                assert text == state and 7.0 * len(text) < second * (until - begin) / 1e9, (name, state)
    assert {"short ready", "short slipping"} <= short


def test_events_are_logged_with_their_time(shown, recorded):
    logged = []
    for node in ("controller", "rig", "sequencer"):
        logged += zip(*shown.rows(f"/events/{node}", "TextLog:text"))
    for t, topic, _, text, _ in Bag(recorded).events():
        assert (round(t * 1e9), f"{t:.3f} s  {topic.split('/')[1]}: {text}") in logged
    assert len(logged) == len(Bag(recorded).events())


def test_an_upright_line_marks_each_order(shown, recorded):
    orders = [t for t, _, name, _, _ in Bag(recorded).events() if name == "shift_ordered"]
    times, values = shown.rows("/orders/slip", "Scalars:scalars")
    upright = [(a, values[i], values[i + 1]) for i, (a, b) in enumerate(pairwise(times)) if a == b and values[i] < values[i + 1]]
    assert [a for a, _, _ in upright] == [round(t * 1e9) for t in orders]


def test_report_is_shown_as_tables(shown, recorded):
    report = json.loads((recorded / "report.json").read_text())
    text = shown.data["/report"]["TextDocument:text"][0]
    assert shown.data["/report"]["TextDocument:media_type"] == ["text/markdown"]
    assert "| shift | 1: I → II | 2: II → I |" in text
    peaks = [f"{row['input_torque_max_nm']:.1f}" for row in report["shifts"]]
    assert f"| M_wej max Nm | {peaks[0]} | {peaks[1]} |" in text
    assert "End: the sequence ended" in text


def test_layout_belongs_to_the_recording_and_shows_every_signal(shown, orders):
    assert len(shown.applications) == 1
    views = shown.views()
    assert {
        "Coil current [mA]",
        "Clutch pressure [MPa]",
        "Shaft torque [Nm]",
        "Speed [rpm]",
        "Report",
        "Events",
        *(f"shift {n}: {way} at {t:.3f} s" for n, (way, t) in enumerate(zip(("I → II", "II → I"), orders), 1)),
    } <= {name.partition(";")[0] for name in views}
    drawn = {entity for contents in views.values() for entity in contents}
    assert {path_of(name) for name in CATALOGUE.signals} <= drawn


def window_of(rrd):
    """Returns the window [s] with which linked plots open."""
    axis = rrd.layout[f"/view/{layout.SHARED_AXIS}/TimeAxis"]
    view_range = axis["TimeAxis:view_range"][0]
    return view_range["start"] / 1e9, view_range["end"] / 1e9


def test_linked_plots_open_with_the_whole_run_and_room_for_their_legends(shown, recorded):
    first, last = window_of(shown)
    end = Bag(recorded).logger().time()[-1]
    assert first == pytest.approx(0.0, abs=0.02)
    # of some 550 px of a plot, 40 are the frame and the dot of a legend, and a letter has 6.4
    assert 550.0 * (1.0 - end / last) > 40.0 + 6.4 * len("S2 capacity [Nm]") and end > 0.65 * last, "most of a plot is the run"


def test_a_shift_is_shown_from_its_order_on_with_its_phases_and_times(shown, recorded, orders):
    row = json.loads((recorded / "report.json").read_text())["shifts"][0]
    times, values = shown.rows("/shift_1/M_wej", "Scalars:scalars")
    there, whole = shown.rows(path_of("M_wej"), "Scalars:scalars")
    first = int(np.searchsorted(there, (orders[0] - layout.BEFORE) * 1e9 - 1.0))
    np.testing.assert_array_equal(values, whole[first : first + len(values)])
    np.testing.assert_allclose(np.asarray(times) / 1e9, np.asarray(there[first : first + len(times)]) / 1e9 - orders[0], atol=2e-9)
    kiss, locked = row["kiss_s"], row["t_c_s"]
    begins = [0.0, kiss, locked - row["t_p_s"], locked, locked + row["t_o_s"]]
    assert (times[0] / 1e9, times[-1] / 1e9) == pytest.approx((-layout.BEFORE, 1.5 * begins[-1]), abs=1e-3)
    np.testing.assert_allclose(np.asarray(shown.data["/shift_1/phases"]["t"][:5]) / 1e9, begins, atol=1e-6)
    (labels,) = (name for name in shown.views() if name.startswith("shift 1: I → II at 3.845 s; fill "))
    for name, seconds in zip(("fill", "torque", "inertia", "settling"), np.diff(begins)):
        assert re.search(rf"{name} {1e3 * seconds:.0f}\b", labels)
    marks, _ = shown.rows("/shift_1/orders/speed", "Scalars:scalars")
    np.testing.assert_allclose(np.unique(np.asarray(marks[1:]) / 1e9), begins, atol=1e-6)


def test_both_columns_have_the_same_scales_and_hold_their_curves(shown):
    ranges = {}
    for path, parts in shown.layout.items():
        if path.endswith("/ScalarAxis"):
            view = path.removesuffix("/ScalarAxis")
            low, high = parts["ScalarAxis:range"][0]
            contents = shown.layout[f"{view}/ViewContents"]["ViewContents:query"]
            ranges.setdefault(shown.layout[view]["ViewBlueprint:display_name"][0], []).append((low, high, contents))
    of_shifts = {title: [one for one in found if any("/shift_" in entity for entity in one[2])] for title, found in ranges.items()}
    both = [found for found in of_shifts.values() if found]
    assert len(both) == len(Pages(load_rig("hydmag").as_dict()).shift_plots)
    for (*left, _), (*right, _) in both:
        assert left == right
    assert {"Slip [rpm]", "Piston position [mm]", "Plate temperature [degC]"} <= set(ranges), "the whole run's have theirs too"
    for low, high, contents in (one for found in ranges.values() for one in found):
        values = np.concatenate([shown.data[entity]["Scalars:scalars"] for entity in contents if "orders" not in entity])
        assert low < np.nanmin(values) and np.nanmax(values) < high
    low, high, _ = ranges["Error of the energy balance [kJ]"][0]
    assert low <= -1e-3 and high >= 1e-3, "rounding is not drawn as high as the plot"


def test_plates_are_as_warm_as_their_heat_and_the_oil_make_them(shown, recorded):
    """Compared with small explicit steps of C dT/dt = P - G (T - T_oil)."""
    pack, oil = (load_rig("hydmag").as_dict()[name] for name in ("plate_pack", "oil_supply"))
    times, heat = (np.asarray(one) for one in shown.rows("/energy/s2_heat", "Scalars:scalars"))
    there, warm = shown.rows("/temperature/s2_plates", "Scalars:scalars")
    np.testing.assert_array_equal(times, there)
    fine = np.arange(times[0], times[-1], 500_000) / 1e9
    power = np.diff(np.interp(fine, times / 1e9, 1e3 * heat), prepend=1e3 * heat[0])
    over = 0.0
    for joule in power:
        over += (joule - pack["cooling"] * over * 5e-4) / pack["heat_capacity"]
    assert warm[-1] == pytest.approx(oil["temperature"] + over, abs=0.01) and max(warm) > oil["temperature"] + 1.0


def test_the_page_of_the_run_tells_its_steps_energy_and_settings(tmp_path, read_rrd):
    config = load_rig("hydmag", overrides={"alfa46.t12": "-200 ms"})
    simulate(config, load_sequence("sample"), tmp_path / "run")
    text = read_rrd(make_view(tmp_path / "run").path).data["/run"]["TextDocument:text"][0]
    assert "| alfa46.t12 | -0.22 s | -0.2 s |" in text and "| alfa46.t21 | -0.22 s |" in text
    for heading in ("## Warnings", "## Steps", "## Energy of the run", "## Settings"):
        assert heading in text
    assert "| heat of clutch S1 |" in text and "shift to I |" in text


def test_any_shift_can_be_chosen_and_all_overlaid(demo, read_rrd):
    one = read_rrd(make_view(demo, wanted=[2]).path)
    assert [name.partition(";")[0] for name in one.views() if name.startswith("shift")] == ["shift 2: II → I at 8.320 s"]
    assert not [entity for entity in one.data if entity.startswith("/shift_1/")]
    times = np.asarray(one.rows(path_of("M_wej"), "Scalars:scalars")[0]) / 1e9
    assert times[0] > 8.1 and times[-1] < 9.9, "only its part of the bag is read"
    every = layout.columns_of(layout.shifts_of([(0.1, 0, 1), (3.0, 1, 2), (6.0, 2, 1), (9.0, 1, 2)], BOX), "all")
    assert [[shift.number for shift in column] for column in every] == [[2, 4], [3]]
    with pytest.raises(RigError, match=r"--shift 3: the run has the shifts 1 to 2: shift 1: I → II"):
        make_view(demo, wanted=[3])


def test_a_shift_has_the_same_number_in_view_report_page_and_comparison(demo, recorded, shown, read_rrd, tmp_path, capsys):
    """The first order of the demo, gear I at standstill, is no shift, with a report or without one."""
    report = json.loads((demo / "report.json").read_text())
    (demo / "report.json").unlink()
    rrd = read_rrd(make_view(demo).path)
    for one in (shown, rrd):
        titles = sorted(name for name in one.views() if " → " in name)
        assert [title.partition(" at ")[0] for title in titles] == ["shift 1: I → II", "shift 2: II → I"]
    text = rrd.data["/report"]["TextDocument:text"][0]
    assert f"| M_wej max Nm | {report['shifts'][0]['input_torque_max_nm']:.1f} |" in text, "the numbers are then from the bag"
    assert not (demo / "report.json").exists()
    assert "| shift | 1: I → II | 2: II → I |" in report_document(report, [])
    numbered = [line.split("  ")[0] for line in format_report(report).splitlines() if " -> " in line[:12]]
    assert numbered == ["1: I -> II", "2: II -> I"] * 2, "the metrics, and the course"
    page = report_page(report, Facts(), [], [])
    assert "Shift 1, I → II at" in page and "Shift 2, II → I at" in page and "Shift 3" not in page
    assert main(["compare", str(recorded), str(demo), "--json", str(tmp_path / "told.json")]) == 0
    capsys.readouterr()
    rows = {(row["shift"], row["metric"]): row for row in json.loads((tmp_path / "told.json").read_text())["metrics"]}
    for number, shift in enumerate(report["shifts"], 1):
        assert rows[number, "t_c_s"]["first"] == rows[number, "t_c_s"]["other"] == shift["t_c_s"]


def test_only_the_window_asked_for_is_read_and_linked_plots_open_with_it(demo, read_rrd, monkeypatch):
    monkeypatch.setattr(Bag, "pieces", lambda *_, **__: pytest.fail("the whole bag was read"))
    rrd = read_rrd(make_view(demo, (1.0, 2.5)).path)
    first, last = window_of(rrd)
    assert first == pytest.approx(1.0, abs=1e-6) and 2.5 < last < 4.0, "with room for the legends"
    for name in ("M_wej", "p1", "s1_slip"):
        times = np.asarray(rrd.rows(path_of(name), "Scalars:scalars")[0]) / 1e9
        assert (times[0], times[-1]) == pytest.approx((1.0, 2.5), abs=0.02), name


def test_of_a_long_run_each_peak_is_drawn():
    t = np.arange(1005) * 1e-4
    values = np.sin(7.0 * t)
    values[[123, 480]] = 9.0, -9.0
    few, drawn = thinned(t, values)
    assert len(few) == 105 and (np.diff(few) > 0).all()
    assert {(0.0123, 9.0), (0.048, -9.0)} <= set(zip(np.round(few, 4).tolist(), drawn.tolist()))
    slow = np.arange(100) * 1e-2
    np.testing.assert_array_equal(thinned(slow, slow)[0], slow)


def test_the_file_is_written_again_only_when_something_changed(run, read_rrd):
    first = make_view(run)
    assert first.written and first.path == run / "view.rrd"
    before = first.path.stat()
    assert not make_view(run).written
    assert first.path.stat().st_mtime_ns == before.st_mtime_ns
    keys = {read_rrd(first.path).key}

    report = json.loads((run / "report.json").read_text())
    report["run"]["seed"] = 7
    (run / "report.json").write_text(json.dumps(report))
    for window in (None, (0.5, 1.0)):
        assert make_view(run, window).written
        keys.add(read_rrd(first.path).key)
    bag = run / "sample_0.mcap"
    whole = bag.read_bytes()
    for content in (whole[: len(whole) // 2], whole):
        bag.write_bytes(content)
        assert make_view(run, (0.5, 1.0)).written
        keys.add(read_rrd(first.path).key)
    assert len(keys) == 4, "that of the whole bag comes back"
    assert sorted(p.name for p in run.iterdir()) == ["metadata.yaml", "report.json", "sample_0.mcap", "view.rrd"]


@pytest.mark.parametrize("content", [b"no Rerun file at all", None], ids=["text", "half"])
def test_a_damaged_file_is_replaced(run, read_rrd, content):
    path = make_view(run).path
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2] if content is None else content)
    assert make_view(run).written
    assert path_of("p1") in read_rrd(path).data


def test_a_cut_bag_is_shown_as_far_as_it_goes(run, read_rrd):
    bag = run / "sample_0.mcap"
    whole = Bag(run).logger().time()[-1]
    bag.write_bytes(bag.read_bytes()[: bag.stat().st_size // 2])
    (run / "report.json").unlink()
    view = make_view(run)
    assert any("recovered" in note for note in view.notes)
    rrd = read_rrd(view.path)
    times, _ = rrd.rows(path_of("p1"), "Scalars:scalars")
    assert 0.4 * whole < times[-1] / 1e9 < 0.6 * whole
    text = rrd.data["/report"]["TextDocument:text"][0]
    assert "End: the run left no report" in text and "recovered" in text


def test_a_report_that_is_none_is_named(run):
    (run / "report.json").write_text("{")
    assert any("report.json: is no report" in note for note in make_view(run).notes)


def test_a_run_without_logger_is_drawn_from_the_transducers(without, read_rrd):
    view = make_view(without("/instruments/hmg4000", "/instruments/channels"))
    _, values = Bag(view.path.parent).series("p1")
    _, curve = read_rrd(view.path).rows(path_of("p1"), "Scalars:scalars")
    np.testing.assert_array_equal(curve, values * 1e-6)
    assert any("logger" in note for note in view.notes)


def test_missing_topics_leave_no_empty_plot(without, read_rrd):
    view = make_view(without("/clutch_s1/state", "/clutch_s2/state", "/controller/events"))
    assert any("s1_torque" in note and "s2_piston" in note for note in view.notes)
    rrd = read_rrd(view.path)
    drawn = {entity for contents in rrd.views().values() for entity in contents if entity.startswith("/")}
    assert {entity for entity in drawn if not entity.startswith("/orders/")} <= set(rrd.data)
    assert not {"Clutch torque [Nm]", "Piston position [mm]"} & set(rrd.views())


def test_a_tripped_run_shows_the_trip(tripped, read_rrd):
    rrd = read_rrd(make_view(tripped).path)
    assert rrd.data[path_of("rig_state")]["StateChange:state"][-1].removeprefix("short ") == "tripped"
    texts = dict(zip(rrd.data["/events/rig"]["TextLog:text"], rrd.data["/events/rig"]["TextLog:level"]))
    assert [level for text, level in texts.items() if text.startswith("0.05")] == ["ERROR"]
    assert "no shift: this run changes no gear" in rrd.data["/report"]["TextDocument:text"][0]


@pytest.mark.parametrize("window", [(50.0, 60.0), (-2.0, 0.0)])
def test_a_window_outside_the_run_is_refused(run, window):
    with pytest.raises(RigError, match=r"lies outside the run, which goes from 0\.00 s to 2\.5\d+ s"):
        make_view(run, window)
    assert not (run / "view.rrd").exists() and not list(run.glob(".view-*"))


def test_a_folder_without_a_bag_is_refused(tmp_path):
    with pytest.raises(BagError, match="holds no bag; expected .mcap"):
        make_view(tmp_path)


def test_signals_of_one_plot_can_be_told_apart():
    pages = Pages(load_rig("hydmag").as_dict())
    for _, names in pages.marked_plots:
        assert len({pages.signal(name).display_unit for name in names}) == 1
        for one, other in combinations(names, 2):
            assert np.abs(np.subtract(pages.colour(one), pages.colour(other))).max() > 60, (one, other)


ORDERS = {
    "neutral to I only": ([(0.2, 0, 1)], [(0.2, 1.7)]),
    "up and down": ([(0.2, 0, 1), (3.0, 1, 2), (6.0, 2, 1)], [(3.0, 4.5), (6.0, 7.5)]),
    "repeats": ([(0.2, 0, 1), (3.0, 1, 2), (6.0, 2, 1), (9.0, 1, 2)], [(3.0, 4.5), (6.0, 7.5)]),
    "close together": ([(0.2, 0, 1), (3.0, 1, 2), (4.0, 2, 1)], [(3.0, 3.8), (4.0, 5.5)]),
    "none": ([], []),
}


@pytest.mark.parametrize("orders, expected", ORDERS.values(), ids=ORDERS)
def test_the_first_shift_each_way_is_shown(orders, expected):
    found = [time for shift in layout.choose(layout.shifts_of(orders, BOX)) for time in (shift.order, shift.end)]
    assert found == pytest.approx([time for pair in expected for time in pair])


OWN = """
from rig_nodes.controllers.examples.alfa46 import Alfa46

class Mine(Alfa46):
    signals = {"slip": "rad/s"}

    def step(self, inputs):
        out = super().step(inputs)
        out.signals = {"slip": inputs.n_wej - inputs.n_wyj}
        return out
"""


def test_what_a_controller_names_as_its_own_is_shown(tmp_path, read_rrd):
    (tmp_path / "mine.py").write_text(OWN)
    config = load_rig("hydmag")
    plug = load_controller(f"python:{tmp_path / 'mine.py'}:Mine", config)
    simulate(config, load_sequence("sample"), tmp_path / "run", controller=plug)
    logger = Bag(tmp_path / "run").logger("/controller/signals")
    times, curve = read_rrd(make_view(tmp_path / "run").path).rows("/controller/slip", "Scalars:scalars")
    np.testing.assert_array_equal(times, np.round(logger.time() * 1e9))
    np.testing.assert_array_equal(curve, logger.channels["slip"])
    assert np.ptp(curve) > 5.0


def test_a_view_made_of_many_pieces_of_the_bag_is_the_same(run, read_rrd, monkeypatch):
    whole = read_rrd(make_view(run).path.rename(run / "whole.rrd"))
    monkeypatch.setattr(convert, "PIECE", 200_000)
    pieces = read_rrd(make_view(run).path)
    assert set(pieces.data) == set(whole.data)
    for entity, columns in whole.data.items():
        for name in ("t", "Scalars:scalars", "StateChange:state", "TextLog:text"):
            if name in columns:
                np.testing.assert_array_equal(pieces.data[entity][name], columns[name], err_msg=f"{entity} {name}")
    # views of the same name have no order
    drawn = [{name: sorted(contents) for name, contents in one.views().items()} for one in (pieces, whole)]
    assert drawn[0] == drawn[1]


def test_a_report_made_from_the_bag_takes_no_more_memory_than_a_few_seconds_of_it(demo, monkeypatch):
    (demo / "report.json").unlink()
    monkeypatch.setattr(convert, "PIECE", 1_000_000)
    tracemalloc.start()
    try:
        make_view(demo)
        peak = tracemalloc.get_traced_memory()[1] / 1e6
    finally:
        tracemalloc.stop()
    assert peak < 18, "MB; the 15 s of the whole run are 45"


@pytest.mark.parametrize("piece", [60_000, 1 << 24])
def test_rows_that_a_logger_lost_break_its_curve_wherever_they_are(recorded, tmp_path, read_rrd, monkeypatch, piece):
    bag = Bag(recorded)
    with BagWriter(tmp_path / "run", "run") as writer:
        blocks = 0
        for time, topic, data in bag.timeline():
            blocks += topic == "/instruments/hmg4000"
            if time < 500_000_000 and not (topic == "/instruments/hmg4000" and blocks % 10 == 5):
                writer.write(topic, bag.types[topic], data, time)
    monkeypatch.setattr(convert, "PIECE", piece)
    times, values = read_rrd(make_view(tmp_path / "run").path).rows(path_of("p1"), "Scalars:scalars")
    assert len(values) - np.isnan(values).sum() == 90 * 50
    gaps = np.flatnonzero(np.diff(np.asarray(times)[np.isfinite(values)]) > 200_000)
    assert len(gaps) == 10
    holes = np.asarray(times)[np.isnan(values)]
    sound = np.asarray(times)[np.isfinite(values)]
    assert all(np.any((holes > sound[at]) & (holes < sound[at + 1])) for at in gaps)
