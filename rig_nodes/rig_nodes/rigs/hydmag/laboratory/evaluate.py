# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The judgement of one target on the rig's records: value, accepted ends, verdict, and where the worst value stands.

Used by rigs.hydmag.laboratory.programme and the verb ``validate``. The head of targets.yaml describes each kind. Nothing is added
here to a row's tolerance, and both ends count as inside.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from rig_nodes.base import UNITS, RigError
from rig_nodes.studies import INSIDE, NOT_COMPARED, OUTSIDE, Judged, Row, Span, Target

from .records import Record, canonical, group, missing, place_text, select

if TYPE_CHECKING:
    from rig_nodes.base import Floats

# variable of a curve -> condition of a record
VARIABLES = {"t": "time", "p_z": "pressure", "n_wej": "n_wej", "s": "s"}
# variables that one test runs through; fits and trends over them are judged for each test by itself
WITHIN_A_TEST = ("time", "pressure")
COVER = 0.05  # share of a curve's span that may lack points, at either end


def evaluate(target: Target, records: list[Record]) -> Row:
    """Judge a target on the records there are; the rig's behaviour never makes this raise an error.

    A value that is outside makes the row outside even where others are missing; a row is inside only when nothing is
    missing. Rows for information get their value but no verdict.

    Parameters
    ----------
    target : Target
        The target.
    records : list of Record
        The rig's records.

    Returns
    -------
    Row
        The target with the rig's answer.
    """
    judged, lacking = _JUDGES[target.kind](target, records)
    found = [one for one in judged if one.inside is not None]
    unknown = [one for one in judged if one.inside is None]
    inside = sum(one.inside for one in found)
    worst = min(found, key=lambda one: (one.inside, one.margin), default=None)
    reason = ""
    if target.inside == "most" and not lacking and 2 * inside > len(judged):
        verdict = INSIDE  # whatever the unknown values are
    elif target.inside == "most" and not lacking and found and 2 * (inside + len(unknown)) <= len(judged):
        verdict = OUTSIDE
    elif target.inside == "most":
        verdict, reason = NOT_COMPARED, _why_not(target, unknown, lacking)
    elif inside < len(found):
        verdict = OUTSIDE
    elif found and not unknown and not lacking:
        verdict = INSIDE
    else:
        verdict = NOT_COMPARED
        reason = _why_not(target, unknown, lacking)
    if target.role == "information":
        verdict, reason = NOT_COMPARED, f"for information: {target.why}"
    if worst is None:
        return Row(target, verdict, low=target.low, high=target.high, reason=reason, every=tuple(judged))
    return Row(
        target,
        verdict,
        worst.value,
        worst.low,
        worst.high,
        _telling(target, worst, judged),
        worst.judged_by,
        reason,
        len(found),
        inside,
        tuple(judged),
        place_text(_telling(target, worst, judged)),
    )


def _telling(target: Target, worst: Judged, judged: list[Judged]) -> dict:
    """Return the part of a place that distinguishes it from the others."""
    return {
        name: value
        for name, value in worst.place.items()
        if name == target.over or any(one.place.get(name) != value for one in judged)
    }


def _why_not(target: Target, unknown: list[Judged], lacking: list[str]) -> str:
    if unknown:
        more = f" (and {len(unknown) - 1} more)" if len(unknown) > 1 else ""
        at = place_text(unknown[0].place)
        return f"{target.quantity}{' at ' + at if at else ''}: {unknown[0].reason}{more}"
    return f"no record for {'; '.join(lacking[:3])}" + (f" (and {len(lacking) - 3} more)" if len(lacking) > 3 else "")


# --- numbers --------------------------------------------------------------------------------------


class _Missing(Exception):
    """A value that a judgement needs is missing; the text names it."""


def _number(record: Record, quantity: str) -> float:
    value = record.values[quantity]
    if value is None:
        raise _Missing(record.why.get(quantity, "was not found"))
    if not math.isfinite(value):
        raise _Missing("is not a finite number")
    return float(value)


def _is_number(record: Record, quantity: str) -> bool:
    return not isinstance(record.values[quantity], (str, bool))


def _spread(values: Sequence[float]) -> float:
    return max(values) - min(values)


def _spread_share(values: Sequence[float]) -> float:
    if min(values) == 0.0:
        raise _Missing("the lowest value is 0, so there is no share of it")
    return _spread(values) / min(values)


