# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The calculations of the paper on frame saws (A. I. Agapov, Vyatka State University, Kirov 2014), and results from its numbers.

The formulas that the rig itself uses are in its parts: plant.parts.saw_cutting and plant.parts.sash.
"""

from __future__ import annotations

from itertools import pairwise
from math import acos, cos, floor, pi, sin
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import brentq

from rig_nodes.base import RigError
from rig_nodes.plant import depth_of_cut, feed_per_tooth, motion
from rig_nodes.rigs.frame_saw.turns import FINE, MM, NoSteadyTurn, crank_speed, one_turn, teeth_torque
from rig_nodes.runs import Table

if TYPE_CHECKING:
    from rig_nodes.rig import RigConfig
    from rig_nodes.runs import Recorded

OLD_FEED = 15 * MM  # feed of the frame without swing, as in the sequence demo
OLD_PRESSURE = 58.9e6  # Pa: cutting pressure with which the frame without swing takes all its 45 kW at this feed
RATED = (45e3, 65e3, 75e3)  # W, paper, conclusions
GROWTH = (1.7, 2.5)  # growth of the motors' power up to today's 45 kW, paper p. 1
SAVED = 0.37  # saved share of the energy per output, paper p. 2, tests of the frame R63-7
PLACES = (26, 50, 100, 150, 200, 250, 300, 350, 400)  # mm, paper, table 1: y
# paper, table 1: by r and S_0 [mm] the feed per tooth [mm] at PLACES
PRINTED = {
    (0.0, 30.0): (3.43, 2.06, 1.73, 1.60, 1.64, 1.61, 1.66, 1.83, 3.43),
    (3.25, 30.0): (0.64, 1.55, 2.09, 2.34, 2.43, 2.41, 2.24, 1.89, 0.65),
    (3.25, 20.0): (-0.49, 0.86, 1.52, 1.80, 1.90, 1.87, 1.69, 1.28, -0.49),
    (3.25, 10.0): (-1.64, 0.18, 0.94, 1.25, 1.37, 1.33, 1.13, 0.67, -1.64),
}


def _table_1(config: RigConfig) -> list[tuple[float, float, float, float, float, str]]:
    """Rows (r, S_0, y, computed, printed, kind of the print) of table 1; lengths in mm."""
    radius, pitch, rows = config.sash.radius, config.saw.pitch, []
    for (swing, feed), printed in PRINTED.items():
        computed = [feed_per_tooth(y * MM, feed * MM, swing * MM, radius, pitch) / MM for y in PLACES]
        for k, (y, ours, theirs) in enumerate(zip(PLACES, computed, printed)):
            neighbours = [computed[j] for j in (k - 1, k + 1) if 0 <= j < len(computed)]
            if abs(ours - theirs) <= 0.005 + 1e-12:
                how = "rounded"
            elif abs(int(ours * 100.0) / 100.0 - theirs) < 1e-9:
                how = "cut off"
            elif min(abs(other - theirs) for other in neighbours) <= 0.005:
                how = "swapped"
            elif min(abs(other - theirs) for other in neighbours) < 0.015:
                how = "swapped, the last digit one too high"
            else:
                how = "not explained"
            rows.append((swing, feed, float(y), ours, theirs, how))
    return rows


def feed_table(config: RigConfig) -> Table:
    """Feed per tooth over the stroke by formula (8), beside table 1 of the paper."""
    return Table(
        "feed per tooth S_z by (8), also with all digits after the second cut off, beside the printed one, and the way from one to "
        "the other (paper, table 1)",
        {"radius": "mm", "feed": "mm", "y": "mm", "feed_per_tooth": "mm", "cut_off": "mm", "printed": "mm", "print": ""},
        [(r * MM, s * MM, y * MM, a * MM, int(a * 100.0) / 100.0 * MM, b * MM, how) for r, s, y, a, b, how in _table_1(config)],
    )


def print_errors(config: RigConfig) -> Table:
    """Counts of the numbers of table 1 that are rounded, cut off, swapped or not explained, and contradictions in the print."""
    hows = [row[-1] for row in _table_1(config)]
    kinds = ("rounded", "cut off", "swapped", "swapped, the last digit one too high", "not explained")
    rows = [(how, float(hows.count(how))) for how in kinds]
    return Table("numbers of table 1 by the way in which they are printed", {"print": "", "count": "-"}, rows)


def stroke_ends(config: RigConfig) -> Table:
    """Feed per tooth at both ends of the stroke, which is equal by formula (8) and printed as 0.64 and 0.65 in table 1."""
    radius, pitch = config.sash.radius, config.saw.pitch
    rows = []
    for swing, feed in PRINTED:
        ends = [feed_per_tooth(y, feed * MM, swing * MM, radius, pitch) for y in (pitch, 2.0 * radius)]
        rows.append((swing * MM, feed * MM, *ends, ends[1] - ends[0]))
    return Table(
        "feed per tooth by (8) at y = t_3 and y = 2 R; they are equal at every S_0 and r, because arc and sin 2a are symmetric to "
        "the middle of the stroke",
        {"radius": "mm", "feed": "mm", "begin": "mm", "end": "mm", "difference": "mm"},
        rows,
    )


def given(config: RigConfig) -> Table:
    """Values that the paper gives, in the rig and in the calculations."""
    return Table(
        "values that the paper gives, in the rig",
        {"what": "", "value": "-"},
        [
            ("R [mm]", config.sash.radius / MM),
            ("t_3 [mm]", config.saw.pitch / MM),
            ("r of the rig [mm]", config.saw.eccentric_radius / MM),
            *((f"S_0 of row {k} of table 1 [mm]", feed) for k, (_, feed) in enumerate(PRINTED, 1)),
            ("motor of today [kW]", RATED[0] / 1e3),
            ("motor recommended, least [kW]", RATED[1] / 1e3),
            ("motor of the rig [kW]", config.motor_drive.power_limit / 1e3),
            ("growth of the motors, least", GROWTH[0]),
            ("growth of the motors, most", GROWTH[1]),
        ],
    )


def eccentric_phase(config: RigConfig) -> Table:
    """Angles in the working stroke at which the eccentric begins to advance the blades and to draw them back, by (3)."""
    radius, angles = config.sash.radius, np.linspace(0.0, pi, 36001)
    back = np.cos(2.0 * angles) > 0.0  # slope of r sin 2a
    rows = []
    for turn, k in zip(("to advancing", "to drawing back"), np.flatnonzero(np.diff(back))):
        angle = float(0.5 * (angles[k] + angles[k + 1]))
        rows.append((turn, angle, angle / pi, 0.5 * (1.0 - cos(angle))))
    return Table(
        f"turns of the swing in the working stroke of {2e3 * radius:.0f} mm: angle of the crank, its share of the half turn, and "
        "that of the stroke",
        {"turn": "", "angle": "deg", "of_half_turn": "%", "of_stroke": "%"},
        rows,
    )


def eccentric_turns(config: RigConfig) -> Table:
    """Turns of the eccentric in a turn of the crank, and the swing that it causes, from the path of a tooth by (3)."""
    path = np.array([row[:4] for row in tooth_path(config).rows])
    swing = path[:, 2] - path[:, 3]  # r sin 2a
    rising = int(np.sum((swing[:-1] <= 1e-12) & (swing[1:] > 1e-12)))
    return Table(
        "swings of the sash per turn of the crank, angle of the eccentric in that turn, and swing over the eccentric's radius",
        {"swings": "-", "angle": "deg", "lever_ratio": "-"},
        [(float(rising), 2.0 * pi * rising, float(np.ptp(swing)) / 2.0 / config.saw.eccentric_radius)],
    )


def eccentric(config: RigConfig) -> Table:
    """Radius of the eccentric by formula (10), for several feeds per tooth at the end of the stroke."""
    radius, pitch, feed = config.sash.radius, config.saw.pitch, 30 * MM
    mean = feed * pitch / (2.0 * radius)
    before = acos((pitch - radius) / radius)  # of the last tooth but one, (9)
    rows = []
    for rule, end in (
        ("half of the mean", 0.5 * mean),
        ("a third of the mean", mean / 3.0),
        ("0.65 mm, as table 1 has it", 0.65 * MM),
        ("0, where scraping would begin", 0.0),
    ):
        swing = (0.5 * feed / pi * (pi - before) + 0.5 * mean - end) / -sin(2.0 * before)
        rows.append((rule, end, swing))
    return Table(
        "radius r of the eccentric by (9) and (10) for S_0 = 30 mm; the text says half of the mean and prints 3.25 mm",
        {"end_feed": "", "feed_per_tooth": "mm", "radius": "mm"},
        rows,
    )


def stroke_lost(config: RigConfig) -> Table:
    """Share of the stroke without cutting, and depth that the teeth cut per turn, by formula (8) and by all teeth that passed."""
    radius, share = config.sash.radius, 0.5 * config.saw.pitch / config.sash.radius
    travel = (np.arange(FINE) + 0.5) / FINE * 2.0 * radius
    later = travel > config.saw.pitch
    rows = []
    for swing, feed in (*PRINTED, (0.0, 15.0), (config.saw.eccentric_radius / MM, 15.0)):
        by_8 = np.array([feed_per_tooth(y, feed * MM, swing * MM, radius, config.saw.pitch) for y in travel[later]])
        turns = np.arccos(1.0 - travel / radius)
        down = np.array([depth_of_cut(angle, feed * MM, swing * MM, share) for angle in turns])
        # on the way up, from the bottom
        first, second = (
            max(depth_of_cut(angle, feed * MM, swing * MM, share) for angle in np.linspace(a, b, FINE // 4)[1:-1])
            for a, b in ((pi, 1.5 * pi), (1.5 * pi, 2.0 * pi))
        )
        rows.append(
            (
                swing * MM,
                feed * MM,
                float((by_8 <= 0.0).mean()),
                float(np.maximum(by_8, 0.0).sum()) / FINE / share,
                float((down <= 0.0).mean()),
                float(np.maximum(down, 0.0).mean()) / share,
                float(down.max()),
                floor(100.0 * float(down.max()) / MM) / 100.0 * MM,
                max(first, 0.0),
                max(second, 0.0),
            )
        )
    return Table(
        "share of the working stroke in which the teeth do not cut, and depth that they cut per turn, by (8) from y = t_3 on "
        "and by all teeth; thickest chip, also with all digits after the second cut off; deepest scraping in the first and second "
        "half of the idle stroke",
        {
            "radius": "mm",
            "feed": "mm",
            "lost_by_8": "%",
            "removed_by_8": "mm",
            "lost": "%",
            "removed": "mm",
            "thickest": "mm",
            "thickest_cut_off": "mm",
            "scraping_first": "mm",
            "scraping_second": "mm",
        },
        rows,
    )


def over_stroke(config: RigConfig) -> Table:
    """Feed per tooth over the stroke by formula (8) and by all teeth that passed, with the rig's eccentric and without."""
    radius, pitch = config.sash.radius, config.saw.pitch
    rows = []
    for k in range(1, 361):
        angle = min(k / 360.0 * pi, pi - 1e-9)
        y = radius * (1.0 - cos(angle))
        cells = [
            value
            for swing in (0.0, config.saw.eccentric_radius)
            for value in (
                feed_per_tooth(y, 30 * MM, swing, radius, pitch) if y >= pitch else None,
                depth_of_cut(angle, 30 * MM, swing, 0.5 * pitch / radius),
            )
        ]
        rows.append((y, *cells))
    return Table(
        "feed per tooth at S_0 = 30 mm by (8) and by all teeth that passed, without and with the eccentric of the rig",
        {"y": "mm", "without_by_8": "mm", "without": "mm", "swing_by_8": "mm", "swing": "mm"},
        rows,
    )


