# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Limits that a user sets for the results of a report, and the verdict on each result.

`rig report --limit` and `--limits` use it. A limit is a range of a result's name or key, e.g. ``t_c: .. 700 ms``.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from ..base import UNITS, RigError, brief, load_yaml, quantity, unknown, where_of
from .display import shown
from .results import Result, number

MET, MISSED, UNDECIDED, NOT_FOUND = "met", "missed", "undecided", "not found"
EXAMPLE = "'LOW .. HIGH' with units, where one end may be left out, e.g. '.. 700 ms' or '0.95 ..'"


@dataclass(frozen=True)
class Limit:
    """A range of a result.

    Attributes
    ----------
    name : str
        Name or key of the result.
    kind : str
        The way of shift, valve, clutch or friction model for which it is meant; empty for all.
    text : str
        The range as it was written.
    where : str
        Where it was written, for errors.
    """

    name: str
    kind: str
    text: str
    where: str


@dataclass(frozen=True)
class Verdict:
    """A result against a limit: ``low`` and ``high`` in the unit of the result (None for an open end)."""

    result: Result
    low: float | None
    high: float | None

    @property
    def verdict(self) -> str:
        """Met, missed, not found, or undecided when the limit lies within the measuring error of the value."""
        value, error = self.result.value, self.result.error or 0.0
        if value is None:
            return NOT_FOUND
        room = min(
            value - self.low if self.low is not None else float("inf"), self.high - value if self.high is not None else float("inf")
        )
        return UNDECIDED if abs(room) < error else MET if room >= 0.0 else MISSED

    def as_dict(self) -> dict:
        """Return plain values for JSON."""
        return {**self.result.as_dict(), "low": self.low, "high": self.high, "verdict": self.verdict}


def parse_limits(texts: Iterable[str]) -> list[Limit]:
    """Return the limits of ``--limit NAME=RANGE`` or ``--limit KIND:NAME=RANGE``; RigError when one is no such text."""
    found = []
    for text in texts:
        name, sign, span = text.partition("=")
        if not sign or not name.strip():
            raise RigError(f"--limit {text}: expected NAME={EXAMPLE}")
        kind, colon, rest = name.rpartition(":")
        found.append(Limit((rest if colon else name).strip(), kind.strip(), span, f"--limit {text}"))
    return found


def read_limits(path: str | Path) -> list[Limit]:
    """Return the limits of a YAML file: a map of names and ranges, or of a kind and such a map.

    Parameters
    ----------
    path : str or Path
        The file.

    Returns
    -------
    list of Limit
        The limits in their order.

    Raises
    ------
    RigError
        When the file is no such map.
    """
    node = load_yaml(path)
    if not isinstance(node, dict):
        raise RigError(f"{path}: expected a map of names of results and ranges, e.g. 't_c: .. 700 ms'")
    found = []
    for name, value in node.items():
        inner, kind = (value, str(name)) if isinstance(value, dict) else ({name: value}, "")
        for own, span in inner.items():
            place = value if kind else node
            where = f"{where_of(path, place, own)}: {own}"
            if not isinstance(span, str):
                raise RigError(f"{where} is {brief(span)}, expected {EXAMPLE}")
            found.append(Limit(str(own), kind, span, where))
    return found


def judged(results: Sequence[Result], limits: Iterable[Limit]) -> list[Verdict]:
    """Return the verdict on each result for which there is a limit.

    Parameters
    ----------
    results : sequence of Result
        The results of a report (results.results_of).
    limits : iterable of Limit
        The limits.

    Returns
    -------
    list of Verdict
        In the order of the limits and, for each, of the results.

    Raises
    ------
    RigError
        When a limit names no result of the report, or its range or unit is wrong.
    """
    out = []
    for limit in limits:
        named = [one for one in results if limit.name in (one.key, one.name)]
        if not named:
            raise RigError(
                f"{limit.where}: {unknown('result in this report', limit.name, dict.fromkeys(one.name for one in results))}"
            )
        fitting = [one for one in named if limit.kind in ("", one.kind)]
        if not fitting:
            kinds = dict.fromkeys(one.kind for one in named)
            raise RigError(f"{limit.where}: {limit.name} is there of {', '.join(kinds)}, not of {brief(limit.kind)}")
        ranges = {one.unit: _range(limit, one) for one in fitting}
        out += [Verdict(one, *ranges[one.unit]) for one in fitting]
    return out


def _range(limit: Limit, result: Result) -> tuple[float | None, float | None]:
    """Return the ends of a limit in the unit of a result."""
    low, dots, high = limit.text.partition("..")
    if not dots or not (low.strip() or high.strip()):
        raise RigError(f"{limit.where}: {brief(limit.text.strip())} is no range, expected {EXAMPLE}")
    if not result.dimension:
        raise RigError(f"{limit.where}: {limit.name} has the unit {result.unit}, for which no limit can be written")
    factor = UNITS[result.unit][1]
    ends = [quantity(end.strip(), result.dimension, limit.where) / factor if end.strip() else None for end in (low, high)]
    if None not in ends and ends[0] > ends[1]:
        raise RigError(
            f"{limit.where}: the range goes from {ends[0]:g} down to {ends[1]:g} {result.unit}, expected the lower end first"
        )
    return ends[0], ends[1]


def limit_lines(verdicts: Iterable[Mapping]) -> list[str]:
    """Return a line for each verdict in plain values (Verdict.as_dict), for the terminal."""
    lines = []
    for one in verdicts:
        unit = "" if one["unit"] == "-" else f" {one['unit']}"
        error = number(one["error"], one["digits"])
        value = shown(one["value"], one["error"], one["digits"]) + (f" +- {error}" if error else "")
        lines.append(f"limit {one['verdict']}: {one['place']}: {one['name']} {value}{unit}, limit {range_text(one)}{unit}")
    return lines


def range_text(verdict: Mapping) -> str:
    """Return the range of a verdict in plain values as people write it."""
    low, high = ("" if end is None else f"{end:.6g}" for end in (verdict["low"], verdict["high"]))
    return f"{low} .. {high}".strip()


def counted(verdicts: Iterable[Mapping]) -> dict[str, int]:
    """Return how many verdicts of each word there are, from their plain values."""
    counts = dict.fromkeys((MET, MISSED, UNDECIDED, NOT_FOUND), 0)
    for one in verdicts:
        counts[one["verdict"]] += 1
    return {word: count for word, count in counts.items() if count}
