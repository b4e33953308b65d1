# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The rig's results under known conditions, as records that can be selected like the rows of targets.yaml.

Made by rigs.hydmag.laboratory.programme and read by rigs.hydmag.laboratory.evaluate; this module does not depend on how a procedure
is run.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from rig_nodes.base import SI, UNITS, RigError
from rig_nodes.studies import Span

from .conditions import CONDITIONS

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Sequence

REL = 1e-9  # two settings are the same within this share; they come from the same decimal numbers
# number of series that "all" means: procedure -> valve (None: any valve) -> number, tab. 7.4, Annexes B and C
SERIES = {"delay_series": {None: 19}, "profile_series": {"ZR-P1": 37, "ZR-P2": 10}}
# a record with such a condition shows a part or a moment of a test, and is selected only by rows that name the condition
ASPECTS = ("phase", "time", "pressure", "inertia")
# rows of one grid are compared with shifts of the other one
SHARED = {"grid_up": ("grid_up", "grid_down"), "grid_down": ("grid_up", "grid_down")}

PEOPLE = {"angular velocity": "rpm", "time": "ms", "pressure": "MPa", "length": "mm"}


@dataclass(frozen=True)
class Record:
    """Results of one test under its conditions, all in SI units.

    Parameters
    ----------
    procedure : str
        Name of the procedure.
    conditions : dict
        Names as in targets.yaml, and the variable of a curve that has no such name (``s``), with their values. ``series`` may
        be "all" for a result of all series together.
    values : dict
        Quantities of targets.yaml with a number, a class as text, or None when the value could not be found.
    why : dict of str to str
        Quantity -> the reason of a None.
    """

    procedure: str
    conditions: dict[str, float | int | str]
    values: dict[str, float | str | bool | None]
    why: dict[str, str] = field(default_factory=dict)


def same(one: float | str, other: float | str) -> bool:
    """Return whether two values of a condition are the same: text exactly, numbers within REL of the larger."""
    if isinstance(one, str) or isinstance(other, str):
        return one == other
    return math.isclose(one, other, rel_tol=REL, abs_tol=1e-12)


def allowed(value: float | str, wanted: tuple | Span) -> bool:
    """Return whether a record's value of a condition is among those wanted.

    Parameters
    ----------
    value : float or str
        The record's value [SI].
    wanted : tuple or Span
        A tuple of values, in which "all" stands for every one, or a Span with its ends included.

    Returns
    -------
    bool
        True when it is.
    """
    if isinstance(wanted, Span):
        if isinstance(value, str):
            return False
        slack = REL * max(abs(wanted.low), abs(wanted.high))
        return wanted.low - slack <= value <= wanted.high + slack
    return any(one == "all" or same(value, one) for one in wanted)


def select(records: Iterable[Record], procedure: str, quantity: str, conditions: dict, named: Iterable[str] = ()) -> list[Record]:
    """Return the records of a procedure that hold a quantity under the given conditions, in their order.

    A record with a condition of ASPECTS is left out unless that condition is among the given ones or named.

    Parameters
    ----------
    records : iterable of Record
        The records.
    procedure : str
        Name of the procedure.
    quantity : str
        Name of the quantity.
    conditions : dict
        Name -> tuple or Span, as in a Target.
    named : iterable of str
        Further conditions that a record must have.

    Returns
    -------
    list of Record
        The records.
    """
    procedures = SHARED.get(procedure, (procedure,))
    known = {*conditions, *named}
    return [
        r
        for r in records
        if r.procedure in procedures
        and quantity in r.values
        and all(name in r.conditions for name in known)
        and all(name in known for name in ASPECTS if name in r.conditions)
        and all(allowed(r.conditions[name], wanted) for name, wanted in conditions.items())
    ]


def missing(records: list[Record], procedure: str, conditions: dict) -> list[str]:
    """Return what is wanted by name and has no record.

    Every combination of listed values must have a record, a Span must have one, and ``series: all`` must have one for each
    series of the procedure.

    Parameters
    ----------
    records : list of Record
        The selected records.
    procedure : str
        Name of the procedure.
    conditions : dict
        Name -> tuple or Span, as in a Target.

    Returns
    -------
    list of str
        One short text each.
    """
    combinations = [{}]
    for name, wanted in conditions.items():
        if isinstance(wanted, tuple) and "all" not in wanted:
            combinations = [{**c, name: (one,)} for c in combinations for one in wanted]
    out = []
    for wanted in combinations:
        found = [r for r in records if all(allowed(r.conditions[name], one) for name, one in wanted.items())]
        if not found:
            out.append(", ".join(f"{shown(name, one[0])}" for name, one in wanted.items()) or "any record")
        elif "all" in conditions.get("series", ()):
            out += _missing_series(found, procedure)
    return out