def tooth_path(config: RigConfig) -> Table:
    """Path of a tooth in the kerf over a turn, and that of its upper neighbour, by (1) to (7)."""
    radius, pitch, feed = config.sash.radius, config.saw.pitch, 30 * MM
    rows = []
    for k in range(361):
        angle = k * pi / 180.0
        y = radius * (1.0 - cos(angle))
        cells = [0.5 * feed * angle / pi - swing * sin(2.0 * angle) for swing in (0.0, config.saw.eccentric_radius)]
        rows.append((angle, y, *cells, y - pitch, *(x + 0.5 * pitch * feed / (2.0 * radius) for x in cells)))
    return Table(
        "path of a tooth against a log that is fed by S_0 = 30 mm per turn: travel y downwards, x into the wood, without and with "
        "the eccentric, by (4); the tooth above is further forward by the overhang (6)",
        {"angle": "deg", "y": "mm", "without": "mm", "swing": "mm", "y_above": "mm", "without_above": "mm", "swing_above": "mm"},
        rows,
    )


def cutting_angle(_config: RigConfig) -> Table:
    """Cutting angle of the blades by their clearance angle, at a constant sharpness angle of the tooth."""
    sharpness = 65.0 - 18.0
    return Table(
        "cutting angle = sharpness + clearance; the sharpness is that of 65 deg at 18 deg (paper p. 2)",
        {"clearance": "deg", "sharpness": "deg", "cutting_angle": "deg"},
        [(a * pi / 180.0, sharpness * pi / 180.0, (sharpness + a) * pi / 180.0) for a in (18.0, 28.0)],
    )


