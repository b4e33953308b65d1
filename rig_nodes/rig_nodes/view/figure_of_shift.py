# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The figure of a shift: what happened, whether it was good, and why, in pressures, clutch torques, shaft torques and speeds.

``Run.plot``, `rig report --picture` and its page show it. Phases, results, verdict, causes and limits are those of the report.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..analysis import (
    FILL,
    INERTIA,
    INTERRUPTED,
    LEAST_TORQUE,
    MET,
    NO_SEQUENCE,
    NOT_FOUND,
    PRESSURE_MEAN,
    RPM,
    SWING,
    TIED,
    TORQUE,
    TORQUE_SPEED_MEAN,
    UNDECIDED,
    asked_of_input,
    bounds_of,
    every_metric,
    faults_at,
    lever_of,
    moments_of,
    odd_width,
    phases_of,
    running_mean,
    sentence_of_peak,
    shift_name,
    times_of,
    verdicts_in,
)
from ..rig import NEUTRAL, changed_settings
from .figure import (
    DASHED,
    DOTTED,
    SOLID,
    Column,
    Curve,
    Description,
    Hatch,
    Level,
    Moment,
    Number,
    Panel,
    Ring,
    Series,
    Stretch,
    cut,
)
from .palette import INPUT, OTHER, OUTPUT, SETTLING, clutch_colour
from .recorded import windows_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..rig import Clutch, Transmission
    from .pages import Pages

SIGNS = "①②③④⑤"
AROUND = 0.08, 0.15  # shares of the shift that are shown before its order and after its end
UNKNOWN = 1.5  # s shown after an order without an end
CLOSE = 3.0  # lengths from kiss point to lock-up that the close-up shows behind lock-up at most
LEAST_CLOSE = 0.15  # s
OVERSHOOT = 1.05  # of the full pressure, from which a peak is marked
MOST_CHANGED = 2  # changed settings that are named
LEVEL = 20e-3  # s over which a level is taken
NEAR = 2e-3  # share by which a curve may miss a result, from rounding
GRID = 0.05  # ms by which rounding may move a sample
MOST, SPARE = 12, 0.05  # shifts of a bag that are drawn, and s read on both sides of what a figure shows

INTERRUPTED_TOO = "t_p with interruption"
# results at the foot: key and words
NUMBERS = {
    "t_c_s": "order to lock-up t_c",
    "t_p_s": "change of speed t_p",
    "t_o_s": "settling t_o",
    "input_torque_high_nm": "input torque, highest",
    "input_torque_low_nm": "input torque, lowest",
    "output_speed_low_rpm": "output speed, lowest",
    "k": "speed kept k",
    "e_loss_j": "energy lost",
}


def figure_of_shift(
    report: Mapping, number: int, pages: Pages, signals: Mapping[str, Series], span: tuple[float, float], part: bool = False
) -> Description:
    """Return the figure of a shift, in ms after its order.

    Parameters
    ----------
    report : mapping
        Report of the run.
    number : int
        The shift, from 1 on.
    pages : Pages
        The pages of its rig.
    signals : mapping of str to Series
        The signals of the run, not necessarily all of the rig.
    span : (float, float)
        First and last time of the run [s].
    part : bool
        Whether the report is of a part of a run, whose numbers of shifts are not those of the run.

    Returns
    -------
    Description
        The figure; panels of which nothing was recorded are left out.
    """
    assert pages.box is not None
    return _Shift(report, number, pages, pages.box, signals, span, part).figure()


def figures_of_shifts(path: str, report: Mapping, pages: Pages, span: tuple[float, float]) -> list[Description]:
    """Return the figures of the first MOST shifts of a bag, which is read once; only the time around each shift is held.

    Parameters
    ----------
    path : str
        Folder of a run or its .mcap file; of a damaged one what is left is read.
    report : mapping
        Its report.
    pages : Pages
        The pages of its rig.
    span : (float, float)
        First and last time of the run [s].
    """
    if pages.box is None:
        return []
    drawn = [_Shift(report, number, pages, pages.box, {}, span) for number in range(1, min(len(report["shifts"]), MOST) + 1)]
    spans = [(one.window[0] - SPARE, one.window[1] + SPARE) for one in drawn]
    found = windows_of(path, pages, signals_of(pages.box), spans) if drawn else []
    return [replace(one, signals=signals).figure() for one, signals in zip(drawn, found)]


