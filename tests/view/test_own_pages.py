# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pages of the view from a rig's folder: they replace those that are made from its parts, or are added to them."""

import json
import math
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from rig_nodes.base.errors import RigError
from rig_nodes.base.names import installed
from rig_nodes.cli.main import main
from rig_nodes.plant.parts import part as parts
from rig_nodes.rig.configuration import load_rig
from rig_nodes.rig.structure import structure_of
from rig_nodes.view import layout
from rig_nodes.view import pages as pages_module
from rig_nodes.view import plots as plots_module
from rig_nodes.view.convert import make_tab_view, make_view
from rig_nodes.view.curves import Curves
from rig_nodes.view.live import _Shown
from rig_nodes.view.message_blocks import Block
from rig_nodes.view.other_tools import foxglove, plotjuggler, tabs
from rig_nodes.view.pages import Pages

OWN = """\
description: three speeds with pages of its own
base: three_speed
view:
  Slips at a glance:
    Slip: [b1_slip, c2_slip, c3_slip]
    Oil of B1: [p_b1]
  run:
    Both shafts: [n_in, n_out]
    What they carry: [M_in, M_out, motor_torque]
    Load: [p_load]
"""


def written(folder, text: str = OWN):
    folder.mkdir(exist_ok=True)
    (folder / "rig.yaml").write_text(text)
    return folder


def titles(blueprint) -> list[str]:
    """Returns the names of the tabs of a layout."""
    return [tab.name for tab in blueprint.root_container.contents]


def test_its_pages_are_tabs_and_replace_those_of_the_same_name(tmp_path):
    pages, plain = Pages(load_rig(written(tmp_path / "own")).as_dict()), Pages(load_rig("clutch_bench").as_dict())
    present = set(pages.known.signals)
    assert titles(layout.blueprint(pages, present, (0.0, 1.0))) == ["Planetary set", "Slips at a glance", "Run", "Other signals"]
    assert titles(layout.live_blueprint(pages, 5.0)) == ["Planetary set", "Slips at a glance", "Run", "Other signals"]
    assert titles(layout.live_blueprint(plain, 5.0)) == ["Run", "Other signals"]
    assert [title for title, _ in (*pages.run_left, *pages.run_right)] == ["Both shafts", "Load", "What they carry"]
    shown = dict(tabs(pages))
    assert shown["Slips at a glance"] == [[("Slip", ["b1_slip", "c2_slip", "c3_slip"]), ("Oil of B1", ["p_b1"])]]
    others = {name for column in shown["Other signals"] for _, names in column for name in names}
    assert not others & {"c2_slip", "n_in", "M_out"} and "c2_piston" in others, "what its pages leave is found there"
    assert "Planetary set" in shown, "its base's pages are its own too"


def test_a_bag_knows_them_when_the_folder_is_gone(tmp_path):
    config = load_rig(written(tmp_path / "own"))
    record = json.loads(json.dumps(config.as_dict()))
    assert structure_of(record["structure"]) == config.structure
    assert "view" not in load_rig("hydmag").as_dict()["structure"], "a rig without pages of its own has the record that it had"


def test_a_picture_is_made_of_a_page_by_its_name(tmp_path, read_rrd):
    folder = written(tmp_path / "own")
    (folder / "sequences").mkdir()
    (folder / "sequences" / "short.yaml").write_text("description: x\nsteps:\n  - wait: {for: 100 ms}\n")
    assert main(["simulate", "short", "--rig", str(folder), "--out", str(tmp_path / "run")]) == 0
    view, page = make_view(tmp_path / "run").path, tmp_path / "page.rrd"
    make_tab_view(view, tmp_path / "run", None, page, "Slips at a glance")
    whole, shown = read_rrd(view), read_rrd(page)
    assert set(shown.views()) == {"Slip [rpm]", "Oil of B1 [MPa]", "Report", "Events"} < set(whole.views()), "without a shift"
    entity = "/" + layout.entity(Pages(load_rig(folder).as_dict()).signal("b1_slip"))
    assert shown.data[entity]["t"] == whole.data[entity]["t"], "with all its curves"
    (window,) = shown.layout[f"/view/{layout.SHARED_AXIS}/TimeAxis"]["TimeAxis:view_range"]
    assert window["end"] > 1.1 * max(shown.data[entity]["t"]), "no legend covers a curve"
    with pytest.raises(RigError, match="--tab: there is no tab 'Slips at a glanze'; did you mean 'Slips at a glance'"):
        make_tab_view(view, tmp_path / "run", None, page, "Slips at a glanze")


