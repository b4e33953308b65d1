# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The pictures that the viewer draws, with a software Vulkan driver and without a display."""

import os
import signal
import subprocess
import sys
import time
from types import SimpleNamespace

import numpy as np
import psutil
import pytest
from pixels import LONGEST, curve_pixels, dots, image_of, lanes, legend_text, share, text_pixels

from rig_nodes.bags.reader import Bag
from rig_nodes.catalogue import catalogue
from rig_nodes.cli.main import main
from rig_nodes.view import layout, picture
from rig_nodes.view.convert import make_view, save_bare_layout
from rig_nodes.view.pages import SUPPLY, Pages
from rig_nodes.view.picture import NO_DRIVER, SIZE, HeadlessViewer, software_driver

pytestmark = pytest.mark.skipif(software_driver() is None, reason=NO_DRIVER)
TABS = tuple(
    tab for tab in layout.TABS if tab != "controller"
)  # the built-in controller has no signals of its own, so this tab is empty
PAGES = Pages()
PLOTS = {"shifts": PAGES.shift_plots, "run": PAGES.run_left + PAGES.run_right, "other": tuple(PAGES.other_plots)}
EVERY_PLOT = [(tab, title, tuple(names)) for tab, plots in PLOTS.items() for title, names in plots]
EVERY_CURVE = [(*plot[:2], name) for plot in EVERY_PLOT for name in plot[2]]
COLOURS = set(PAGES.colours.values())


def heading(title, names):
    """Returns the heading of a plot."""
    return f"{title} [{catalogue().signal(names[0]).display_unit}]"


@pytest.fixture(scope="module")
def tabs(recorded, tmp_path_factory):
    """Tab -> whole picture, (title, picture) of its views, reports of the viewer; of the demo run."""
    folder = tmp_path_factory.mktemp("tabs")
    view, found = make_view(recorded).path, {}
    for tab in TABS:
        save_bare_layout(recorded, None, folder / "tab.rbl", tab)
        with HeadlessViewer(str(view), folder / "tab.rbl", longest=LONGEST) as viewer:
            whole = image_of(viewer.image())
            views = [(name, image_of(picture)) for name, picture in viewer.views()]
            found[tab] = SimpleNamespace(whole=whole, views=views, reports=viewer.reports())
    return found


def test_a_viewer_that_shows_another_layout_than_the_one_given_is_started_again(recorded, tmp_path, monkeypatch):
    """The viewer opens a recording and a layout at once, and on a busy machine the recording's own layout may come last."""
    save_bare_layout(recorded, None, tmp_path / "tab.rbl", "other")
    starts, start = [], picture._start

    def other_way_round_at_first(sources, *arguments):
        starts.append(sources)
        return start(sources[::-1] if len(starts) == 1 else sources, *arguments)

    monkeypatch.setattr(picture, "_start", other_way_round_at_first)
    with HeadlessViewer(str(make_view(recorded).path), tmp_path / "tab.rbl", longest=LONGEST) as viewer:
        assert {name for name, _ in viewer.views()} == {heading(title, names) for title, names in PLOTS["other"]}
    assert len(starts) >= 2, "a busy machine may need one more"


def pictures(tabs, tab, title, names):
    """Returns the pictures of the plots with a title: two for the shifts, else one; the one with a legend comes first."""
    found = [image for name, image in tabs[tab].views if name == heading(title, names)]
    assert len(found) == (2 if tab == "shifts" else 1)
    return sorted(found, key=lambda image: not dots(image, PAGES.colour(names[0])))


@pytest.mark.parametrize("tab", TABS)
def test_the_viewer_reports_no_fault_and_lists_every_view(tabs, recorded, tab):
    assert tabs[tab].reports == []
    times = 2 if tab == "shifts" else 1
    expected = times * [heading(title, names) for title, names in PLOTS[tab]]
    if tab != "other":
        expected += ["Report", "Events"]
    if tab == "run":
        expected.append("States")
    shown = sorted(name for name, _ in tabs[tab].views)
    if tab == "shifts":
        assert [name for name in shown if " → " in name] == ["I → II at 3.845 s", "II → I at 8.320 s"]
    assert [name for name in shown if " → " not in name] == sorted(expected)


def test_the_picture_is_large_enough_to_read(tabs):
    assert all(found.whole.shape == (SIZE[1], SIZE[0], 3) for found in tabs.values())


