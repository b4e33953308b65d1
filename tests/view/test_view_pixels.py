# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The pictures that the viewer draws, with a software Vulkan driver and without a display."""

import io
import json
import os
import signal
import subprocess
import sys
import time
from types import SimpleNamespace

import numpy as np
import psutil
import pytest
from PIL import Image
from pixels import BAR, LONGEST, curve_pixels, dots, has, image_of, lanes, legend_text, of_state, text_pixels, upright

from rig_nodes.bags.reader import Bag
from rig_nodes.base import KINDS
from rig_nodes.cli.main import main
from rig_nodes.rig.configuration import load_rig
from rig_nodes.view import layout, picture
from rig_nodes.view.convert import make_close_view, make_tab_view
from rig_nodes.view.pages import STATE_COLOURS, Pages
from rig_nodes.view.palette import RULE, rgb
from rig_nodes.view.picture import NO_DRIVER, SIZE, HeadlessViewer, software_driver

pytestmark = pytest.mark.skipif(software_driver() is None, reason=NO_DRIVER)
TABS = ("shifts", "run", "other")  # the demo run has no others
PAGES = Pages(load_rig("hydmag").as_dict())
WARM = ("Plate temperature", tuple(PAGES.plates))
PLOTS = {"shifts": PAGES.shift_plots, "run": (*PAGES.run_left, *PAGES.run_right, WARM), "other": tuple(PAGES.other_plots)}
EVERY_PLOT = [(tab, title, tuple(names)) for tab, plots in PLOTS.items() for title, names in plots]
EVERY_CURVE = [(*plot[:2], name) for plot in EVERY_PLOT for name in plot[2]]
OF_RUN = {"States", WARM[0], next(title for title, names in PLOTS["run"] if "M_wej" in names)}


def rest(tab, title="States"):
    """Returns whether a view is for the campaign: more pictures of plots that are drawn as others are, or in test_live_view.py."""
    return tab == "other" or (title not in OF_RUN if tab == "run" else title in ("Coil current", "Clutch torque"))


TAB_PARAMS, PLOT_PARAMS, CURVE_PARAMS = (
    [pytest.param(*row, marks=pytest.mark.campaign if rest(*row[:2]) else ()) for row in rows]
    for rows in ([(tab,) for tab in TABS], EVERY_PLOT, EVERY_CURVE)
)
COLOURS = {PAGES.colour(name) for name in PAGES.looks}
LABELS = [PAGES.label(name) for _, names in PAGES.shift_plots for name in names]


def ends_of(rows):
    """Returns the window [s] of both columns of shifts, from their orders on: half as long again as the longer one's course."""
    last = max(row["t_c_s"] + row["t_o_s"] for row in rows)
    return layout.with_room((-layout.BEFORE, 1.5 * last), layout.room_for(LABELS, 2))


def heading(title, names):
    """Returns the heading of a plot."""
    return f"{title} [{PAGES.signal(names[0]).display_unit}]"


@pytest.fixture(scope="module")
def tabs(viewed, tmp_path_factory):
    """Tab of the demo run, and whether its rest -> whole picture, names of all views, (name, picture) of some, viewer's reports."""
    folder = tmp_path_factory.mktemp("tabs")

    class Drawn(dict):
        """Draws a tab when it is first asked for, so that no test waits for all of them."""

        def __missing__(self, key):
            tab, source = key[0], folder / f"{key[0]}.rrd"
            if tab == "shifts":
                assert make_close_view(viewed, source, None, None)
            else:
                make_tab_view(viewed / "view.rrd", viewed, None, source, tab)
            with HeadlessViewer(str(source), longest=LONGEST) as viewer:
                whole, names = image_of(viewer.image()), [view.name for view in viewer.state().views]
                wanted = viewer.views(lambda name: rest(tab, name.partition(" [")[0]) == key[1])
                views = [(name, image_of(one)) for name, one in wanted]
                self[key] = SimpleNamespace(whole=whole, names=names, views=views, reports=viewer.reports())
            return self[key]

    return Drawn()


def pictures(tabs, tab, title, names):
    """Returns the pictures of the plots with a title: two for the shifts, else one; the one with a legend comes first."""
    found = [image for name, image in tabs[tab, rest(tab, title)].views if name == heading(title, names)]
    assert len(found) == (2 if tab == "shifts" else 1)
    # a peak of one curve may look like the dot of a legend, but a legend has a dot for each curve
    return sorted(found, key=lambda image: -sum(bool(dots(image, PAGES.colour(name))) for name in names))


