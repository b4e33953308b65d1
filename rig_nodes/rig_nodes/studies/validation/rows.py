# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A row of a validation: what is printed, what the rig gives, and whether that is accepted; for the rows of any rig."""

from __future__ import annotations

from dataclasses import dataclass, field

from ...base import SI

# role of a target -> basis of its row
BASIS = {
    "predict": "predicted",
    "calibrate": "calibrated",
    "implied": "implied",
    "consistency": "consistency",
    "information": "information",
    "contradiction": "contradiction",
}
INSIDE, OUTSIDE, NOT_COMPARED = "inside", "outside", "not compared"
CONTRADICTS = "source contradicts itself"  # a row of the role contradiction, whose value shows that a printed number is wrong


@dataclass(frozen=True)
class Span:
    """All values of a condition between two, ends included [SI]."""

    low: float
    high: float


def listed(condition: tuple | Span) -> tuple:
    """Return the single values of a condition; a span has none."""
    return () if isinstance(condition, Span) else condition


@dataclass(frozen=True)
class Target:
    """One printed number or trend, and what counts as meeting it; numbers are SI, except those of curves.

    Parameters
    ----------
    id : str
        Name of the row.
    text, where : str
        What is claimed, and the place in the thesis.
    kind : str
        What is compared, by the word of the file that it is from.
    quantity : str
        Name of the quantity.
    dimension : str
        Dimension of printed, low, high and tolerance; a ratio for the kinds ratio and fit and for spread_share.
    procedure : str
        Name of the procedure.
    role : str
        One of ROLES.
    why : str
        Why this much is accepted, or why the row cannot be judged.
    line : int
        Line of the file at which the row stands.
    conditions, of, to : dict
        Name -> tuple of values, or a :class:`Span`.
    unit : str
        The laboratory's unit, for people.
    printed : tuple of float
        The printed number, or the lowest and the highest.
    low, high : float or None
        Ends of what is accepted.
    tolerance : float or None
        The tolerance.
    tolerance_is_share : bool
        True when the tolerance of a trend is a share of the lowest value.
    absolute : bool
        True when a difference counts without its sign.
    sign, shape : str or None
        Sign of a trend, shape of a fit.
    over : str or None
        Condition over which a trend or fit is taken.
    fixed : tuple of str
        Conditions that must be the same for values that are compared.
    inside : str
        Which single values must be inside: all, or most (more than half).
    statistic : str or None
        Statistic of the values.
    across : tuple of str
        Conditions across which the statistic is taken.
    classes, expected
        Names of a classification, and the one that is expected.
    variable, variable_unit : str or None
        Variable of a curve and its unit.
    pieces : tuple
        Pieces of a curve: (from, to, coefficients with the highest power first) in variable_unit and unit.
    conflicts : dict of str to str
        Id of another target -> how the two pull against each other; the same sentence stands at both.
    implied_by : dict of str to str
        Id of an independent target -> why this one follows from it or repeats it; for the role implied.
    consistent_with : str
        What the rig was given from which the row comes out by construction; for the role consistency.
    note : str
        A remark.
    """

    id: str
    text: str
    where: str
    kind: str
    quantity: str
    dimension: str
    procedure: str
    role: str
    why: str
    line: int
    conditions: dict[str, tuple | Span]
    unit: str = "-"
    printed: tuple[float, ...] = ()
    low: float | None = None
    high: float | None = None
    tolerance: float | None = None
    tolerance_is_share: bool = False
    absolute: bool = False
    of: dict[str, tuple | Span] = field(default_factory=dict)
    to: dict[str, tuple | Span] = field(default_factory=dict)
    sign: str | None = None
    shape: str | None = None
    over: str | None = None
    fixed: tuple[str, ...] = ()
    inside: str = "all"
    statistic: str | None = None
    across: tuple[str, ...] = ()
    classes: tuple[str, ...] = ()
    expected: str | None = None
    variable: str | None = None
    variable_unit: str | None = None
    pieces: tuple[tuple[float, float, tuple[float, ...]], ...] = ()
    conflicts: dict[str, str] = field(default_factory=dict)
    implied_by: dict[str, str] = field(default_factory=dict)
    consistent_with: str = ""
    note: str = ""


@dataclass(frozen=True)
class Judged:
    """One judged value of a row.

    Parameters
    ----------
    value : float, str or None
        Number [SI] or class; None when it was not found.
    inside : bool or None
        Whether it is inside; None when it was not found.
    place : dict
        Conditions at which it stands.
    low, high : float or None
        Accepted ends [SI]; None for an open end.
    margin : float
        Distance to the nearer end, negative outside; the worst value is found by it.
    judged_by : str
        What the number is, for instance a statistic.
    reason : str
        Why the value was not found.
    """

    value: float | str | None
    inside: bool | None
    place: dict
    low: float | None = None
    high: float | None = None
    margin: float = 0.0
    judged_by: str = ""
    reason: str = ""


@dataclass(frozen=True)
class Row:
    """A target with the rig's answer; numbers are SI.

    Parameters
    ----------
    target : Target
        The target.
    verdict : str
        INSIDE, OUTSIDE, NOT_COMPARED or CONTRADICTS.
    value, low, high, place, judged_by
        Those of the worst single value.
    reason : str
        Why the row was not compared.
    count, inside : int
        How many single values were judged, and how many of them lie inside.
    every : tuple of Judged
        All single values.
    at : str
        The place in words.
    """

    target: Target
    verdict: str
    value: float | str | None = None
    low: float | None = None
    high: float | None = None
    place: dict = field(default_factory=dict)
    judged_by: str = ""
    reason: str = ""
    count: int = 0
    inside: int = 0
    every: tuple[Judged, ...] = ()
    at: str = ""

    @property
    def basis(self) -> str:
        """What the row is for: one of the values of BASIS."""
        return BASIS[self.target.role]

    def as_dict(self) -> dict:
        """Return the row for programs, with JSON's types only."""
        t = self.target
        return {
            "id": t.id,
            "basis": self.basis,
            "value": self.value,
            "low": self.low,
            "high": self.high,
            "verdict": self.verdict,
            "unit": SI[t.dimension] if t.kind != "classification" else None,
            "kind": t.kind,
            "quantity": t.quantity,
            "procedure": t.procedure,
            "where": t.where,
            "text": t.text,
            "expected": t.expected,
            "printed": list(t.printed),
            "judged_by": self.judged_by,
            "count": self.count,
            "inside": self.inside,
            "place": {k: list(v) if isinstance(v, tuple) else v for k, v in self.place.items()},
            "at": self.at,
            "reason": self.reason,
            "conflicts": sorted(t.conflicts),
            "implied_by": dict(t.implied_by),
            "consistent_with": t.consistent_with,
        }