def _missing_series(found: list[Record], procedure: str) -> list[str]:
    counts = SERIES.get(procedure, {})
    out = []
    for valve in {r.conditions.get("valve") if None not in counts else None for r in found}:
        there = {r.conditions["series"] for r in found if valve in (None, r.conditions.get("valve"))}
        if "all" in there:
            continue  # a result of all series together
        lacking = sorted(set(range(1, counts.get(valve, 0) + 1)) - there)
        if lacking:
            out.append(f"series {', '.join(map(str, lacking))}" + (f" of {valve}" if valve else ""))
    return out


def group(records: Iterable[Record], names: Collection[str]) -> list[tuple[dict, list[Record]]]:
    """Return records that agree in all of ``names``, as (those conditions, records), in the order in which they first occur."""
    groups: dict[tuple, tuple[dict, list[Record]]] = {}
    for record in records:
        key = tuple(canonical(record.conditions[name]) for name in names)
        groups.setdefault(key, ({name: record.conditions[name] for name in names}, []))[1].append(record)
    return list(groups.values())


def canonical(value: float | str) -> float | str:
    """Return a condition's value as a key, which is equal for all values that are :func:`same` except when rounding parts them."""
    return value if isinstance(value, str) else float(f"{value:.8e}") + 0.0


def average(repeats: list[list[Record]]) -> list[Record]:
    """Return one list of records for the repeats of a test, each a list of records in the same order.

    Numbers become their mean, as the laboratory averaged its repeats (7.1.3). A number that one repeat lacks is
    None, and so is a class on which the repeats disagree. Traces (records with a time) are those of the first repeat.

    Parameters
    ----------
    repeats : list of list of Record
        The repeats.

    Returns
    -------
    list of Record
        The records.

    Raises
    ------
    RigError
        When the repeats do not hold the same records.
    """
    if len(repeats) == 1:
        return list(repeats[0])
    single = [[r for r in one if "time" not in r.conditions] for one in repeats]
    traces = [r for r in repeats[0] if "time" in r.conditions]
    if len({len(one) for one in single}) != 1:
        raise RigError(f"repeats of one test gave {', '.join(str(len(one)) for one in single)} results; expected as many from each")
    return [_mean(records) for records in zip(*single)] + traces


def _mean(records: Sequence[Record]) -> Record:
    first = records[0]
    for other in records[1:]:
        if (other.procedure, other.conditions, set(other.values)) != (first.procedure, first.conditions, set(first.values)):
            raise RigError(
                f"repeats of one test differ in what they are: {first.procedure} "
                f"{place_text(first.conditions)} and {other.procedure} {place_text(other.conditions)}"
            )
    values, why = {}, {}
    for name in first.values:
        found = [r.values[name] for r in records]
        lacking = next((r for r in records if r.values[name] is None), None)
        if lacking is not None:
            values[name], why[name] = None, lacking.why.get(name, "not found in one of the repeats")
        elif isinstance(found[0], (str, bool)):
            agree = all(one == found[0] for one in found)
            values[name] = found[0] if agree else None
            if not agree:
                why[name] = f"the repeats disagree: {', '.join(map(str, found))}"
        else:
            values[name] = math.fsum(found) / len(found)
    return Record(first.procedure, dict(first.conditions), values, why)


def shown(name: str, value: float | str) -> str:
    """Return a condition as text in the unit that people use: ``1500 rpm``, ``series 19``, ``ZR-P1``."""
    takes = CONDITIONS.get(name)
    if isinstance(value, str):
        return value if name != "series" else f"series {value}"
    if takes is int:
        return f"{name} {value:g}" if name == "series" else f"{value:g} {name}"
    if isinstance(takes, str):
        unit = PEOPLE.get(takes, SI[takes])
        text = f"{value / UNITS[unit][1]:.6g} {unit}"
        return text if name in ("n_wej", "m_wyj") else f"{name} {text}"
    return f"{name} {value:.6g}"


def place_text(place: dict) -> str:
    """Return a place (conditions, or [one, other] for the two sides of a comparison) as text."""
    parts = [
        " against ".join(shown(name, one) for one in value) if isinstance(value, (list, tuple)) else shown(name, value)
        for name, value in place.items()
    ]
    return ", ".join(parts)