@pytest.mark.parametrize("tab", TAB_PARAMS)
def test_the_viewer_reports_no_fault_and_lists_every_view(tabs, recorded, tab):
    drawn = tabs[tab, rest(tab)]
    assert drawn.reports == []
    times = 2 if tab == "shifts" else 1
    expected = times * [heading(title, names) for title, names in PLOTS[tab]]
    if tab != "other":
        expected += ["Run" if tab == "run" else "Report", "Events"]
    if tab == "run":
        expected.append("States")
    shown = sorted(drawn.names)
    if tab == "shifts":
        titles = ["shift 1: I → II at 3.845 s", "shift 2: II → I at 8.320 s"]
        assert [name.partition("; fill ")[0] for name in shown if " → " in name] == titles
    assert [name for name in shown if " → " not in name] == sorted(expected)


def test_the_picture_is_large_enough_to_read(tabs):
    assert tabs["shifts", False].whole.shape == (SIZE[1], SIZE[0], 3)


@pytest.mark.parametrize("tab, title, name", CURVE_PARAMS, ids=lambda text: text.replace(" ", "_"))
def test_every_curve_is_seen_in_its_plot(tabs, tab, title, name):
    names = dict(PLOTS[tab])[title]
    for image in pictures(tabs, tab, title, names):
        assert curve_pixels(image, PAGES.colour(name)) > 30


@pytest.mark.parametrize("tab, title, names", PLOT_PARAMS, ids=lambda part: str(part).replace(" ", "_"))
def test_no_plot_shows_the_colour_of_another(tabs, tab, title, names):
    others = COLOURS - {PAGES.colour(name) for name in names}
    assert others
    for image in pictures(tabs, tab, title, names):
        assert {colour: count for colour in others if (count := curve_pixels(image, colour)) > 10} == {}


@pytest.mark.parametrize("tab, title, names", PLOT_PARAMS, ids=lambda part: str(part).replace(" ", "_"))
def test_legends_and_numbers_are_written(tabs, tab, title, names):
    image, *without = pictures(tabs, tab, title, names)
    for name in names:
        # for the thinnest letters, e.g. of p1 [MPa]
        assert legend_text(image, PAGES.colour(name)) > 25, f"no text beside the dot of {name}"
        assert not any(legend_text(other, PAGES.colour(name)) for other in without), "a legend that is off"
    ground = int(np.median(image))
    assert (image[-18:].max(axis=2) > ground + 60).sum() > 20, "no times below"
    # the viewer draws these numbers fainter where they are denser
    assert (image[:-18, :26].max(axis=2) > ground + 30).sum() > 20, "no values at the left"


def test_a_peak_of_some_milliseconds_is_drawn_in_a_plot_of_the_whole_run(tabs):
    """The input shaft's swing behind the downshift peaks at 191 Nm for 4 ms; a mean over each pixel would end at 120 Nm.

    The plot ends at some 300 Nm, and the downshift stands where its columns are cut out.
    """
    title, names = next(plot for plot in PLOTS["run"] if "M_wej" in plot[1])
    (image,) = pictures(tabs, "run", title, names)
    height, width = image.shape[:2]
    downshift = image[:, int(0.47 * width) : int(0.53 * width)]
    rows = np.flatnonzero(has(downshift, PAGES.colour("M_wej")).any(axis=1))
    assert rows[0] < 0.42 * height, "a mean would end at 0.54"


def test_report_and_events_are_written(tabs):
    written = {name: text_pixels(image) for name, image in tabs["shifts", False].views}
    assert written["Report"] > 1500 and written["Events"] > 1500


def test_every_state_has_its_colour_as_long_as_it_lasts(tabs, recorded):
    bag, checked = Bag(recorded), set()
    image = dict(tabs["run", False].views)["States"]
    names, bars = sorted(PAGES.states), lanes(image)
    assert len(bars) == len(names)
    for bar, name in zip(bars, names):
        assert 0.6 < len(bar) / image.shape[1] < 0.75, "the bar ends with the run"
        _, values = bag.series(name)
        states, last = PAGES.signal(name).states, int(values[-1])
        # the viewer draws the last state some way beyond the end of the run
        until = 1 + np.flatnonzero(~of_state(bar[:-4], name, states[last]))[-1]
        before = values[: 1 + np.flatnonzero(values != last)[-1]]
        assert until < len(bar) - 4, f"{name} ends as {states[last]}"
        for number, label in states.items():
            expected = float((before == number).mean())
            # the bar has some 180 pixels, and a state that lasts for less than one, as none within a shift, can be missing
            assert of_state(bar[:until], name, label).mean() == pytest.approx(expected, abs=0.02), (name, label)
            if expected > 0.01:
                checked.add((name, label))
    assert {("gear", "I"), ("gear", "II"), ("s1_mode", "open"), ("s1_mode", "locked"), ("rig_state", "running")} <= checked


