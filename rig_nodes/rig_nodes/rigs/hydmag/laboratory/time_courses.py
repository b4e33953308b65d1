# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The thesis's figures of quantities over time, each from one run of the series that it shows.

Used by the verb ``validate`` for its pictures, beside rigs.hydmag.laboratory.pictures, which draws results over settings.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial
from math import pi

import numpy as np

from rig_nodes.analysis import odd_width, running_mean
from rig_nodes.bags import Recording
from rig_nodes.rig import load_rig
from rig_nodes.runs import Run, Workers, load_procedure, run_repeat
from rig_nodes.view import Description, Line, Pages, chart

MEAN, STEP = 1e-3, 2e-3  # s: time over which a point is averaged, and time between two points
BEFORE, AFTER = 0.1, 1.2  # s around the order
PAGES = Pages(load_rig("hydmag").as_dict())
BOX = PAGES.box
CHANNELS = {  # part of a figure -> (axis with unit, factor from SI, channels)
    "torque": ("torque [Nm]", 1.0, (BOX.input.torque, BOX.output.torque)),
    "speed": ("speed [rpm]", 30.0 / pi, (BOX.input.speed, BOX.output.speed)),
    "pressure": ("pressure [MPa]", 1e-6, tuple(clutch.pressure for clutch in BOX.clutches)),
    "current": ("coil current [mA]", 1e3, tuple(clutch.current for clutch in BOX.clutches)),
}
SHIFT = ("torque", "speed", "pressure")


@dataclass(frozen=True)
class Course:
    """One figure: the series of a procedure that it shows, the gears of the order, and the parts that are drawn."""

    figure: str
    title: str
    procedure: str
    series: str
    gears: tuple[int, int]
    parts: tuple[str, ...] = SHIFT


UP, DOWN = BOX.ways().values()
COURSES = (
    Course("7_9", "Fig. 7.9, 7.10: response of ZR-P2", "valve_response", "ZR-P2", (0, 2), ("pressure", "current")),
    Course("7_12", "Fig. 7.12, 7.13: response of ZR-P1", "valve_response", "ZR-P1", (0, 1), ("pressure", "current")),
    Course("7_17", "Fig. 7.17: engagement of S1", "profile_series", "ZR-P1-19", (0, 1), ("pressure", "torque")),
    Course("7_18", "Fig. 7.18: engagement of S2", "profile_series", "ZR-P2-10", (0, 2), ("pressure", "torque")),
    Course("7_19", "Fig. 7.19: I to II, series 6", "delay_series", "6", UP),
    Course("7_20", "Fig. 7.20: I to II, series 19", "delay_series", "19", UP),
    Course("7_25", "Fig. 7.25: II to I, series 14", "delay_series", "14", DOWN),
    Course("7_26", "Fig. 7.26: II to I, series 19", "delay_series", "19", DOWN),
    Course("7_31_up", "Fig. 7.31: I to II, 2000 rpm, 40 Nm", "grid_up", "2000rpm-40Nm", UP),
    Course("7_31_down", "Fig. 7.31: II to I, 2000 rpm, 40 Nm", "grid_down", "2000rpm-40Nm", DOWN),
    Course("7_32", "Fig. 7.32: I to II, 2000 rpm, 120 Nm", "grid_up", "2000rpm-120Nm", UP),
    Course("7_33", "Fig. 7.33: II to I, 2000 rpm, 160 Nm", "grid_down", "2000rpm-160Nm", DOWN),
    Course("7_34", "Fig. 7.34: II to I, 1800 rpm, 180 Nm", "grid_down", "1800rpm-180Nm", DOWN),
)


def draw(course: Course, run: Run) -> list[tuple[str, Description]]:
    """Draw the parts of a figure for the last order between its gears.

    Parameters
    ----------
    course : Course
        The figure.
    run : Run
        A run of its series.

    Returns
    -------
    list of (str, Description)
        Name of the file without ending, and figure, of each part; empty when there is no such order.
    """
    times = [t for t, *gears in run.recording.orders if tuple(gears) == course.gears]
    if not times:
        return []
    return [(f"fig_{course.figure}_{part}", _figure(course, part, run.recording, times[-1])) for part in course.parts]


def _figure(course: Course, part: str, recording: Recording, order: float) -> Description:
    name, factor, channels = CHANNELS[part]
    lines = []
    since = np.arange(-BEFORE, AFTER + 0.5 * STEP, STEP)
    rows = np.rint((order + since - recording.t0) / recording.period).astype(int)
    inside = (rows >= 0) & (rows < recording.rows)
    for channel in channels:
        smooth = running_mean(recording.channels[channel], odd_width(MEAN, recording.period))
        colour = PAGES.look(channel).colour
        lines.append(Line(channel, since[inside], smooth[rows[inside]] * factor, marks=False, colour=colour))
    return chart(course.title, "time after the order [s]", name, lines)


def _run_and_draw(rig: str, settings: dict[str, str] | None, course: Course) -> list[tuple[str, Description]]:
    (series,) = load_procedure(course.procedure).series([course.series])
    return draw(course, run_repeat(series, 0, rig, settings))


def time_courses(
    procedures: Iterable[str], workers: Workers, rig: str = "hydmag", settings: dict[str, str] | None = None
) -> list[tuple[str, Description]]:
    """Draw the figures of some procedures' series, each from one run.

    Parameters
    ----------
    procedures : iterable of str
        Names of the procedures.
    workers : Workers
        The worker processes.
    rig : str
        Name or file of the rig.
    settings : dict of str to str or None
        Changes of the rig.

    Returns
    -------
    list of (str, Description)
        Name of the file without ending, and figure, of each part.
    """
    wanted = [course for course in COURSES if course.procedure in procedures]
    return [figure for found in workers.map(partial(_run_and_draw, rig, settings), wanted) for figure in found]
