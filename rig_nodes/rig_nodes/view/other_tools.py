# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Layouts of PlotJuggler and Foxglove: the same plots as in the project's own view, with topics and fields of the catalogue.

`rig view --layout` uses it. The forms follow the files that the programs write: PlotJuggler's layout XML
(plotwidget.cpp, plot_docker.cpp, tabbedplotwidget.cpp of PlotJuggler 3) and the layout JSON that Foxglove and
its open successor Lichtblick exchange.
"""

from __future__ import annotations

import json
import xml.etree.ElementTree as xml
from pathlib import Path
from typing import TYPE_CHECKING

from ..base import MAKER, atomic_write
from ..rig import Signal
from .pages import Pages
from .palette import CURVES, rgb

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence


def tabs(pages: Pages) -> list[tuple[str, list[list[tuple[str, list[str]]]]]]:
    """Return the tabs as (title, columns of (plot title, signals)), with the states first, as in the project's own view.

    Time derivatives, which no topic carries, are left out.
    """

    def lists(plots: Iterable[tuple[str, Sequence[str]]]) -> list[tuple[str, list[str]]]:
        return [(title, list(names)) for title, names in plots if not pages.rates.keys() & set(names)]

    others = lists(pages.other_plots)
    half = (len(others) + 1) // 2
    found = [
        ("Shift", [[("States", list(pages.shift_states)), *lists(pages.shift_plots)]] if pages.shift_plots else []),
        ("Run", [[("States", list(pages.states)), *lists(pages.run_left)], lists(pages.run_right)]),
        *((name, [lists(plots)]) for name, plots in pages.more_pages.items()),
        ("Other signals", [others[:half], others[half:]]),
    ]
    kept = [(title, [column for column in columns if column]) for title, columns in found]
    return [one for one in kept if one[1]]


def write_layout(tool: str, path: Path, pages: Pages) -> None:
    """Write the layout of a rig for "plotjuggler" or "foxglove", completely or, with RigError, not at all."""
    atomic_write(path, {"plotjuggler": plotjuggler, "foxglove": foxglove}[tool](pages))


def _states(pages: Pages, names: list[str]) -> bool:
    return bool(pages.known.signal(names[0]).states)


def _colour(pages: Pages, names: list[str], name: str) -> str:
    shade = rgb(CURVES[names.index(name) % len(CURVES)]) if _states(pages, names) else pages.colour(name)
    return "#%02x%02x%02x" % shade


def _legend(signal: Signal) -> str:
    return ", ".join(f"{number} {label}" for number, label in signal.states.items())


# ---- PlotJuggler


def plotjuggler(pages: Pages) -> str:
    """Return the layout XML of PlotJuggler.

    Curves are named topic/field, as its ROS parsers name them; a transform converts to display units.
    """
    root = xml.Element("root")
    window = xml.SubElement(root, "tabbed_widget", {"name": "Main Window", "parent": "main_window"})
    for title, columns in tabs(pages):
        tab = xml.SubElement(window, "Tab", tab_name=title, containers="1")
        container = xml.SubElement(tab, "Container")
        _splitter(container, "|", [_column(pages, column) for column in columns])
    xml.SubElement(window, "currentTabIndex", index="0")
    xml.SubElement(root, "use_relative_time_offset", enabled="0")
    xml.indent(root, " ")
    return f"<?xml version='1.0' encoding='UTF-8'?>\n<!-- {MAKER} -->\n" + xml.tostring(root, encoding="unicode") + "\n"


def _splitter(parent: xml.Element, orientation: str, children: list) -> None:
    share = ";".join(f"{1 / len(children):.6f}" for _ in children)
    splitter = xml.SubElement(parent, "DockSplitter", orientation=orientation, count=str(len(children)), sizes=share)
    splitter.extend(children)


def _column(pages: Pages, plots: Iterable[tuple[str, list[str]]]) -> xml.Element:
    holder = xml.Element("holder")
    _splitter(holder, "-", [_area(pages, title, names) for title, names in plots])
    return holder[0]


def _area(pages: Pages, title: str, names: list[str]) -> xml.Element:
    unit = pages.known.signal(names[0]).display_unit
    area = xml.Element("DockArea", name=title if _states(pages, names) else f"{title} [{unit}]")
    plot = xml.SubElement(
        area,
        "plot",
        mode="TimeSeries",
        style="Steps" if _states(pages, names) else "Lines",
        line_width="1.5",
        flip_x="false",
        flip_y="false",
    )
    xml.SubElement(plot, "limitY")
    for name in names:
        signal = pages.known.signal(name)
        curve = xml.SubElement(plot, "curve", name=f"{signal.topic}/{signal.field}", color=_colour(pages, names, name))
        alias = f"{name} ({_legend(signal)})" if signal.states else f"{name} [{signal.display_unit}]"
        transform = xml.SubElement(curve, "transform", name="Scale/Offset", alias=alias)
        xml.SubElement(transform, "options", time_offset="0", value_offset="0", value_scale=repr(signal.scale))
    return area


# ---- Foxglove


def foxglove(pages: Pages) -> str:
    """Return the layout JSON of Foxglove.

    Values are drawn in SI as transmitted, which the titles state; states are drawn as state transitions.
    """
    panels: dict[str, dict] = {}
    tabs_of = []
    for title, columns in tabs(pages):
        stacks = [
            _mosaic("column", [_panel(pages, panels, f"{title} {plot}", plot, names) for plot, names in column])
            for column in columns
        ]
        tabs_of.append({"title": title, "layout": _mosaic("row", stacks)})
    panels["Tab!rig"] = {"activeTabIdx": 0, "tabs": tabs_of}
    whole = {"configById": panels, "globalVariables": {}, "userNodes": {}, "playbackConfig": {"speed": 1}, "layout": "Tab!rig"}
    return json.dumps(whole, indent=1, ensure_ascii=False) + "\n"


def _panel(pages: Pages, panels: dict, place: str, title: str, names: list[str]) -> str:
    """Add one panel and return its id."""
    slug = "".join(c for c in place.lower() if c.isalnum())
    paths = []
    for name in names:
        signal = pages.known.signal(name)
        label = f"{name} ({_legend(signal)})" if signal.states else f"{name} [{signal.unit}]"
        paths.append(
            {
                "value": f"{signal.topic}.{signal.field}",
                "label": label,
                "enabled": True,
                "color": _colour(pages, names, name),
                "timestampMethod": "receiveTime",
            }
        )
    if _states(pages, names):
        key = f"StateTransitions!{slug}"
        panels[key] = {"foxglovePanelTitle": title, "isSynced": True, "paths": paths}
        return key
    key, unit = f"Plot!{slug}", pages.known.signal(names[0]).unit
    panels[key] = {
        "foxglovePanelTitle": f"{title} [{unit}]",
        "yAxisLabel": unit,
        "paths": paths,
        "xAxisVal": "timestamp",
        "isSynced": True,
        "showLegend": True,
        "legendDisplay": "floating",
        "showPlotValuesInLegend": False,
        "showXAxisLabels": True,
        "showYAxisLabels": True,
        "sidebarDimension": 240,
    }
    return key


def _mosaic(direction: str, parts: list) -> dict | str:
    """Return panels side by side ("row") or stacked ("column") in equal shares, as a tree of pairs."""
    if len(parts) == 1:
        return parts[0]
    return {"direction": direction, "first": parts[0], "second": _mosaic(direction, parts[1:]), "splitPercentage": 100 / len(parts)}