@pytest.mark.parametrize("tab, title, name", EVERY_CURVE, ids=lambda text: text.replace(" ", "_"))
def test_every_curve_is_seen_in_its_plot(tabs, tab, title, name):
    names = dict(PLOTS[tab])[title]
    for image in pictures(tabs, tab, title, names):
        assert curve_pixels(image, PAGES.colour(name)) > 30


@pytest.mark.parametrize("tab, title, names", EVERY_PLOT, ids=lambda part: str(part).replace(" ", "_"))
def test_no_plot_shows_the_colour_of_another(tabs, tab, title, names):
    others = COLOURS - {PAGES.colour(name) for name in names}
    assert others
    for image in pictures(tabs, tab, title, names):
        assert {colour: count for colour in others if (count := curve_pixels(image, colour)) > 10} == {}


@pytest.mark.parametrize("tab, title, names", EVERY_PLOT, ids=lambda part: str(part).replace(" ", "_"))
def test_legends_and_numbers_are_written(tabs, tab, title, names):
    image, *without = pictures(tabs, tab, title, names)
    for name in names:
        # for the thinnest letters, e.g. of p1 [MPa]
        assert legend_text(image, PAGES.colour(name)) > 25, f"no text beside the dot of {name}"
        assert not any(legend_text(other, PAGES.colour(name)) for other in without), "a legend that is off"
    ground = int(np.median(image))
    assert (image[-18:].max(axis=2) > ground + 60).sum() > 20, "no times below"
    assert (image[:-18, :26].max(axis=2) > ground + 30).sum() > 5, "no values at the left"


def test_report_and_events_are_written(tabs):
    written = {name: text_pixels(image) for name, image in tabs["shifts"].views}
    assert written["Report"] > 1500 and written["Events"] > 1500


@pytest.fixture(scope="module")
def windows(recorded):
    """Returns title of a view of states -> the window that it shows [s], its signals from the top."""
    events = Bag(recorded).events()
    orders = [(t, int(value)) for t, _, name, _, value in events if name == "shift_ordered"]
    shifts = layout.choose(
        layout.shifts_of([(t, before, after) for (_, before), (t, after) in zip([(0, 0), *orders], orders)], PAGES.box)
    )
    whole = layout.with_room((shifts[0].window[0], shifts[-1].window[1]))
    return {
        "States": (whole, sorted(PAGES.states)),
        **{shift.title: (layout.with_room(shift.window), sorted(PAGES.shift_states)) for shift in shifts},
    }


def test_every_state_has_its_colour_as_long_as_it_lasts(tabs, windows, recorded):
    bag, checked = Bag(recorded), set()
    views = dict(tabs["run"].views) | dict(tabs["shifts"].views)
    for title, ((start, end), names) in windows.items():
        bars = lanes(views[title])
        assert len(bars) == len(names), f"{title}: {len(bars)} lanes"
        for bar, name in zip(bars, names):
            t, values = bag.series(name)
            there = values[(t >= start) & (t <= end)]
            for number, label in catalogue().signal(name).states.items():
                expected = float((there == number).mean())
                assert share(bar, name, label) == pytest.approx(expected, abs=0.015), (title, name, label)
                if expected > 0.02:
                    checked.add((name, label))
    assert {(f"{clutch}_mode", label) for clutch in ("s1", "s2") for label in ("open", "slipping", "locked")} | {
        ("gear", "I"),
        ("gear", "II"),
        ("gear_ordered", "I"),
        ("gear_ordered", "II"),
        ("rig_state", "running"),
    } <= checked


def test_window_and_tab_of_a_picture_can_be_chosen(run, tabs, tmp_path):
    picture = tmp_path / "other.png"
    assert main(["view", str(run), "--window", "1.2,2.6", "--tab", "other", "--picture", str(picture)]) == 0
    image = image_of(picture.read_bytes())
    assert image.shape == tabs["other"].whole.shape and (image != tabs["other"].whole).mean() > 0.02
    assert curve_pixels(image, SUPPLY) > 100, "the oil's temperature is in this tab"


def test_a_killed_command_leaves_no_viewer(recorded, tmp_path):
    command = subprocess.Popen(
        [sys.executable, "-m", "rig_nodes.cli.main", "view", str(recorded), "--picture", str(tmp_path / "x.png")],
        stdout=subprocess.DEVNULL,
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
