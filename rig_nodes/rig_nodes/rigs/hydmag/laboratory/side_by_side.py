# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Chapter 9 side by side: the thesis's own simulation and this rig, each by its distance from the laboratory's measurement.

Used by rigs.hydmag.laboratory.programme and rigs.hydmag.laboratory.document. The measured and simulated curves of fig. 9.5 to 9.8
are lost. The rig chapter9, which is the thesis's simulation rebuilt, stands for the latter, and what the text states of the
measurement (rows of targets.yaml) leaves an interval for each measured value, rarely two.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rig_nodes.base import SI
from rig_nodes.studies import Span, Target

from .derived import TORQUE_ALIKE
from .records import Record, allowed, canonical
from .targets import load_targets

if TYPE_CHECKING:
    from collections.abc import Sequence

Pieces = tuple[tuple[float, float], ...]  # the values that a measurement can have, as intervals of equal weight


@dataclass(frozen=True)
class Known:
    """What the text says of the measured value at some points, given the simulated one.

    Parameters
    ----------
    of : tuple of str
        Rows of targets.yaml that say it; the conditions of the first one are the points.
    pieces : callable
        Takes the simulated value and the rows, and returns what the measured value can be.
    """

    of: tuple[str, ...]
    pieces: Callable[[float, Sequence[Target]], Pieces]


def _number(value: float | None) -> float:
    return math.nan if value is None else value


def _cut(pieces: Pieces, low: float, high: float) -> Pieces:
    """Return the parts of pieces between two ends; when nothing is left, the statements contradict each other and all stay."""
    inside = tuple((max(a, low), min(b, high)) for a, b in pieces if max(a, low) <= min(b, high))
    return inside or pieces


def _within(simulated: float, rows: Sequence[Target]) -> Pieces:
    """Within the first row's distance of the simulated value, and within the bounds of the second one."""
    reach = _number(rows[0].high)
    return _cut(((simulated - reach, simulated + reach),), *_ends(rows[1:]))


def _apart(simulated: float, rows: Sequence[Target]) -> Pieces:
    """Just the first row's distance above or below the simulated peak, and within the bounds of the second one.

    The torque meter's error is left to the bounds, because less than that error must not decide which of the two it was.
    """
    reach, (low, high) = _number(rows[0].high), _ends(rows[1:])
    both = tuple((simulated + sign * reach, simulated + sign * reach) for sign in (-1.0, 1.0))
    return _cut(both, low - TORQUE_ALIKE, high + TORQUE_ALIKE)


def _share(simulated: float, rows: Sequence[Target]) -> Pieces:
    """Within the first row's ratio of measured to simulated value, and within the bounds of the second one."""
    return _cut(((simulated * _number(rows[0].low), simulated * _number(rows[0].high)),), *_ends(rows[1:]))


def _shifted(simulated: float, rows: Sequence[Target]) -> Pieces:
    """At the distance from the simulated value that the first row gives, within the bounds of the second one."""
    return _cut(((simulated - _number(rows[0].high), simulated - _number(rows[0].low)),), *_ends(rows[1:]))


def _bounded(_: float, rows: Sequence[Target]) -> Pieces:
    """Between the lower bound of the first row and the upper bound of the second one."""
    return ((_number(rows[0].low), _number(rows[1].high)),)


def _ends(rows: Sequence[Target]) -> tuple[float, float]:
    low = rows[0].low if rows and rows[0].low is not None else -math.inf
    return low, rows[0].high if rows and rows[0].high is not None else math.inf


# comparison -> (title, shift, quantity, what is known; at a point the first that names it counts)
COMPARISONS: dict[str, tuple[str, str, str, tuple[Known, ...]]] = {
    "up_peak": (
        "highest M_wej, I to II (fig. 9.5)",
        "I-II",
        "input_torque_max_nm",
        (
            Known(("ch9_up_peak_1200_120", "up_peak_torque_range"), _apart),
            Known(("ch9_up_peak_1500", "up_peak_torque_range"), _within),
            Known(("ch9_up_peak_share", "up_peak_torque_range"), _share),
        ),
    ),
    "down_peak": (
        "highest M_wej, II to I (fig. 9.6)",
        "II-I",
        "input_torque_max_nm",
        (Known(("ch9_down_peak_1500_240", "down_peak_at_240"), _apart), Known(("ch9_down_peak_band",), _share)),
    ),
    "t_p12": (
        "t_p12 (fig. 9.7)",
        "I-II",
        "t_p_s",
        (Known(("ch9_t_p12_to_70",), _within), Known(("up_t_p_at_120", "up_t_p_upper"), _bounded)),
    ),
    "t_p21": ("t_p21 (fig. 9.8)", "II-I", "t_p_s", (Known(("ch9_t_p21_shift", "down_t_p_range"), _shifted),)),
}