def test_phases_and_times_of_a_shift_are_bars_with_their_texts(tabs, recorded):
    rows = json.loads((recorded / "report.json").read_text())["shifts"]
    views = {name.partition(";")[0]: image for name, image in tabs["shifts", False].views}
    for title, row in zip(("shift 1: I → II at 3.845 s", "shift 2: II → I at 8.320 s"), rows):
        image = views[title]
        start, end = ends_of(rows)
        second = (image.shape[1] - layout.NUMBERS) / (end - start)  # the lanes begin as far at the right as the plots
        inertia, kiss = row["t_p_s"], row["kiss_s"]
        lengths = {"fill": kiss, "torque phase": row["t_c_s"] - inertia - kiss, "inertia phase": inertia}
        for name, seconds in lengths.items():
            colour = np.array(rgb(name)) * BAR
            rows_of_bar = (np.abs(image - colour).max(axis=2) <= 12).sum(axis=1)
            assert (np.abs(rows_of_bar - seconds * second) < 3).sum() >= 3, f"{title}: {name}"
        assert text_pixels(image) > 500, "the texts of the bars and the names of the lanes"


def test_upright_lines_stand_at_the_order_and_where_the_phases_begin(tabs, recorded):
    rows = json.loads((recorded / "report.json").read_text())["shifts"]
    start, end = ends_of(rows)
    for title, names in PLOTS["shifts"]:
        if rest("shifts", title):
            continue
        for image, row in zip(pictures(tabs, "shifts", title, names), rows):
            marks = (0.0, row["kiss_s"], row["t_c_s"] - row["t_p_s"], row["t_c_s"])
            found = upright(image, rgb(RULE))

            def off(left):
                """Returns how far [px] the worst mark is from its time, with the plot's left end there."""
                second = (image.shape[1] - left) / (end - start)
                return max(np.abs(found - (left + (t - start) * second)).min(initial=np.inf) for t in marks)

            # the room for the numbers at the left differs from plot to plot
            assert min(off(left) for left in range(5, 60)) < 2.0, (title, row["from_gear"], found)


def test_a_light_picture_has_dark_letters_and_the_same_curves():
    curves = [rgb("first"), rgb("first", True), rgb("input")]
    colours = np.array([[[13, 13, 13], [235, 235, 235], *curves, STATE_COLOURS["slipping"]]], np.uint8)
    out = io.BytesIO()
    Image.fromarray(colours).save(out, "png")
    ground, letter, *found, bar = image_of(picture.lightened(out.getvalue()))[0]
    assert ground.min() > 230 and letter.max() < 30 and bar.max() > 200, "the ground of a bar's letters"
    assert (np.array(found) == curves).all()


def test_window_and_tab_of_a_picture_can_be_chosen(demo, tabs, tmp_path):
    picture = tmp_path / "run.png"
    assert main(["view", str(demo), "--window", "1.2,2.6", "--tab", "run", "--picture", str(picture)]) == 0
    assert KINDS["png"].own(picture.read_bytes(), picture), "a later picture would be refused this name"
    image = image_of(picture.read_bytes())
    assert image.shape == tabs["run", False].whole.shape and (image != tabs["run", False].whole).mean() > 0.02
    assert curve_pixels(image, PAGES.colour(WARM[1][0])) > 100, "the plates' temperature is in this tab"


def test_a_killed_command_leaves_no_viewer(recorded, tmp_path):
    command = subprocess.Popen(
        [sys.executable, "-m", "rig_nodes", "view", str(recorded), "--picture", str(tmp_path / "x.png")], stdout=subprocess.DEVNULL
    )
    try:
        viewers, deadline = [], time.monotonic() + 20
        while not viewers and time.monotonic() < deadline:
            viewers = [p for p in psutil.Process(command.pid).children() if "--headless" in p.cmdline()]
            time.sleep(0.02)
        assert viewers, "no viewer was started"
    finally:
        command.send_signal(signal.SIGKILL)
        command.wait()
    _, alive = psutil.wait_procs(viewers, timeout=5)
    assert not alive


def test_a_machine_that_must_check_the_view_skips_nothing():
    hide = (
        "import sys, pytest, rig_nodes.view.picture as picture; picture.DRIVER_FOLDERS = (); "
        f"sys.exit(pytest.main(['-q', '-p', 'no:cacheprovider', {__file__!r}, '-k', 'large_enough']))"
    )
    done = subprocess.run(
        [sys.executable, "-c", hide], capture_output=True, text=True, timeout=60, env={**os.environ, "RIG_REQUIRE_VIEW": "1"}
    )
    assert done.returncode == 1 and "RIG_REQUIRE_VIEW=1" in done.stdout and "mesa-vulkan-drivers" in done.stdout
