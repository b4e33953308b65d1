# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Layouts for PlotJuggler and Foxglove: complete, with all signals, and every path leads to a field of the sample bag."""

import json
import re
import xml.etree.ElementTree as xml
from pathlib import Path

import pytest

from rig_nodes.bags.reader import Bag
from rig_nodes.cli.main import main
from rig_nodes.rig.configuration import load_rig
from rig_nodes.view.other_tools import tabs
from rig_nodes.view.pages import Pages

SAMPLE = Path(__file__).parents[2] / "bags" / "sample"
PLOTTED = re.compile(r"(?:float|int|uint)\d+|bool")

PAGES = Pages(load_rig("hydmag").as_dict())


@pytest.fixture(scope="module")
def fields():
    """Returns topic -> name -> (type, number of elements or None, empty for a list), from the schemas in the sample bag."""
    bag, found = Bag(SAMPLE), {}
    for topic in bag.counts:
        _, text, _ = bag.channel(topic)
        top = text.split("=" * 80)[0]
        rows = [line.split("#")[0].split() for line in top.splitlines()]
        found[topic] = {
            row[1]: re.fullmatch(r"([\w/]+)(?:\[(\d*)\])?", row[0]).groups() for row in rows if len(row) == 2 and "=" not in row[1]
        }
    return found


def signal_at(fields, topic, field):
    """Returns the name of the signal at a place, which must be a number that the bag's schema has."""
    name, index = re.fullmatch(r"(\w+)(?:\[(\d+)\])?", field).groups()
    kind, count = fields[topic][name]
    assert PLOTTED.fullmatch(kind), f"{topic} {field} is a {kind}"
    assert (index is None) == (count is None) and (index is None or not count or int(index) < int(count))
    return next(s.name for s in PAGES.known.signals.values() if (s.topic, s.field) == (topic, field))


@pytest.fixture
def made(tmp_path):
    """Writes a layout by the command; returns its text."""

    def make(tool):
        path = tmp_path / f"layout.{'json' if tool == 'foxglove' else 'xml'}"
        assert main(["view", "--layout", tool, "--out", str(path)]) == 0
        assert [entry.name for entry in tmp_path.iterdir()] == [path.name]
        return path.read_text(encoding="utf-8")

    return make


@pytest.fixture
def plotjuggler(made):
    return xml.fromstring(made("plotjuggler").encode())


@pytest.fixture
def foxglove(made):
    return json.loads(made("foxglove"))


def titles():
    """Returns tab -> titles of its plots in the rig's own layout."""
    return {tab: [title for column in columns for title, _ in column] for tab, columns in tabs(PAGES)}


def test_tabs_have_the_plots_of_our_own_view():
    assert titles()["Shift"] == ["States", *(title for title, _ in PAGES.shift_plots)]
    assert titles()["Run"] == ["States", *(title for title, _ in PAGES.run_left + PAGES.run_right)]


def test_plotjuggler_shows_every_signal_in_peoples_units(plotjuggler, fields):
    found = set()
    for curve in plotjuggler.iter("curve"):
        topic, _, field = curve.get("name").rpartition("/")
        signal = PAGES.known.signal(signal_at(fields, topic, field))
        transform = curve.find("transform")
        assert transform.get("name") == "Scale/Offset"
        assert float(transform.find("options").get("value_scale")) == signal.scale
        assert signal.states or transform.get("alias") == f"{signal.name} [{signal.display_unit}]"
        assert re.fullmatch("#[0-9a-f]{6}", curve.get("color"))
        found.add(signal.name)
    assert found == set(PAGES.known.signals)


def test_plotjuggler_finds_the_tree_that_it_walks(plotjuggler):
    (window,) = plotjuggler.findall("tabbed_widget")
    assert (window.get("name"), window.get("parent")) == ("Main Window", "main_window")
    shown = {}
    for tab in window.findall("Tab"):
        (container,) = tab.findall("Container")
        assert tab.get("containers") == "1" and [child.tag for child in container] == ["DockSplitter"]
        for splitter in tab.iter("DockSplitter"):
            assert splitter.get("orientation") in "|-" and int(splitter.get("count")) == len(splitter)
            sizes = [float(size) for size in splitter.get("sizes").split(";")]
            assert len(sizes) == len(splitter) and sum(sizes) == pytest.approx(1.0, abs=1e-5)
            assert {child.tag for child in splitter} <= {"DockSplitter", "DockArea"}
        areas = list(tab.iter("DockArea"))
        assert all([child.tag for child in area] == ["plot"] for area in areas)
        shown[tab.get("tab_name")] = [area.get("name").partition(" [")[0] for area in areas]
    assert shown == titles()


def test_foxglove_shows_every_signal_and_says_its_unit(foxglove, fields):
    found = set()
    for key, panel in foxglove["configById"].items():
        for path in panel.get("paths", ()):
            topic, _, field = path["value"].partition(".")
            signal = PAGES.known.signal(signal_at(fields, topic, field))
            assert path["enabled"] and path["timestampMethod"] == "receiveTime"
            assert key.startswith("StateTransitions!" if signal.states else "Plot!")
            if not signal.states:
                assert panel["foxglovePanelTitle"].endswith(f" [{signal.unit}]")
                assert path["label"] == f"{signal.name} [{signal.unit}]"
            found.add(signal.name)
    assert found == set(PAGES.known.signals)


def test_foxglove_finds_each_panel_once(foxglove):
    def leaves(node):
        if isinstance(node, str):
            return [node]
        assert node["direction"] in ("row", "column") and 0 < node["splitPercentage"] < 100
        return leaves(node["first"]) + leaves(node["second"])

    root = foxglove["configById"][foxglove["layout"]]
    placed = {tab["title"]: leaves(tab["layout"]) for tab in root["tabs"]}
    assert sorted(sum(placed.values(), [foxglove["layout"]])) == sorted(foxglove["configById"])
    shown = {
        title: [foxglove["configById"][key]["foxglovePanelTitle"].partition(" [")[0] for key in keys]
        for title, keys in placed.items()
    }
    assert shown == titles()
    for columns in tabs(PAGES):
        parts = foxglove["configById"][placed[columns[0]][0]]
        assert len({path["color"] for path in parts["paths"]}) == len(parts["paths"])


def test_other_tools_read_the_rigs_time_from_the_file():
    from mcap.reader import make_reader

    with open(SAMPLE / "sample_0.mcap", "rb") as file:
        messages = list(make_reader(file).iter_messages(topics=["/clutch_s1/p1"]))
    assert messages and all(message.publish_time == message.log_time for _, _, message in messages)


def test_a_layout_of_another_rig_has_its_signals_and_clutches(tmp_path):
    path = tmp_path / "layout.json"
    assert main(["view", "--layout", "foxglove", "--rig", "three_speed", "--out", str(path)]) == 0
    text = path.read_text()
    assert all(f'"{name} [' in text for name in ("n_in", "p_b1", "b1_torque", "c3_slip", "v_c2_duty")) and "s1_" not in text
    path = path.with_suffix(".xml")
    assert main(["view", "--layout", "plotjuggler", "--rig", "clutch_bench", "--out", str(path)]) == 0
    assert 'tab_name="Shift"' not in path.read_text() and "M_e [Nm]" in path.read_text()