_STATISTICS: dict[str, Callable] = {
    "mean": lambda values: math.fsum(values) / len(values),
    "lowest": min,
    "highest": max,
    "spread": _spread,
    "spread_share": _spread_share,
}


def _stated(target: Target, key: str) -> str:
    """Return the word under a key that the target's kind needs."""
    word = getattr(target, key)
    if word is None:
        raise RigError(f"row {target.id} of the targets has no {key}")
    return word


def _statistic(target: Target, records: list[Record]) -> float:
    values = [_number(r, target.quantity) for r in records]
    if target.statistic in ("spread", "spread_share") and len(values) < 2:
        raise _Missing("a single value has no spread")
    return _STATISTICS[_stated(target, "statistic")](values)


def _numbers(target: Target, records: list[Record], conditions: dict[str, tuple | Span], named: Iterable[str] = ()) -> list[Record]:
    found = select(records, target.procedure, target.quantity, conditions, (*target.fixed, *named))
    return [r for r in found if _is_number(r, target.quantity)]


def _single(target: Target) -> set[str]:
    """Return the conditions that the row fixes to one value, so that a place need not name them."""
    return {
        name for name, wanted in target.conditions.items() if isinstance(wanted, tuple) and len(wanted) == 1 and wanted[0] != "all"
    }


def _varying(target: Target, record: Record) -> dict:
    return {name: value for name, value in record.conditions.items() if name not in _single(target)}


def _within(value: float, low: float | None, high: float | None, place: dict, judged_by: str = "") -> Judged:
    margins = [value - low] if low is not None else []
    margins += [high - value] if high is not None else []
    margin = min(margins)
    return Judged(value, margin >= 0.0, place, low, high, margin, judged_by)


def _unknown(place: dict, reason: object) -> Judged:
    return Judged(None, None, place, reason=str(reason))


def _values(target: Target, found: list[Record]) -> list[tuple[dict, Callable[[], float]]]:
    """Return (place, function that returns the number or raises _Missing) for each single value or statistic."""
    if not target.statistic:
        return [(_varying(target, r), lambda r=r: _number(r, target.quantity)) for r in found]
    names = [n for n in dict.fromkeys((*target.fixed, *target.conditions)) if n not in target.across]
    out = []
    for key, members in group(found, names):
        place = {n: v for n, v in key.items() if n not in _single(target)}
        out.append((place, lambda members=members: _statistic(target, members)))
    return out


def _judge_value(target: Target, records: list[Record]) -> tuple[list[Judged], list[str]]:
    """Judge the kinds value, range, upper and lower: each number lies between low and high."""
    found = _numbers(target, records, target.conditions, target.across)
    judged = []
    for place, number in _values(target, found):
        try:
            judged.append(_within(number(), target.low, target.high, place, target.statistic or ""))
        except _Missing as reason:
            judged.append(_unknown(place, reason))
    return judged, missing(found, target.procedure, target.conditions)


def _judge_pair(target: Target, records: list[Record]) -> tuple[list[Judged], list[str]]:
    """Judge differences and ratios: every number under `of` with every one under `to` that agrees in the row's other conditions."""
    own = {*target.of, *target.to, *target.across}
    names = [n for n in dict.fromkeys((*target.conditions, *target.fixed)) if n not in own]
    sides, lacking = [], []
    for side in (target.of, target.to):
        conditions = {**target.conditions, **side}
        found = _numbers(target, records, conditions)
        lacking += missing(found, target.procedure, conditions)
        sides.append({tuple(map(canonical, key.values())): (key, members) for key, members in group(found, names)})
    judged = []
    for key in [key for key in sides[0] if key in sides[1]]:
        (common, of_records), (_, to_records) = (side[key] for side in sides)
        judged += _pairs(target, common, of_records, to_records)
    if not judged and not lacking:
        lacking = ["the same conditions on both sides"]
    return judged, lacking