def feed_steps(_config: RigConfig) -> Table:
    """Ratio of the feeds per turn in table 1."""
    feeds = [feed for _, feed in PRINTED][1:]
    return Table(
        "ratio of the feeds per turn in the rows of table 1 with r = 3.25 mm",
        {"rows": "", "ratio": "-"},
        [("second over third", feeds[0] / feeds[1]), ("third over fourth", feeds[1] / feeds[2])],
    )


def motor_power(_config: RigConfig) -> Table:
    """Power of the motor by the printed numbers: 45 kW, times the output, times the energy that remains after a saving of 37 %."""
    rows = []
    for case, output, left in (
        ("R63-7 as tested", 1.5, 1.0 - SAVED),
        ("new frame, least", 2.0, 1.0 - SAVED),
        ("new frame, most", 2.2, 1.0 - SAVED),
        ("without the saving, least", 2.0, 1.0),
        ("without the saving, most", 2.2, 1.0),
    ):
        power = RATED[0] * output * left
        rows.append((case, output, left, power, *(float(rated / RATED[0] / left) for rated in RATED)))
    return Table(
        "power for an output, if the frame without swing takes all its 45 kW, and the outputs that 45, 65 and 75 kW would give",
        {"case": "", "output": "-", "energy": "%", "power": "kW", "with_45": "-", "with_65": "-", "with_75": "-"},
        rows,
    )