def signals_of(box: Transmission) -> list[str]:
    """Return the signals that the figures of a transmission's shifts show."""
    ends = [name for end in (box.input, box.output) for name in (end.torque, end.speed)]
    each = [(one.pressure, one.setpoint, *map(one.signal, ("torque", "capacity", "slip"))) for one in box.clutches]
    return [*ends, *(name for names in each for name in names)]


def stretches_of(row: Mapping, box: Transmission) -> list[Stretch]:
    """Return the phases of a shift in ms after its order, and the time in which its torque settles.

    Parameters
    ----------
    row : mapping
        Its row of the report.
    box : Transmission
        The transmission.
    """
    names = " and ".join(clutch.name for clutch in box.shift(row["from_gear"], row["to_gear"]).engaging)
    parts = [(one.name, one.start, one.end) for one in phases_of(row)]
    parts += [(SETTLING, one.start, one.end) for one in times_of(row) if one.name == "t_o"]
    found, lengths = [], _lengths_of(row)
    for kind, start, end in parts:
        ms, word = f"{lengths[kind]} ms", kind.removesuffix(" phase")
        whole = f"fill of {names}" if kind == FILL else f"{kind}: no clutch carries" if kind == INTERRUPTED else kind
        texts = (f"{whole} {ms}", f"{kind} {ms}", f"{word} {ms}", f"{word}\n{ms}", ms.removesuffix(" ms"))
        first, last = (1e3 * (t - row["t_order_s"]) for t in (start, end))
        found.append(Stretch(kind, texts, first, last))
    return found


def _lengths_of(row: Mapping) -> dict[str, int]:
    """Return the lengths of the phases [ms] as the table rounds its times; the torque phase, which that has not, is the rest."""
    keys = "kiss_s", "departure_s", "interrupted_s", "t_p_s", "t_c_s", "t_o_s"
    fill, departure, interrupted, t_p, t_c, t_o = (round(1e3 * (row.get(key) or 0.0)) for key in keys)
    if row.get("t_p_s") is not None:
        departure = t_c - t_p
    inertia = t_c - departure - interrupted
    return {FILL: fill, TORQUE: max(0, departure - fill), INTERRUPTED: interrupted, INERTIA: inertia, SETTLING: t_o}


def marks_of(row: Mapping, box: Transmission) -> list[Moment]:
    """Return the moments of a shift in ms after its order, as far as they were found, from the order to the settled torque."""
    new = " and ".join(clutch.name for clutch in box.shift(row["from_gear"], row["to_gear"]).engaging) or box.names[row["to_gear"]]
    old = "its speed" if row["from_gear"] == NEUTRAL else f"the speed of gear {box.names[row['from_gear']]}"
    words = {
        "order": "order",
        "kiss point": f"kiss point: {new} begins to carry",
        "departure": f"output leaves {old}",
        "lock-up": f"lock-up of {new}",
        "settled": "input torque settled",
    }
    ends = {one.name: one.end for one in times_of(row)}
    known = moments_of(row) | ({"settled": ends["t_o"]} if "t_o" in ends else {})
    found = [
        Moment(1e3 * (known[name] - row["t_order_s"]), sign, text)
        for sign, (name, text) in zip(SIGNS, words.items())
        if name in known
    ]
    return sorted(found, key=lambda one: one.t)  # as they stand in the strip