def _pairs(target: Target, common: dict, of_records: list[Record], to_records: list[Record]) -> list[Judged]:
    def numbers(records: list[Record], side: dict) -> list[tuple[dict, Callable[[], float]]]:
        if target.statistic:
            names = [n for n in side if n not in target.across]
            return [(key, lambda m=m: _statistic(target, m)) for key, m in group(records, names)]
        return [(r.conditions, lambda r=r: _number(r, target.quantity)) for r in records]

    judged = []
    named = tuple(dict.fromkeys((*target.of, *target.to)))
    for (of_place, of_number), (to_place, to_number) in product(numbers(of_records, target.of), numbers(to_records, target.to)):
        place = {n: v for n, v in common.items() if n not in _single(target)}
        place.update({n: (of_place[n], to_place[n]) for n in named if n in of_place and n in to_place})
        try:
            of_value, to_value = of_number(), to_number()
            if target.kind == "ratio":
                if to_value == 0.0:
                    raise _Missing("is 0 in the denominator")
                value = of_value / to_value
            else:
                value = of_value - to_value
            value = abs(value) if target.absolute else value
            judged.append(_within(value, target.low, target.high, place, target.statistic or ""))
        except _Missing as reason:
            judged.append(_unknown(place, reason))
    return judged


# --- over a condition -----------------------------------------------------------------------------


def _lines(
    target: Target, records: list[Record], variable: str
) -> tuple[list[tuple[dict, list[tuple[float, list[Record]]]]], list[str]]:
    """Return (place, [(x, records at x)]) with rising x for each line that is judged by itself, and what is missing.

    A variable within a test makes each test a line; otherwise the conditions in `fixed` do.
    """
    found = _numbers(target, records, target.conditions, (variable, *target.across))
    lines = []
    if variable in WITHIN_A_TEST:
        tests: dict[tuple, list[Record]] = {}
        for r in found:
            tests.setdefault(tuple(sorted((n, v) for n, v in r.conditions.items() if n != variable)), []).append(r)
        groups = [({n: v for n, v in _varying(target, m[0]).items() if n != variable}, m) for m in tests.values()]
    else:
        groups = group(found, target.fixed)
    for place, members in groups:
        points = sorted(((key[variable], same) for key, same in group(members, [variable])), key=lambda p: p[0])
        lines.append((place, points))
    return lines, missing(found, target.procedure, target.conditions)


def _at(target: Target, records: list[Record]) -> float:
    """Return the number at one x: the statistic, or the mean of what was tested there."""
    if target.statistic:
        return _statistic(target, records)
    return math.fsum(_number(r, target.quantity) for r in records) / len(records)


def _judge_trend(target: Target, records: list[Record]) -> tuple[list[Judged], list[str]]:
    lines, lacking = _lines(target, records, target.over)
    judged = []
    for place, points in lines:
        if len(points) < 2:
            continue  # one value has no trend, whatever the other lines show
        try:
            xs, ys = [x for x, _ in points], [_at(target, same) for _, same in points]
        except _Missing as reason:
            judged.append(_unknown(place, reason))
            continue
        judged.append(_flat(target, place, xs, ys) if target.sign == "flat" else _monotone(target, place, xs, ys))
    if not judged and not lacking:
        lacking = [f"two values over {target.over}"]
    return judged, lacking


def _tolerance(target: Target, ys: list[float]) -> float:
    tolerance = target.tolerance or 0.0
    return tolerance * min(map(abs, ys)) if target.tolerance_is_share else tolerance


def _flat(target: Target, place: dict, xs: list[float], ys: list[float]) -> Judged:
    low, high = int(np.argmin(ys)), int(np.argmax(ys))
    place = {**place, target.over: (xs[high], xs[low])}
    return _within(ys[high] - ys[low], None, _tolerance(target, ys), place, "highest less lowest")


def _monotone(target: Target, place: dict, xs: list[float], ys: list[float]) -> Judged:
    """Judge that the last value is strictly beyond the first and that no step goes back by more than the tolerance."""
    sign = 1.0 if target.sign == "grows" else -1.0
    whole, steps = ys[-1] - ys[0], np.diff(ys)
    if not sign * whole > 0.0:
        margin = min(sign * whole, -0.0)
        ends = (0.0, None) if sign > 0.0 else (None, 0.0)
        return Judged(whole, False, {**place, target.over: (xs[-1], xs[0])}, *ends, margin, "last less first")
    at = int(np.argmin(sign * steps))
    tolerance = _tolerance(target, ys)
    place = {**place, target.over: (xs[at + 1], xs[at])}
    low, high = (0.0 - tolerance, None) if sign > 0.0 else (None, tolerance)
    return _within(float(steps[at]), low, high, place, "worst step")