def sawing_power(config: RigConfig) -> Table:
    """Mean power of the teeth and of the motor at a constant speed of the crank, for the frame without swing and with it."""
    saw, speed, rows = config.saw, crank_speed(config), []
    angles = (np.arange(4 * FINE) + 0.5) / (4 * FINE) * 2.0 * pi
    bearings = config.bearings.drag * speed**2
    for frame, swing, pressure, output in (
        ("without swing", 0.0, OLD_PRESSURE, 1.0),
        ("with swing", saw.eccentric_radius, saw.cutting_pressure, 1.0),
        ("with swing", saw.eccentric_radius, saw.cutting_pressure, 2.0),
        ("with swing", saw.eccentric_radius, saw.cutting_pressure, 2.1),
        ("with swing", saw.eccentric_radius, saw.cutting_pressure, 2.2),
    ):
        feed = output * OLD_FEED
        torque = np.array([teeth_torque(config, angle, feed, swing, pressure) for angle in angles])
        work, back = torque.mean() * speed, torque[angles > pi].sum() / torque.sum()
        wood = feed * 0.5 * speed / pi * saw.kerf * saw.blades * saw.height
        rows.append((frame, output, feed, work, float(back), bearings, work + bearings, work / wood))
    return Table(
        "mean power at a constant speed: of the teeth, share of it on the way up, of the bearings, of the motor; energy per volume "
        "of sawdust",
        {
            "frame": "",
            "output": "-",
            "feed": "mm",
            "teeth": "kW",
            "scraping": "%",
            "bearings": "kW",
            "motor": "kW",
            "energy": "MPa",
        },
        rows,
    )


def older_motors(config: RigConfig) -> Table:
    """Motors before the growth that the paper names, and the output that they gave to the frame without swing.

    The output is the feed that takes all of the motor's power, at the speed of the crank without a load, divided by OLD_FEED.
    """
    speed, angles = crank_speed(config), (np.arange(FINE) + 0.5) / FINE * 2.0 * pi
    bearings = config.bearings.drag * speed**2

    def motor(feed: float) -> float:
        return float(np.mean([teeth_torque(config, angle, feed, 0.0, OLD_PRESSURE) for angle in angles])) * speed + bearings

    rows = []
    for growth in GROWTH:
        power = RATED[0] / growth
        output = brentq(lambda feed, power=power: motor(feed) - power, 0.01 * OLD_FEED, OLD_FEED) / OLD_FEED
        rows.append((growth, power, output, 1.0 / output, *(rated / RATED[0] for rated in RATED[1:])))
    return Table(
        "motor before a growth to 45 kW, output of the frame without swing with it, growth of that output, and the growth from 45 "
        "to 65 and 75 kW",
        {"growth": "-", "motor": "kW", "output": "-", "output_growth": "-", "to_65": "-", "to_75": "-"},
        rows,
    )