@pytest.mark.parametrize(
    "old, new, sentence",
    [
        ("c3_slip]", "c4_slip]", r"rig.yaml:5: view.Slips at a glance.Slip: there is no signal 'c4_slip'; did you mean"),
        (
            "[p_b1]",
            "[p_b1, n_in]",
            "rig.yaml:6: view.Slips at a glance.Oil of B1: a plot's signals share their unit, found p_b1 in MPa and n_in in rpm",
        ),
        ("[p_b1]", "[gear]", "gear is a state, which the view shows in lanes of its own"),
        ("[p_b1]", "p_b1", "view.Slips at a glance.Oil of B1 must be a list of signals, .*found 'p_b1'"),
        ("[p_b1]", "[]", "must be a list of signals"),
        ("[p_b1]", "{show: [p_b1], turn: n_inn}", "there is no signal 'n_inn'; did you mean 'n_in'"),
        ("[p_b1]", "{show: [p_b1], turn: p_b1}", "turn must be a speed of rotation, found p_b1 in MPa"),
        ("[p_b1]", "{rates: [p_b1]}", r"must be a list of signals, \{rate: LIST\} or \{show: LIST, turn: SPEED\}, found"),
        (
            "  Slips at a glance:\n    Slip: [b1_slip, c2_slip, c3_slip]\n    Oil of B1: [p_b1]\n",
            "  Slips: [n_in]\n",
            "view.Slips must be a map of plots, each a title and the list of its signals",
        ),
        (OWN[OWN.index("view:") :], "view: [n_in]\n", "rig.yaml:3: view must be a map of pages"),
    ],
)
def test_what_cannot_be_shown_is_refused_with_its_line(tmp_path, old, new, sentence):
    assert old in OWN
    with pytest.raises(RigError, match=sentence):
        load_rig(written(tmp_path / "wrong", OWN.replace(old, new)))


def test_no_rig_and_no_signal_of_a_rig_is_named_in_the_view():
    named = {*installed("rigs"), *load_rig("hydmag").catalogue.signals, *load_rig("three_speed").catalogue.signals}
    words = re.compile(rf"\b({'|'.join(sorted(name for name in named if re.search(r'[_0-9A-Z]', name)))})\b")
    # every rig with gears has the first four, the fifth is a quantity of a part, the last two are keys of every report's energy
    allowed = {"rig_state", "gear_ordered", "loss_in", "loss_out", "relief_setting", "motor_work", "load_work"}
    for path in Path(pages_module.__file__).parent.glob("*.py"):
        assert set(words.findall(path.read_text())) <= allowed, path.name


def test_a_plot_that_is_one_record_is_in_the_view_and_in_the_layouts_of_other_tools(monkeypatch):
    def sources(pages):
        return pages.structure.of_role(parts.SOURCE)

    more = plots_module.Plot("Work of {called}", (plots_module.LEFT,), lambda pages, one: pages.own(one, "work"), sources)
    monkeypatch.setattr(pages_module, "PLOTS", (*plots_module.PLOTS, more))
    pages = Pages(load_rig("hydmag").as_dict())
    assert pages.run_left[-1] == ("Work of motor", ("motor_work",)) and "Energy of motor" not in dict(pages.other_plots)
    assert "Work of motor" in [title for columns in dict(tabs(pages)).values() for plots in columns for title, _ in plots]


INSTALLED = {name: Pages(load_rig(name).as_dict()) for name in installed("rigs")}


def plots_of(pages):
    moments = (pages.shift_plots, pages.valve_plots, pages.coast_plots) if pages.box else ()
    groups = (*moments, pages.run_left, pages.run_right, pages.other_plots)
    return [(title, tuple(names)) for plots in (*groups, *pages.more_pages.values()) for title, names in plots]


@pytest.mark.parametrize("rig", INSTALLED)
def test_no_two_curves_of_a_plot_have_the_same_colour(rig):
    pages = INSTALLED[rig]
    alike = {title: names for title, names in plots_of(pages) if len({pages.colour(name) for name in names}) < len(names)}
    assert alike == {}
    setpoints = [name for _, names in plots_of(pages) for name in names if name.endswith("speed_setpoint")]
    assert all(pages.look(name).demanded for name in setpoints), "wide curves are pale"


@pytest.mark.parametrize("rig", INSTALLED)
def test_a_title_names_what_is_in_its_plot(rig):
    pages = INSTALLED[rig]
    for title, names in pages.other_plots:
        assert " of " in title and len({pages.signal(name).quantity for name in names}) == 1, (title, names)
    for title, names in plots_of(pages):
        assert "_" not in title and len({pages.signal(name).display_unit for name in names}) == 1, (title, names)