@dataclass(frozen=True)
class _Shift:
    report: Mapping
    number: int
    pages: Pages
    box: Transmission
    signals: Mapping[str, Series]
    span: tuple[float, float]
    part: bool = False

    def figure(self) -> Description:
        title, grade, sentence = self.heading()
        panels = (self.pressures(), self.clutch_torques(), self.shaft_torques(), self.speeds())
        return Description(
            title,
            self.conditions(),
            sentence,
            grade,
            self.columns,
            tuple(panel for panel in panels if panel.curves),
            tuple(stretches_of(self.row, self.box)),
            (*marks_of(self.row, self.box), *self.latest()),
            tuple(self.numbers()),
        )

    # ---- the shift

    @cached_property
    def row(self) -> Mapping:
        return self.report["shifts"][self.number - 1]

    @cached_property
    def moved(self) -> tuple[tuple[Clutch, ...], tuple[Clutch, ...]]:
        """Clutches that are released and engaged."""
        found = self.box.shift(self.row["from_gear"], self.row["to_gear"])
        return found.releasing, found.engaging

    @cached_property
    def end(self) -> float:
        """Time [ms] at which the torque has settled; without that, up to which its course is still that of the shift."""
        row, known = self.row, times_of(self.row)
        course = UNKNOWN if row.get("course_s") is None else row["course_s"]
        if known and row["t_o_s"] is None:
            return 1e3 * min(course, row["t_c_s"] + SWING)
        return 1e3 * max((one.end - row["t_order_s"] for one in known), default=course)

    @cached_property
    def window(self) -> tuple[float, float]:
        """Times [s] that the figure shows."""
        order = self.row["t_order_s"]
        later = [row["t_order_s"] for row in self.report["shifts"][self.number :]]
        first, last = order - AROUND[0] * self.end / 1e3, order + (1.0 + AROUND[1]) * self.end / 1e3
        return max(first, self.span[0]), min(last, self.span[1], *later)

    @cached_property
    def columns(self) -> tuple[Column, ...]:
        first, last = (float(self.ms(t)) for t in self.window)
        title = "time after the order [ms]"
        begun = [1e3 * since for key in ("kiss_s", "departure_s") if (since := self.row.get(key)) is not None]
        if not begun:
            return (Column(first, last, title),)
        start, locked = min(begun), self.row["t_c_s"]
        long = LEAST_CLOSE * 1e3 if locked is None else max(LEAST_CLOSE * 1e3, (1e3 * locked - start) * (1.0 + CLOSE))
        stop = min(self.end, start + long)
        room = AROUND[1] * (stop - start)
        return Column(first, last, title, 0.41), Column(
            max(first, start - room), min(last, stop + room), f"{title}, close-up", 0.59
        )

    @cached_property
    def bounds(self) -> dict[str, tuple[float | None, float | None]]:
        """Limits by the keys of their metrics and in their units: the user's own, in place of those of the verdict."""
        factors = {one.key: one.factor for one in every_metric()}
        own = {key: tuple(end and end / factors[key] for end in (one["low"], one["high"])) for key, one in self.given.items()}
        return {**bounds_of(self.row, self.box), **own}

    @cached_property
    def given(self) -> dict[str, Mapping]:
        """The verdicts on the user's own limits by the keys of the metrics."""
        place = shift_name(self.number, self.row, self.box)
        return {one["key"]: one for one in self.report.get("limits") or () if one["place"] == place}

    def ms(self, t: np.ndarray | float) -> np.ndarray:
        """Return times of the run [s] as ms after the order."""
        return (np.asarray(t) - self.row["t_order_s"]) * 1e3

    def colour(self, clutch: Clutch) -> str:
        return clutch_colour(self.box.clutches.index(clutch))

    def curve(self, name: str, text: str, colour: str, style: str = SOLID, short: str = "", mean: float = 0.0) -> Curve | None:
        """Return the curve of a signal, as the metrics see it: as the mean over ``mean`` seconds."""
        found = cut(self.signals, name, self.pages, self.window)
        if found is None:
            return None
        t, y = found
        if mean and len(t) > 1:
            y = running_mean(y, odd_width(mean, float(t[1] - t[0])))
        return Curve(name, text, short or name if text else "", colour, style, self.ms(t), y)

    def level(self, curve: Curve, last: float) -> float:
        """Return the mean of a curve over LEVEL up to a time [ms]; NaN when nothing is known there."""
        part = curve.y[(curve.t > last - LEVEL * 1e3) & (curve.t <= last)]
        return float(np.nanmean(part)) if np.isfinite(part).any() else math.nan

    # ---- words

    def heading(self) -> tuple[str, str, str]:
        row, box = self.row, self.box
        old, new = row["from_gear"], row["to_gear"]
        way = box.way(old, new, " → ")
        asked = asked_of_input(row, box)
        if old == NEUTRAL or new == NEUTRAL:
            title = f"Engagement of {box.names[new]} from neutral" if old == NEUTRAL else f"Release of {box.names[old]}"
        else:
            kind = "Change of direction" if box.turns_round(old, new) else "Upshift" if new > old else "Downshift"
            title = f"{kind} {way} {'without load' if asked is None else 'under load' if asked > 0.0 else 'in overrun'}"
        verdict = verdicts_in(self.report)[self.number - 1] or {}
        grade, reasons = verdict.get("grade") or "", verdict.get("reasons") or []
        missed = [one.name for one in self.numbers() if one.key in self.given and one.met is False]
        sentence = "; ".join(reasons)
        if grade and not reasons:
            judged = {"torque": "input_torque_high_nm", "speed": "k"}
            kept = " and ".join(word for word, key in judged.items() if key in self.bounds and not missed)
            sentence = f"gear {box.names[new]} was reached after {1e3 * row['t_c_s']:.0f} ms"
            sentence += f", and {kept} kept within the limits" if kept else ""
        parts = [sentence, f"outside the limits that were given: {', '.join(missed)}" if missed else "", sentence_of_peak(row)]
        parts += [f"not valid: {'; '.join(row['why'])}"] if row["why"] else []
        return title, grade, " ".join(f"{one[0].upper()}{one[1:]}." for one in parts if one)

    def conditions(self) -> str:
        row, run = self.row, self.report["run"]
        record = run.get("configuration") or {}
        state = [record.get("name") or (self.report.get("basis") or {}).get("rig")]
        state += [f"{row['input_speed_rpm']:.0f} rpm"] if row["input_speed_rpm"] is not None else []
        state += [f"{row['output_torque_nm']:z.0f} Nm at the output"] if row["output_torque_nm"] is not None else []
        oil = (row.get("at_order") or {}).get("oil_degc")
        state += [f"oil {oil:.0f} °C"] if oil is not None else []
        set_ = [f"controller {run['controller']['name']}"] if run.get("controller") else []
        changed = changed_settings(record)[0] if record else []
        set_ += [f"{name} {value}" for name, _, value in changed[:MOST_CHANGED]]
        set_ += [f"{len(changed) - MOST_CHANGED} more settings changed"] if len(changed) > MOST_CHANGED else []
        set_ += [f"{name} {value}" for name, value in (row.get("loops") or {}).items()]
        ill = faults_at(run.get("faults") or (), row["t_order_s"], row["t_order_s"] + 1e-3 * self.end)
        set_ += [f"fault {name}" for name in ill[:MOST_CHANGED]]
        set_ += [f"{len(ill) - MOST_CHANGED} more faults"] if len(ill) > MOST_CHANGED else []
        how = {"simulate": "simulated", "import": "imported"}.get(run.get("mode") or "", "")
        named = run.get("sequence") or ""
        of = ", ordered by hand" if named == NO_SEQUENCE else named and f" of {named}"
        origin = [f"{'' if self.part else f'shift {self.number} '}at {row['t_order_s']:.3f} s{of}", how]
        origin += [f"seed {run['seed']}"] if run.get("seed") is not None else []
        return " · ".join(", ".join(str(one) for one in part if one) for part in (state, set_, origin) if part)

    def latest(self) -> list[Moment]:
        """Return the times until which lock-up is good, and until which the torque must have settled after it."""
        found, locked = [], self.row["t_c_s"]
        for key, name, start in (("t_c_s", "t_c", 0.0), ("t_o_s", "t_o", locked)) if times_of(self.row) else ():
            if (last := self.bounds.get(key, (None, None))[1]) is not None:
                found.append(Moment(1e3 * (start + last), "", f"{name} ≤ {1e3 * last:.0f} ms", True))
        return found

    def numbers(self) -> list[Number]:
        errors = self.report.get("uncertainty") or []
        own = errors[self.number - 1] if len(errors) >= self.number else {}
        found = []
        for metric in every_metric():
            value, judged = self.row.get(metric.key), self.given.get(metric.key)
            if judged is None and (value is None or metric.key not in NUMBERS):
                continue
            unit = "" if metric.unit == "-" else f" {metric.shown_unit}"
            low, high = self.bounds.get(metric.key, (None, None))
            met = None
            if judged is not None:
                met = None if judged["verdict"] == UNDECIDED else judged["verdict"] == MET
            elif (low, high) != (None, None):
                met = (low is None or value >= low) and (high is None or value <= high)
            ends = (("≥", low), ("≤", high))
            limit = " and ".join(f"{sign} {round(end * metric.factor, metric.digits):g}" for sign, end in ends if end is not None)
            name = NUMBERS.get(metric.key, metric.named(self.box))
            if metric.key == "t_p_s" and self.row.get("interrupted_s"):
                name = INTERRUPTED_TOO  # the strip shows both, each for itself
            found.append(Number(metric.key, name, NOT_FOUND if value is None else metric.cell(self.row, own) + unit, limit, met))
        return sorted(found, key=lambda one: list(NUMBERS).index(one.key) if one.key in NUMBERS else len(NUMBERS))

    # ---- panels

    def pressures(self) -> Panel:
        curves, dashed, note = [], [], ""
        for clutch, way in self.roles():
            pressure = self.curve(
                clutch.pressure,
                f"{clutch.pressure}, {way} {clutch.name}",
                self.colour(clutch),
                short=clutch.pressure,
                mean=PRESSURE_MEAN,
            )
            if pressure is None:
                continue
            curves.append(pressure)
        commands = self.commands()
        if scale := self.current_scale(curves, commands):
            current, share = scale
            note = f"dashed: command\n{current:.0f} mA = {current * share:.2f} MPa"
            dashed = [Curve(one.signal, "", "", one.colour, DASHED, one.t, one.y * share) for one in commands.values()]
        full = max((self.level(one, 0.0) for one in curves), default=math.nan)
        rings = [peak for one in curves if (peak := self.overshoot(one, full))] if all(self.moved) else []
        return Panel("pressure", "MPa", (*curves, *dashed), tuple(rings), note=note)

    def roles(self) -> list[tuple[Clutch, str]]:
        old, new = self.moved
        return [*((one, "off-going clutch") for one in old), *((one, "on-coming clutch") for one in new)]

    def commands(self) -> dict[str, Curve]:
        """Commands of the moved clutches by the signal of their pressure, in mA."""
        found = {}
        for clutch, _ in self.roles():
            if (one := self.curve(clutch.setpoint, "", self.colour(clutch), DASHED)) is not None:
                found[clutch.pressure] = one
        return found

    def current_scale(self, pressures: Sequence[Curve], commands: Mapping[str, Curve]) -> tuple[float, float] | None:
        """Return a full command [mA], and the factor by which it is drawn as the pressure that it gives [MPa/mA]."""
        last = float(self.ms(self.window[1]))
        for at in (0.0, min(self.end, last)):
            known = [(self.level(commands[one.signal], at), self.level(one, at)) for one in pressures if one.signal in commands]
            known = [(current, pressure) for current, pressure in known if current > 1.0 and pressure > 0.1]
            if known:
                current, pressure = max(known)
                return current, pressure / current
        return None

    def overshoot(self, curve: Curve, full: float) -> Ring | None:
        """Return the peak of a pressure above the one that a clutch had before the order, and above its own in the end."""
        inside = np.flatnonzero((curve.t >= 0.0) & (curve.t <= self.end) & np.isfinite(curve.y))
        if not len(inside):
            return None
        at = inside[int(np.argmax(curve.y[inside]))]
        if not curve.y[at] > OVERSHOOT * np.fmax(full, self.level(curve, self.end)):
            return None
        return Ring(float(curve.t[at]), float(curve.y[at]), f"{curve.signal} overshoots to {curve.y[at]:.2f} MPa", curve.colour)

    def clutch_torques(self) -> Panel:
        """Return what the clutches carry, reduced to the input shaft; with the losses it is the input torque."""
        carried, limits = {}, []
        sign = math.copysign(1.0, asked_of_input(self.row, self.box) or 1.0)
        for clutch, _ in self.roles():
            own = self.curve(clutch.signal("torque"), f"carried by {clutch.name}", self.colour(clutch), short=clutch.name)
            if own is None or (lever := self.lever(clutch)) is None:
                continue
            carried[clutch.name] = replace(own, y=lever * own.y)
            if (could := self.curve(clutch.signal("capacity"), "", self.colour(clutch), DOTTED)) is not None:
                limits.append(replace(could, y=sign * abs(lever) * could.y, scales=False))
        hatches = [hatch for clutch, _ in self.roles() if clutch.name in carried for hatch in self.braking(clutch, carried)]
        note = "at the input shaft\ndotted: capacity" if limits else "at the input shaft"
        return Panel("clutch torque", "Nm", (*carried.values(), *limits), hatches=tuple(hatches), note=note)

    def lever(self, clutch: Clutch) -> float | None:
        """Return the factor from a clutch's torque to that at the input shaft; None without a recorded slip."""
        names = (clutch.signal("slip"), self.box.input.speed, self.box.output.speed)
        found = [cut(self.signals, name, self.pages, self.window) for name in names]
        ratio = self.box.ratios.get(self.row["from_gear" if clutch in self.moved[0] else "to_gear"])
        if ratio is None or None in found:
            return None
        (t, slip), *shafts = (one for one in found if one is not None)
        w_in, w_out = (np.interp(t, *one) for one in shafts)
        return lever_of(slip / RPM, (w_in - ratio * w_out) / RPM)

    def braking(self, clutch: Clutch, carried: Mapping[str, Curve]) -> list[Hatch]:
        """Return where a clutch brakes against the load; a little of it by the clutch that is released is no tie-up."""
        asked, own = asked_of_input(self.row, self.box), carried[clutch.name]
        if asked is None or self.box.turns_round(self.row["from_gear"], self.row["to_gear"]):
            return []
        sign = math.copysign(1.0, asked)
        against = (sign * own.y < -LEAST_TORQUE) & (own.t > 0.0) & (own.t <= self.end)
        if not against.any():
            return []
        first, last = np.flatnonzero(against)[[0, -1]]
        part = slice(max(0, first - 1), last + 2)
        at = int(np.argmin(sign * own.y[part]))
        t, worst = own.t[part][at], own.y[part][at]
        tied = [np.interp(t, one.t, one.y) for other in self.moved[1] if (one := carried.get(other.name))]
        released = clutch in self.moved[0]
        if released and tied and abs(worst) < TIED * max(map(abs, tied)):
            return []
        word = f"tie-up: {clutch.name} still brakes" if released else f"{clutch.name} brakes"
        most = f"{abs(worst):.0f} Nm"
        texts = f"{word} with up to {most}", f"{clutch.name} brakes, {most}"
        return [Hatch(own.t[part], np.where(sign * own.y[part] < 0.0, own.y[part], 0.0), *texts)]

    def shafts(self, what: str) -> list[Curve | None]:
        """Return the speeds or the torques of both shafts."""
        names = zip(self.pages.shafts(what), ("input", "output"), (INPUT, OUTPUT))
        return [self.curve(name, f"{name} {word}", colour, short=name, mean=TORQUE_SPEED_MEAN) for name, word, colour in names]

    def shaft_torques(self) -> Panel:
        box, row = self.box, self.row
        curves = self.shafts("torque")
        rings, levels = [], []
        asked = asked_of_input(row, box)
        if asked is not None and box.changes(row["from_gear"], row["to_gear"]):
            levels.append(Level(asked, f"the load asks {asked:.0f} Nm of the input", False, f"load {asked:.0f} Nm"))
            ratio = (verdicts_in(self.report)[self.number - 1] or {}).get("peak_ratio")
        else:
            ratio = None
        for key, side in (("input_torque_high_nm", 1), ("input_torque_low_nm", 0)):
            value, word = row.get(key), "highest" if side else "lowest"
            if value is None or curves[0] is None:
                continue
            times = f" = {ratio:.1f} \u00d7 load" if side and ratio is not None else ""
            rings.append(self.ring(curves[0], row.get("t_high_s" if side else "t_low_s"), value, f"{word} {value:z.0f} Nm{times}"))
            levels += [Level(limit, f"limit {limit:.0f} Nm") for limit in self.bounds.get(key, ()) if limit is not None]
        return Panel("shaft torque", "Nm", tuple(one for one in curves if one), tuple(one for one in rings if one), tuple(levels))

    def ring(self, curve: Curve, since: float | None, value: float, text: str, last: float | None = None) -> Ring | None:
        """Return the mark of a result on its curve: at its time [s] after the order, or where the curve reaches it until ``last``.

        A result of the course behind what is shown has none.
        """
        if since is None:
            end = last or self.row.get("course_s") or 1e-3 * self.end
            inside = np.flatnonzero((curve.t >= -GRID) & (curve.t <= 1e3 * end + GRID) & np.isfinite(curve.y))
            if not len(inside):
                return None
            at = inside[int(np.argmin(np.abs(np.abs(curve.y[inside]) - abs(value))))]
            if abs(abs(curve.y[at]) - abs(value)) > NEAR * max(abs(value), 1.0):
                return None
            since, value = 1e-3 * float(curve.t[at]), float(curve.y[at])
        return Ring(1e3 * since, value, text, curve.colour) if 1e3 * since <= curve.t[-1] else None

    def speeds(self) -> Panel:
        box, row = self.box, self.row
        shafts = self.shafts("speed")
        curves, rings, levels = [one for one in shafts if one], [], []
        if shafts[0] is not None:
            for gear, clutches in zip((row["from_gear"], row["to_gear"]), self.moved):
                if gear in box.ratios:
                    colour = self.colour(clutches[0]) if clutches else OTHER
                    text = f"gear {box.names[gear]}"
                    curves.append(Curve(shafts[0].signal, text, text, colour, DOTTED, shafts[0].t, shafts[0].y / box.ratios[gear]))
        lowest, least = row.get("output_speed_low_rpm"), row.get("output_speed_min_rpm")
        if lowest is not None and shafts[1] is not None:
            kept = "" if row["k"] is None else f"k = {row['k']:z.3f}"
            both = kept and least is not None and abs(least - lowest) < 0.5
            rings.append(self.ring(shafts[1], None, lowest, f"lowest {lowest:z.0f} rpm{f', {kept}' if both else ''}"))
            if kept and least is not None and not both:  # that of k is the one before lock-up
                rings.append(self.ring(shafts[1], None, least, f"{kept} by {least:z.0f} rpm", row["t_c_s"]))
            low = self.bounds.get("output_speed_low_rpm", (None, None))[0]
            if low is not None and low > lowest:
                levels.append(Level(low, f"limit {low:.0f} rpm"))
        return Panel("speed", "rpm", tuple(curves), tuple(one for one in rings if one), tuple(levels))