def energy_saved(config: RigConfig) -> Table:
    """Share of the teeth's energy that the swing saves, and the part of it that is due to thicker chips and less scraping."""
    rows = sawing_power(config).rows
    old, new = rows[0], rows[2]
    saw, speed = config.saw, crank_speed(config)
    angles = (np.arange(4 * FINE) + 0.5) / (4 * FINE) * 2.0 * pi
    torque = np.mean([teeth_torque(config, angle, 2.0 * OLD_FEED, saw.eccentric_radius, OLD_PRESSURE) for angle in angles])
    wood = 2.0 * OLD_FEED * 0.5 * speed / pi * saw.kerf * saw.blades * saw.height
    same_wood = float(torque) * speed / wood
    return Table(
        "saving of the teeth's energy per volume with swing at twice the feed, against the frame without swing (printed 37 %)",
        {"what": "", "saved": "%"},
        [
            ("in all", 1.0 - new[-1] / old[-1]),
            ("by thicker chips and less scraping", 1.0 - same_wood / old[-1]),
            ("by the cutting pressure, which stands for the sharper angle of 65 deg and all else", (same_wood - new[-1]) / old[-1]),
        ],
    )


def balance(config: RigConfig) -> Table:
    """Largest inertia forces on the frame over a turn by the counterweight, and their share of the forces without one."""
    sash, speed = config.sash, crank_speed(config)
    angles = np.linspace(0.0, 2.0 * pi, 2881)
    rows = []
    for rod in dict.fromkeys((sash.rod_ratio, 0.2)):
        along = np.array([-sash.mass * motion(angle, sash.radius, rod)[2] * speed**2 for angle in angles])
        turning = sash.mass * sash.radius * speed**2
        for share in dict.fromkeys((0.0, 0.25, sash.counterweight / sash.mass, 0.5, 0.75, 1.0)):
            down, across = along + share * turning * np.cos(angles), -share * turning * np.sin(angles)
            largest = float(np.hypot(down, across).max())
            rows.append(
                (
                    rod,
                    share,
                    float(np.abs(down).max()),
                    float(np.abs(across).max()),
                    largest,
                    float(np.abs(down).max() / np.abs(along).max()),
                    largest / float(np.abs(along).max()),
                )
            )
    return Table(
        "largest vertical, horizontal and whole force on the frame at the speed of the sequence demo, and shares of that without a "
        "counterweight; a rod_ratio of 0.2 has a force of the second order that no counterweight on the crank can balance",
        {
            "rod_ratio": "-",
            "counterweight": "%",
            "vertical": "kN",
            "horizontal": "kN",
            "whole": "kN",
            "vertical_left": "%",
            "whole_left": "%",
        },
        rows,
    )


def swing_forces(config: RigConfig) -> Table:
    """Inertia force and kinetic energy of the swing itself, which the rig neglects, beside those of the stroke."""
    sash, swing, speed = config.sash, config.saw.eccentric_radius, crank_speed(config)
    rows = [
        ("stroke", sash.mass * sash.radius * speed**2, 0.5 * sash.mass * (sash.radius * speed) ** 2),
        ("swing", sash.mass * swing * (2.0 * speed) ** 2, 0.5 * sash.mass * (2.0 * swing * speed) ** 2),
    ]
    return Table(
        "largest inertia force and kinetic energy of the sash by its stroke (1) and its swing (3), which turns twice as fast",
        {"motion": "", "force": "kN", "energy": "kJ"},
        rows,
    )


def over_turn(config: RigConfig) -> Table:
    """Speed and power over a turn at 2.1 times the old feed, by an integration that is independent of the rig's step."""
    angles, speed, motor, teeth = one_turn(config, 2.1 * OLD_FEED, stiff=False)
    return Table(
        "one turn in the steady state by scipy: speed of the crank, power of the motor and of the teeth",
        {"angle": "deg", "speed": "rpm", "motor": "kW", "teeth": "kW"},
        [tuple(map(float, row)) for row in zip(angles[::8], speed[::8], motor[::8], teeth[::8])],
    )


_RIPPLE = {
    "phase": "",
    "feed": "mm",
    "speed": "rpm",
    "ripple": "%",
    "motor": "kW",
    "motor_least": "kW",
    "motor_most": "kW",
    "teeth": "kW",
    "teeth_most": "kW",
    "output": "-",
}


def _ripple(phase: str, feed: float, t: np.ndarray, speed: np.ndarray, motor: np.ndarray, teeth: np.ndarray, whole: float) -> tuple:
    """One row with the columns of _RIPPLE, from a whole number of turns; ``whole`` is the speed without a load."""
    span = t[-1] - t[0]
    means = [float(np.trapezoid(one, t) / span) for one in (speed, motor, teeth)]
    return (
        phase,
        feed,
        means[0],
        float(np.ptp(speed)) / means[0],
        means[1],
        float(motor.min()),
        float(motor.max()),
        means[2],
        float(teeth.max()),
        feed * means[0] / (OLD_FEED * whole),
    )


