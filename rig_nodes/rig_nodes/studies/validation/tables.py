# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Validation rows as text: counts of verdicts, values with units, and the summary for the terminal; for the rows of any rig."""

from __future__ import annotations

import math
from collections.abc import Iterable

from ...base import SI, UNITS
from .rows import BASIS, CONTRADICTS, INSIDE, NOT_COMPARED, OUTSIDE, Row, Target


def counts(rows: Iterable[Row]) -> dict[str, dict[str, int]]:
    """Return for each basis how many rows have each verdict, and how many there are."""
    out = {basis: {INSIDE: 0, OUTSIDE: 0, NOT_COMPARED: 0, "rows": 0} for basis in BASIS.values()}
    out["contradiction"][CONTRADICTS] = 0
    for row in rows:
        out[row.basis][row.verdict] += 1
        out[row.basis]["rows"] += 1
    return out


def number(target: Target, value: float) -> str:
    """Return a value [SI] of a row as text in the laboratory's unit, with the unit."""
    unit = target.unit if UNITS[target.unit][0] == target.dimension else SI[target.dimension]
    text = f"{value / UNITS[unit][1]:.5g}"
    return text if unit == "-" else f"{text} {unit}"


def of_rig(row: Row) -> str:
    """Return the rig's value as text: what it is, how many values of how many are inside, and where the worst one stands."""
    t = row.target
    if row.value is None:
        return "-"
    text = row.value if isinstance(row.value, str) else f"{row.value:.5g}" if t.kind == "fit" else number(t, row.value)
    parts = [row.judged_by] if row.judged_by else []
    parts += [f"{row.inside} of {row.count} inside"] if row.count > 1 else []
    parts += [row.at] if row.at else []
    return text + (f" ({'; '.join(parts)})" if parts else "")


def accepted(row: Row) -> str:
    """Return what the row accepts as text, in the laboratory's unit."""
    t = row.target
    if t.kind == "classification":
        return t.expected or ""
    if t.kind == "trend":
        tolerance = f"{t.tolerance * 100:g} %" if t.tolerance_is_share else number(t, t.tolerance)
        over = f"over {t.over}"
        return f"flat {over} within {tolerance}" if t.sign == "flat" else f"{t.sign} {over}, steps back to {tolerance}"
    if t.kind == "fit":
        return f"{t.shape} over {t.over}, R2 at least {t.low:g}"
    if t.kind == "curve":
        return f"printed curve within {number(t, t.tolerance)}"
    if t.low is None:
        return f"at most {number(t, t.high)}"
    if t.high is None:
        return f"at least {number(t, t.low)}"
    if t.low == t.high:
        return number(t, t.low)
    return f"{number(t, t.low)} to {number(t, t.high)}"


def laboratory(row: Row) -> str:
    """Return as text what was printed, where it is a number, and what is accepted."""
    t = row.target
    ends = [end for end in (t.low, t.high) if end is not None]
    if not t.printed or t.kind == "fit" or all(any(math.isclose(p, end) for end in ends) for p in t.printed):
        return accepted(row)
    return f"{' to '.join(number(t, p) for p in t.printed)}; accepted: {accepted(row)}"


def verdict_line(rows: list[Row], of_predicted: str = "") -> str:
    """Return one sentence with the counts of verdicts; ``of_predicted`` is what it says of the predicted rows in addition."""
    found = counts(rows)

    def of(basis: str) -> str:
        count = found[basis]
        lacking = f" ({count[NOT_COMPARED]} not compared)" if count[NOT_COMPARED] else ""
        return f"{basis} inside {count[INSIDE]} of {count['rows']}{lacking}"

    parts = [of("predicted") + of_predicted] if found["predicted"]["rows"] else []
    if found["calibrated"]["rows"]:
        parts.append(of("calibrated"))
    apart = ", ".join(of(basis) for basis in ("implied", "consistency") if found[basis]["rows"])
    if apart:
        parts.append(f"counted apart: {apart}")
    if shown := found["contradiction"]["rows"]:
        parts.append(f"{CONTRADICTS}: {found['contradiction'][CONTRADICTS]} of {shown}")
    parts.append(f"information, not judged: {found['information']['rows']}")
    return "; ".join(parts)


def terminal(rows: list[Row], of_predicted: str = "") -> str:
    """Return the text for the terminal: counts, misses, contradictions of the source and rows that could not be compared."""
    lines = [verdict_line(rows, of_predicted)]
    for title, verdict in (("misses", OUTSIDE), (CONTRADICTS, CONTRADICTS), ("not compared", NOT_COMPARED)):
        found = [row for row in rows if row.verdict == verdict and row.basis != "information"]
        if found:
            lines += ["", f"{title}:"]
        width = max((len(row.target.id) for row in found), default=0)
        for row in found:
            remark = {OUTSIDE: f"{of_rig(row)}; accepted: {accepted(row)}", CONTRADICTS: row.target.text}.get(verdict, row.reason)
            lines.append(f"  {row.target.id:<{width}}  {row.basis:<11}  {remark}")
    return "\n".join(lines)
