# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a validation is worth: balanced accuracy of the hold phase, and what a trivial predictor gets in each group of rows.

Used by rigs.hydmag.laboratory.programme and rigs.hydmag.laboratory.document. A trivial predictor is judged like the rig, on the
rig's own records with its answer in place of every value.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from rig_nodes.base import UNITS
from rig_nodes.studies import INSIDE, Row, Target, listed

from .derived import gaps
from .evaluate import curve, evaluate
from .records import SHARED, Record
from .targets import INDEPENDENT, load_targets

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

HOLD = "hold"
HOLD_WORDS = ("hold", "no hold")
LEFT_ASIDE = 21  # series of ZR-P1 that contradicts its neighbours (Annex B): 16 and 22, on either side of it, have a hold phase
PRINTED = "the mean of the printed numbers, and the commoner class"
# group of rows -> the answer of its trivial predictor; a group is a procedure, and the hold phase is one of its own
PREDICTORS = {
    HOLD: "always hold",
    "valve_response": f"both valves alike: {PRINTED}",
    "coast_down": f"no dependence on time: {PRINTED}",
    "profile_series": f"all series alike: {PRINTED}",
    "delay_series": f"no dependence on the delays: {PRINTED}",
    "grid_up": f"no dependence on load and speed: {PRINTED}",
    "grid_down": f"no dependence on load and speed: {PRINTED}",
    "clutch_bench": f"all packs alike: {PRINTED}",
    "spring_bench": f"no dependence on travel and pressure: {PRINTED}",
    "chapter9": "the measurement is the thesis's simulation: every difference is zero",
}
BASES = ("predicted", "calibrated")
# kinds with printed numbers of the quantity itself
NUMBERS = ("value", "range", "upper", "lower")
NOT_PRINTED = 1.0  # SI; for quantities of which only trends are claimed, for which any constant does as well


def group_of(target: Target) -> str:
    """Return the group of a row, a key of PREDICTORS."""
    return HOLD if target.quantity == HOLD else target.procedure


def balanced_accuracy(rows: Iterable[Row], aside: Sequence[int] = (LEFT_ASIDE,)) -> float | None:
    """Return the mean of the shares of series with and without a hold phase that the rig gets right.

    A predictor that always says the same has 0.5. A series that the rig leaves undecided counts as wrong.

    Parameters
    ----------
    rows : iterable of Row
        The judged rows; those on the hold phase are taken.
    aside : sequence of int
        Series of ZR-P1 that do not count.

    Returns
    -------
    float or None
        The balanced accuracy; None unless there are series with and series without a hold phase.
    """
    right: dict[str, list[bool]] = {word: [] for word in HOLD_WORDS}
    for row in rows:
        target = row.target
        if target.quantity != HOLD or target.expected not in right:
            continue
        if listed(target.conditions["valve"]) == ("ZR-P1",) and listed(target.conditions["series"])[0] in aside:
            continue
        right[target.expected].append(row.value == target.expected)
    if not all(right.values()):
        return None
    return sum(sum(found) / len(found) for found in right.values()) / len(right)


def trivial(rows: Sequence[Row], records: Sequence[Record]) -> dict[str, dict]:
    """Return for each group what its trivial predictor gets, beside the rig.

    Parameters
    ----------
    rows : sequence of Row
        The rig's rows.
    records : sequence of Record
        The records by which they were judged.

    Returns
    -------
    dict of str to dict
        Group -> predictor (a sentence), and for predicted and calibrated rows: rows, how many there are, and rig and trivial,
        how many of them are inside.
    """
    targets = load_targets()
    measured_is_simulated = _chapter9(records)
    holding: dict[str, list[Record]] = {}
    for record in records:
        for quantity in record.values:
            holding.setdefault(quantity, []).append(record)
    out: dict[str, dict] = {}
    for group, sentence in PREDICTORS.items():
        counts = {}
        for basis in BASES:
            members = [row for row in rows if row.basis == basis and group_of(row.target) == group]
            answers = []
            for row in members:
                candidates = (
                    measured_is_simulated
                    if group == "chapter9"
                    else _constant(row.target, holding.get(row.target.quantity, []), targets)
                )
                answers.append(evaluate(row.target, [r for r in candidates if row.target.quantity in r.values]))
            counts[basis] = {
                "rows": len(members),
                "rig": sum(row.verdict == INSIDE for row in members),
                "trivial": sum(row.verdict == INSIDE for row in answers),
            }
        if any(count["rows"] for count in counts.values()):
            out[group] = {"predictor": sentence, **counts}
    return out


def _chapter9(records: Sequence[Record]) -> list[Record]:
    """Return the simulated shifts of chapter 9, and the same once more as the measured ones."""
    simulated = [r for r in records if r.procedure == "chapter9" and r.conditions.get("source") == "simulated"]
    both = simulated + [replace(r, conditions={**r.conditions, "source": "measured"}) for r in simulated]
    return both + gaps(both)


def _constant(target: Target, records: Sequence[Record], targets: Sequence[Target]) -> list[Record]:
    """Return the records of a row's quantity with one answer for each direction of shift in place of every value."""
    procedures, quantity = SHARED.get(target.procedure, (target.procedure,)), target.quantity
    like = [one for one in targets if one.quantity == quantity and one.procedure in procedures and one.role in INDEPENDENT]
    answers: dict[float | str | None, float | str] = {}
    out = []
    for record in records:
        value, shift = record.values[quantity], record.conditions.get("shift")
        fits = value is None or value in target.classes if target.classes else not isinstance(value, (str, bool))
        if record.procedure not in procedures or not fits:
            continue
        if shift not in answers:
            about = [one for one in like if _about(one, shift)] or like
            answers[shift] = _commoner(target, about) if target.classes else _mean_printed(about)
        out.append(Record(record.procedure, record.conditions, {quantity: answers[shift]}))
    return out


def _about(target: Target, shift: float | str | None) -> bool:
    shifts = listed(target.conditions.get("shift", ()))
    return not shifts or shift is None or shift in shifts


def _commoner(target: Target, like: Sequence[Target]) -> str:
    counts = Counter(one.expected for one in like if one.classes == target.classes and one.expected)
    return counts.most_common(1)[0][0]


def _mean_printed(like: Sequence[Target]) -> float:
    """Return the mean of the printed numbers and curves of some rows [SI]."""
    found = []
    for one in like:
        if one.kind == "curve":
            x = np.linspace(one.pieces[0][0], one.pieces[-1][1], 201)
            found.append(float(np.mean(curve(one, x))) * UNITS[one.unit][1])
        elif one.kind in NUMBERS and one.printed and one.statistic in (None, "mean", "lowest", "highest"):
            found.append(math.fsum(one.printed) / len(one.printed))
    return math.fsum(found) / len(found) if found else NOT_PRINTED