def test_a_legend_has_the_words_for_a_device_and_a_transducers_own_name():
    pages = INSTALLED["chain_saw"]
    assert [pages.label(name) for name in ("shoe_clutch_capacity", "M_clutch", "n_engine", "energy_residual")] == [
        "shoe clutch capacity [Nm]",
        "M_clutch [Nm]",
        "n_engine [rpm]",
        "energy residual [kJ]",
    ]
    assert (
        INSTALLED["hydmag"].label("zr_p1_duty").startswith("ZR-P1 duty [") and INSTALLED["hydmag_engine"].words("v_rate") == "dv/dt"
    )


@pytest.mark.parametrize(
    ("rig", "first"),
    [("frame_saw", "Frame saw"), ("chain_saw", "Saw"), ("ural2", "Shafts"), ("clutch_bench", "Run"), ("hydmag_engine", "Vehicle")],
)
def test_a_rig_opens_on_its_own_page(rig, first):
    pytest.importorskip("rerun")
    shown = layout.blueprint(INSTALLED[rig], set(INSTALLED[rig].known.signals), (0.0, 1.0)).root_container
    assert shown.contents[shown.active_tab].name == first
    assert titles(layout.live_blueprint(INSTALLED[rig], 5.0))[0] == first


class OfRamp:
    """A piece of a bag in which a signal rises by 3 a second."""

    def __init__(self, topic):
        self.counts = {topic: 400}

    def columns(self, topic):
        return []

    def has_field(self, signal):
        return True

    def series(self, signal):
        t = np.arange(400) / 200.0
        return t, 3.0 * t + 1.0


def test_the_acceleration_of_a_vehicle_is_on_its_page_as_in_the_report_also_while_it_drives():
    rr = pytest.importorskip("rerun")
    pytest.importorskip("rerun.blueprint")
    pages = INSTALLED["hydmag_engine"]

    def plots(shown):
        tabs = [tab for tab in shown.root_container.contents if tab.name == "Vehicle"]
        columns = [column for tab in tabs for column in tab.contents]
        return [view.name for one in columns for view in (one.contents if isinstance(one, rr.blueprint.Vertical) else [one])]

    name = "Acceleration of the vehicle [m/s²]"
    assert name in plots(layout.blueprint(pages, set(pages.known.signals), (0.0, 1.0)))
    assert name not in plots(layout.blueprint(pages, {"n_wej"}, (0.0, 1.0))) and name in plots(layout.live_blueprint(pages, 5.0))
    sent, topic = {}, pages.known.topics[pages.known.signal("v").topic]
    rec = SimpleNamespace(log=lambda *_, **__: None, send_columns=lambda place, times, values: sent.update({place: values}))
    t, values = OfRamp(topic.name).series("v")
    rows = np.zeros(400, [(pages.known.signal("v").field, float), ("seq", int)])
    rows[pages.known.signal("v").field] = values
    live = _Shown(pages, topic)
    live._signals, live._blocks = [pages.known.signal("v")], SimpleNamespace(of=lambda _: Block(topic.ros_type, [], rows, t))
    for send in (lambda: Curves(rr, rec, pages, ["v"], []).add(OfRamp(topic.name)), lambda: live.send(rr, rec, [], 0.0)):
        sent.clear()
        send()
        (found,) = sent["velocity/v_rate"]
        assert np.asarray(found.as_arrow_array().to_pylist()).ravel() == pytest.approx(np.full(39, 3.0))
    for tool in (plotjuggler, foxglove):
        assert "Acceleration" not in tool(pages) and "Speed of the vehicle" in tool(pages)


@pytest.mark.parametrize(
    "ends",
    [
        (-280.0, 432.0),
        (-450.0, 432.0),
        (0.0, 745.0),
        (0.0, 2.4),
        (40.0, 40.1),
        (99.0, 101.0),
        (0.0, 9.4),
        (3.0, 3.0),
        (-1e-4, 2e-6),
    ],
    ids=str,
)
def test_an_axis_has_at_least_two_numbers_that_the_viewer_shows(ends):
    low, high = layout.height(*ends)
    assert low < ends[0] and high > ends[1]
    shown = []
    for power in range(-8, 6):  # the viewer writes a step's numbers when they are not too close, in a plot of four in a column
        step = 10.0**power
        if (high - low) / step <= 11.0:
            shown.append(math.floor(high / step) - math.ceil(low / step) + 1)
    assert max(shown) >= 2 and high - low < 1.6 * max(ends[1] - ends[0], 0.25), "and most of it is the curve's"