def quasi_static(config: RigConfig) -> Table:
    """Speed and power in a steady turn by scipy with a stiff belt and a motor without delay, at the feeds of the demo."""
    return _steady(config, stiff=True)


def steady_turn(config: RigConfig) -> Table:
    """Speed and power in a steady turn by scipy with the belt and the motor's delay, at the feeds of the demo."""
    return _steady(config, stiff=False)


def _steady(config: RigConfig, stiff: bool) -> Table:
    rows = []
    for phase, feed in (("no log", 0.0), ("old feed", OLD_FEED), ("new feed", 2.1 * OLD_FEED)):
        try:
            angles, speed, motor, teeth = one_turn(config, feed, stiff)
        except NoSteadyTurn:
            rows.append((phase, feed, *(None for _ in list(_RIPPLE)[2:])))
            continue
        t = np.concatenate([[0.0], np.cumsum(np.diff(angles) * 0.5 * (1.0 / speed[1:] + 1.0 / speed[:-1]))])
        rows.append(_ripple(phase, feed, t, speed, motor, teeth, crank_speed(config)))
    text = "means, ripple (highest less lowest speed over the mean), extremes over a turn, by scipy; none where the saw slows down"
    return Table(text, _RIPPLE, rows)


def ripple(config: RigConfig, recording: Recorded) -> Table:
    """Speed and power over the last turns of each feed in a recording of the sequence demo."""
    t, feeds, speed = recording.t, recording["S_0"], recording["n_crank"]
    motor, teeth = recording["M_motor"] * recording["n_motor"], recording["M_saw"] * speed
    steps = np.round(feeds / (0.5 * MM))
    starts = np.concatenate([[0], np.flatnonzero(np.diff(steps)) + 1, [len(t)]])
    rows = []
    for first, last in pairwise(starts):
        if t[last - 1] - t[first] < 1.5 or len(rows) == 3:
            continue
        # the last whole turns, at most ten
        turned = np.cumsum(speed[first:last]) * (t[1] - t[0])
        turns = min(10, int((turned[-1] - turned[0]) / (2.0 * pi)))
        if turns < 1:
            continue
        begin = first + int(np.searchsorted(turned, turned[-1] - 2.0 * pi * turns))
        part = slice(begin, last)
        phase = ("no log", "old feed", "new feed")[len(rows)]
        feed = float(feeds[part].mean())
        rows.append(_ripple(phase, feed, t[part], speed[part], motor[part], teeth[part], crank_speed(config)))
    if len(rows) < 3:
        raise RigError("the recording does not have the three steady feeds: none, old and new; take one of the sequence demo")
    text = "means, ripple (highest less lowest speed over the mean) and extremes over the last turns of each feed"
    return Table(text, _RIPPLE, rows)


def forces(config: RigConfig, recording: Recorded) -> Table:
    """Largest inertia forces on the frame in a recording after the run-up."""
    steady = recording["n_crank"] > 0.9 * crank_speed(config)
    if not steady.any():
        raise RigError("the crank does not reach its speed in this recording")
    down, across = recording["F_along"][steady], recording["F_across"][steady]
    return Table(
        "largest vertical, horizontal and whole inertia force on the frame at speed",
        {"vertical": "kN", "horizontal": "kN", "whole": "kN"},
        [(float(np.abs(down).max()), float(np.abs(across).max()), float(np.hypot(down, across).max()))],
    )


CALCULATIONS = {
    "given": given,
    "feed_table": feed_table,
    "print_errors": print_errors,
    "stroke_ends": stroke_ends,
    "eccentric_turns": eccentric_turns,
    "eccentric_phase": eccentric_phase,
    "eccentric": eccentric,
    "stroke_lost": stroke_lost,
    "over_stroke": over_stroke,
    "tooth_path": tooth_path,
    "cutting_angle": cutting_angle,
    "feed_steps": feed_steps,
    "motor_power": motor_power,
    "sawing_power": sawing_power,
    "older_motors": older_motors,
    "energy_saved": energy_saved,
    "balance": balance,
    "swing_forces": swing_forces,
    "over_turn": over_turn,
    "quasi_static": quasi_static,
    "steady_turn": steady_turn,
    "ripple": ripple,
    "forces": forces,
}