def mean_distance(value: float, pieces: Pieces) -> float:
    """Return the mean distance of a value from a measurement that can be anywhere in some intervals, each as likely."""

    def of(low: float, high: float) -> float:
        if high - low <= 1e-12 * max(abs(low), abs(high)) or not low < value < high:
            return abs(value - 0.5 * (low + high))
        return ((value - low) ** 2 + (high - value) ** 2) / (2.0 * (high - low))

    return math.fsum(of(low, high) for low, high in pieces) / len(pieces)


def nearest(value: float, pieces: Pieces) -> float:
    """Return the least distance that a value can have from the measurement."""
    return min(max(low - value, value - high, 0.0) for low, high in pieces)


def farthest(value: float, pieces: Pieces) -> float:
    """Return the largest distance that a value can have from the measurement."""
    return max(max(abs(value - low), abs(value - high)) for low, high in pieces)


def closer(thesis: float, rig: float, pieces: Pieces) -> str:
    """Return whose value is closer to the measurement wherever that lies: "rig", "thesis", or "open" when that decides it."""
    middle, sign = 0.5 * (thesis + rig), 1.0 if rig > thesis else -1.0
    beyond = [sign * (end - middle) for piece in pieces for end in piece]
    if rig == thesis or min(beyond) < 0.0 < max(beyond):
        return "open"
    return "rig" if max(beyond) > 0.0 else "thesis"


def comparisons(records: Sequence[Record]) -> dict[str, dict]:
    """Return the four comparisons of chapter 9.2, in SI units.

    Parameters
    ----------
    records : sequence of Record
        The programme's records: of chapter 9's simulation, and the grids as its measurements.

    Returns
    -------
    dict of str to dict
        Comparison -> title, unit, from (rows of targets.yaml that say what was measured), points (n_wej, m_wyj, measured as
        intervals, thesis, rig, closer), and for thesis and rig the mean over the points of the distance, with at_least and
        at_most as far as the measurement is known; closer: who has the smaller mean distance. A comparison whose shifts did
        not run is left out.
    """
    targets = {target.id: target for target in load_targets()}
    out = {}
    for name, (title, shift, quantity, known) in COMPARISONS.items():
        points = []
        for (n_wej, m_wyj), (thesis, rig) in _pairs(records, shift, quantity).items():
            for one in known:
                rows = [targets[row] for row in one.of]
                if _names(rows[0], n_wej, m_wyj):
                    pieces = one.pieces(thesis, rows)
                    points.append((n_wej, m_wyj, pieces, thesis, rig))
                    break
        if not points:
            continue
        sides = {}
        for side, at in (("thesis", 3), ("rig", 4)):
            sides[side] = {
                key: math.fsum(function(point[at], point[2]) for point in points) / len(points)
                for key, function in (("distance", mean_distance), ("at_least", nearest), ("at_most", farthest))
            }
        dimension = targets[known[0].of[0]].dimension
        out[name] = {
            "title": title,
            "unit": SI[dimension],
            "from": sorted({row for one in known for row in one.of}),
            **sides,
            "closer": "rig" if sides["rig"]["distance"] < sides["thesis"]["distance"] else "thesis",
            "points": [
                {
                    "n_wej": n_wej,
                    "m_wyj": m_wyj,
                    "measured": [list(piece) for piece in pieces],
                    "thesis": thesis,
                    "rig": rig,
                    "closer": closer(thesis, rig, pieces),
                }
                for n_wej, m_wyj, pieces, thesis, rig in points
            ],
        }
    return out


def _pairs(records: Sequence[Record], shift: str, quantity: str) -> dict[tuple, tuple[float, float]]:
    """Return (simulated, rig) for each point that both have, by (n_wej, m_wyj)."""
    found: dict[str, dict[tuple, float]] = {"simulated": {}, "measured": {}}
    for r in records:
        if r.procedure != "chapter9" or r.conditions.get("shift") != shift or "source" not in r.conditions:
            continue
        value = r.values.get(quantity)
        if isinstance(value, float):
            found[str(r.conditions["source"])][canonical(r.conditions["n_wej"]), canonical(r.conditions["m_wyj"])] = value
    both = sorted(set(found["simulated"]) & set(found["measured"]))
    return {at: (found["simulated"][at], found["measured"][at]) for at in both}


def _names(target: Target, n_wej: float, m_wyj: float) -> bool:
    """Return whether a row speaks of a point, whose numbers are rounded to keys."""
    return all(
        allowed(value, wanted if isinstance(wanted, Span) else tuple(map(canonical, wanted)))
        for value, wanted in ((n_wej, target.conditions["n_wej"]), (m_wyj, target.conditions["m_wyj"]))
    )