def _judge_fit(target: Target, records: list[Record]) -> tuple[list[Judged], list[str]]:
    degree = {"linear": 1, "quadratic": 2}[_stated(target, "shape")]
    lines, lacking = _lines(target, records, target.over)
    judged = []
    for place, points in lines:
        try:
            if len(points) < degree + 2:
                raise _Missing(f"{len(points)} values over {target.over} are too few for a {target.shape} fit")
            x, y = np.transpose([(x, _number(r, target.quantity)) for x, same in points for r in same])
            judged.append(_within(r_squared(x, y, degree), target.low, None, place, "R2"))
        except _Missing as reason:
            judged.append(_unknown(place, reason))
    return judged, lacking


def r_squared(x: Floats, y: Floats, degree: int) -> float:
    """Return the coefficient of determination of a least-squares polynomial.

    Parameters
    ----------
    x, y : (n,) array of float
        The points.
    degree : int
        Degree of the polynomial.

    Returns
    -------
    float
        R2.
    """
    about = y - y.mean()
    total = float(about @ about)
    if total <= (1e-12 * np.abs(y).max()) ** 2 * y.size:
        raise _Missing("does not change at all, so a fit explains nothing")
    scaled = (x - x.mean()) / np.ptp(x)
    rest = y - np.polyval(np.polyfit(scaled, y, degree), scaled)
    return 1.0 - float(rest @ rest) / total


def _judge_curve(target: Target, records: list[Record]) -> tuple[list[Judged], list[str]]:
    variable = VARIABLES[_stated(target, "variable")]
    lines, lacking = _lines(target, records, variable)
    judged = []
    for place, points in lines:
        try:
            x = np.array([x for x, _ in points]) / UNITS[_stated(target, "variable_unit")][1]
            y = np.array([_at(target, same) for _, same in points]) / UNITS[target.unit][1]
            rms = _deviation(target, x, y) * UNITS[target.unit][1]
            judged.append(_within(rms, None, target.tolerance, place, "root mean square deviation"))
        except _Missing as reason:
            judged.append(_unknown(place, reason))
    return judged, lacking


def _deviation(target: Target, x: Floats, y: Floats) -> float:
    """Return the root mean square deviation from the pieces, weighted by the variable (trapezoids), in their unit."""
    start, end = target.pieces[0][0], target.pieces[-1][1]
    inside = (x >= start - 1e-9 * (end - start)) & (x <= end + 1e-9 * (end - start))
    x, y = x[inside], y[inside]
    if x.size < 3 or x[0] - start > COVER * (end - start) or end - x[-1] > COVER * (end - start):
        span = f"{x[0]:g} to {x[-1]:g}" if x.size else "nothing"
        raise _Missing(f"covers {span} of {start:g} to {end:g} {target.variable_unit}")
    square = (y - curve(target, x)) ** 2
    return math.sqrt(float(np.trapezoid(square, x) if hasattr(np, "trapezoid") else np.trapz(square, x)) / float(x[-1] - x[0]))


def curve(target: Target, x: Floats) -> Floats:
    """Return the printed curve at some places; at a joint the later piece counts.

    Parameters
    ----------
    target : Target
        The row with the curve.
    x : (n,) array of float
        Places, in variable_unit.

    Returns
    -------
    (n,) array of float
        Values in the curve's unit; not a number outside the pieces.
    """
    x = np.asarray(x, dtype=float)
    out = np.full(x.shape, np.nan)
    for start, end, coefficients in target.pieces:
        part = (x >= start - 1e-12) & (x <= end + 1e-9 * abs(end))
        out[part] = np.polyval(coefficients, x[part])
    return out


def _judge_classification(target: Target, records: list[Record]) -> tuple[list[Judged], list[str]]:
    found = select(records, target.procedure, target.quantity, target.conditions, target.fixed)
    found = [r for r in found if r.values[target.quantity] in (None, *target.classes)]
    judged = []
    for r in found:
        value = r.values[target.quantity]
        if value is None:
            judged.append(_unknown(_varying(target, r), r.why.get(target.quantity, "was not decided")))
        else:
            met = value == target.expected
            judged.append(Judged(value, met, _varying(target, r), margin=0.0 if met else -1.0))
    return judged, missing(found, target.procedure, target.conditions)


_JUDGES = {
    "value": _judge_value,
    "range": _judge_value,
    "upper": _judge_value,
    "lower": _judge_value,
    "difference": _judge_pair,
    "ratio": _judge_pair,
    "trend": _judge_trend,
    "fit": _judge_fit,
    "curve": _judge_curve,
    "classification": _judge_classification,
}
