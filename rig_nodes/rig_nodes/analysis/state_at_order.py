# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""How a simulated rig stood when a shift was ordered: pistons, plates, oil, speed; and which shifts began differently.

Reports, sweeps, comparisons and the tuner use it. What differs counts from the effect on that its results have beyond their error.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base import RigError
from ..plant import NO_PRESSURE
from ..plant import part as parts
from ..rig import Structure, Transmission, structure_of
from .measured_error import temperature_error
from .plate_heat import above_the_oil

if TYPE_CHECKING:
    from ..bags import Bag
    from .gathered import Gathered

CLUTCH_FIELDS, OIL_FIELDS = ["piston_position", "heat", "pressure"], ["temperature"]
LEAST_TIME, LEAST_FRICTION, LEAST_SPEED = 1e-3, 0.01, 1.0  # s, share, rpm: least effects that count where a result has no error
MOST_NAMED, MOST_GROUPS = 6, 3  # shifts and groups of them that are named in a sentence
FILL = 0.4  # s, a usual fill, for a shift whose own is not known
SHARES = ("friction_change", "line_done")  # keys that follow from others
UNITS = {"m": "m", "m3": "m3", "degc": "degC", "nm": "Nm"}  # unit of a value by the last word of its key


@dataclass(frozen=True)
class Moment:
    """What is noted of a rig at an order: temperature of the oil [degC]; by clutch, piston [m], plates [degC], empty line [m3]."""

    oil: float | None
    pistons: Mapping[str, float | None]
    plates: Mapping[str, float | None]
    empty: Mapping[str, float] = field(default_factory=dict)


def fields(structure: Structure) -> dict[str, list[str]]:
    """Return the message fields that are read, by topic."""
    clutches = {f"/{one.name}/state": CLUTCH_FIELDS for one in structure.clutches if parts.part(one.part).message == "ClutchState"}
    return clutches | {f"/{one.name}/state": OIL_FIELDS for one in structure.of_role(parts.OIL)}


def put_states(bag: Bag | Gathered, record: Mapping, box: Transmission, rows: Iterable[dict]) -> None:
    """Put the state at its order into each row of metrics of a simulated run, under ``at_order``.

    Parameters
    ----------
    bag : Bag or Gathered
        The run, with the true states of its plant; what it does not hold is left out.
    record : mapping
        Record of the rig.
    box : Transmission
        Its transmission.
    rows : iterable of dict
        Rows of shift.shift_metrics.
    """
    structure = structure_of(record["structure"])
    series: dict[str, tuple[np.ndarray, list[np.ndarray]]] = {}
    for topic, names in fields(structure).items():
        try:
            series[topic] = bag.fields(topic, names)
        except RigError:
            continue  # not recorded, or a bag of another version

    def last(topic: str, column: int, t: float) -> float | None:
        times, values = series.get(topic, (np.empty(0), []))
        at = int(np.searchsorted(times, t + 1e-9, side="right")) - 1
        return float(values[column][at]) if at >= 0 else None

    over = {}
    for clutch in box.clutches:
        pack = _pack(structure, record, clutch.instance)
        if clutch.state in series and pack.get("heat_capacity") and (record.get("effects") or {}).get("plate_heat"):
            times, (_, heat, _) = series[clutch.state]
            over[clutch.state] = times, [above_the_oil(times, heat, pack["heat_capacity"], pack["cooling"])]
    oil_topics = [f"/{one.name}/state" for one in structure.of_role(parts.OIL)]
    for row in rows:
        t = row["t_order_s"]
        oil = next((found for topic in oil_topics if (found := last(topic, 0, t)) is not None), None)
        pistons, plates, empty = {}, {}, {}
        for clutch in box.shift(row["from_gear"], row["to_gear"]).engaging:
            pistons[clutch.name] = last(clutch.state, 0, t)
            if clutch.state in series:
                times, (_, _, pressure) = series[clutch.state]
                empty[clutch.name] = _empty(times, pressure, t, record[clutch.instance])
            if clutch.state in over and oil is not None:
                times, (values,) = over[clutch.state]
                at = int(np.searchsorted(times, t + 1e-9, side="right")) - 1
                plates[clutch.name] = oil + float(values[at]) if at >= 0 else None
        row["at_order"] = state(record, box, Moment(oil, pistons, plates, empty))


def _empty(times: np.ndarray, pressure: np.ndarray, t: float, values: Mapping) -> float:
    """Return the empty part of a clutch's line [m3] at a time, by how long it had no pressure; a line begins empty."""
    most = float(values.get("drained_volume", 0.0))
    under = np.flatnonzero(pressure[: int(np.searchsorted(times, t + 1e-9, side="right"))] > NO_PRESSURE)
    return most * -math.expm1((times[under[-1]] - t) / values["drain_time"]) if most and under.size else most


def put_known(record: Mapping, box: Transmission, rows: Iterable[dict], known: Mapping[float, Moment]) -> None:
    """Put the states that were noted at the orders into rows of metrics, as :func:`put_states` does from a bag.

    Parameters
    ----------
    record, box, rows
        As of :func:`put_states`.
    known : mapping of float to Moment
        What was noted, by the time of the order [s].
    """
    for row in rows:
        if (moment := known.get(row["t_order_s"])) is not None:
            engaging = [clutch.name for clutch in box.shift(row["from_gear"], row["to_gear"]).engaging]
            known_of = (
                {name: one[name] for name in engaging if name in one} for one in (moment.pistons, moment.plates, moment.empty)
            )
            row["at_order"] = state(record, box, Moment(moment.oil, *known_of))


def state(record: Mapping, box: Transmission, moment: Moment) -> dict[str, Any]:
    """Return the state at an order as plain values, without what is not known.

    Parameters
    ----------
    record : mapping
        Record of the rig.
    box : Transmission
        Its transmission.
    moment : Moment
        What is known of the engaging clutches.

    Returns
    -------
    dict
        ``oil_degc``, and ``clutches`` by name: ``piston_m``, ``filled_m3`` (volume that the piston holds), ``fill_done`` (share of
        the travel to the kiss point), ``line_m3`` and ``line_done`` (oil that has not yet run out of a line that does without
        pressure, and its share of all oil up to the kiss point), ``plates_degc`` and ``friction_change`` (share by which the
        plates' heat changes their friction from that at the oil's temperature).
    """
    structure, found = structure_of(record["structure"]), {}
    for clutch in box.clutches:
        one: dict[str, float] = {}
        values, pack = record[clutch.instance], _pack(structure, record, clutch.instance)
        piston, warm, oil = moment.pistons.get(clutch.name), moment.plates.get(clutch.name), moment.oil
        if piston is not None and "clearance" in values:
            one |= {
                "piston_m": piston,
                "filled_m3": piston * float(values["piston_area"]),
                "fill_done": piston / float(values["clearance"]),
            }
            if drained := float(values.get("drained_volume", 0.0)):
                one["line_m3"] = drained - moment.empty.get(clutch.name, drained)
                one["line_done"] = one["line_m3"] / (drained + float(values["piston_area"] * values["clearance"]))
        if warm is not None and oil is not None:
            one |= {"plates_degc": warm, "friction_change": float(pack.get("friction_per_kelvin", 0.0)) * (warm - oil)}
        if one:
            found[clutch.name] = one
    return ({} if moment.oil is None else {"oil_degc": moment.oil}) | {"clutches": found}


def _pack(structure: Structure, record: Mapping, clutch: str) -> Mapping:
    """Return the values of a clutch's plates; empty for one without."""
    return record.get(str(structure.device(clutch).wires.get("plates")), {})


def flat(row: Mapping) -> dict[str, float]:
    """Return the values of a row's state at its order by names such as ``at_order.S2.piston_m``, for a table.

    The plates' temperature is rounded to 0.1 K, within which that by their heat in a bag is that of the plant.
    """
    found = row.get("at_order") or {}
    named = {f"at_order.{key}": value for key, value in found.items() if key != "clutches"}
    for name, one in found.get("clutches", {}).items():
        known = one | ({"plates_degc": round(one["plates_degc"], 1)} if "plates_degc" in one else {})
        named |= {f"at_order.{name}.{key}": value for key, value in known.items() if key not in SHARES}
    return named


def unit_of(name: str) -> str | None:
    """Return the unit of a value of :func:`flat` by its name; None for a share."""
    return UNITS.get(name.rpartition("_")[2])


# ---- in words


def _saved(row: Mapping, clutch: Mapping, share: str = "fill_done") -> float:
    """Return the time by which oil of before shortens the fill of a shift [s], by its kiss point or that of a usual one."""
    done = min(max(clutch.get(share, 0.0), 0.0), 0.9)
    filled = row.get("kiss_s") or row.get("t_c_s") or FILL
    return filled * done / (1.0 - done)


def _least(rows: Iterable[tuple[Mapping, Mapping]]) -> tuple[float, float, float]:
    """Return the least time [s], share of friction and change of speed [rpm] that count, by the errors of some rows."""
    times, shares, speeds = [LEAST_TIME], [LEAST_FRICTION], [LEAST_SPEED]
    for row, errors in rows:
        times.append(errors.get("t_c_s", 0.0))
        speeds.append(errors.get("input_speed_rpm", 0.0))
        if peak := row.get("input_torque_max_nm"):
            shares.append(errors.get("input_torque_max_nm", 0.0) / abs(peak))
    return max(times), max(shares), max(speeds)


def begun(row: Mapping, errors: Mapping[str, float], box: Transmission) -> str:
    """Return what was not at rest when a shift was ordered; empty when nothing was that its results show.

    Parameters
    ----------
    row : mapping
        Its metrics, with the state at its order.
    errors : mapping of str to float
        Largest errors of its metrics.
    box : Transmission
        The transmission.
    """
    time, share, speed = _least([(row, errors)])
    parts_of = []
    for name, one in (row.get("at_order") or {}).get("clutches", {}).items():
        if _saved(row, one) > time:
            way = f"{100.0 * one['fill_done']:.0f} % of the way to its kiss point"
            parts_of.append(f"piston of {name} {1e3 * one['piston_m']:.1f} mm off its stop, {way}")
        if _saved(row, one, "line_done") > time:
            parts_of.append(f"{1e6 * one['line_m3']:.1f} cm3 of oil still in the line of {name}, which runs empty in a pause")
        if abs(one.get("friction_change", 0.0)) > share:
            parts_of.append(f"plates of {name} at {one['plates_degc']:.0f} degC, friction {100.0 * one['friction_change']:+.1f} %")
    change = row.get("input_speed_change_rpm")
    if change is not None and abs(change) > speed:
        parts_of.append(f"{box.input.speed} changed by {change:+.1f} rpm in the 0.2 s before")
    return "; ".join(parts_of)


def begun_lines(names: Sequence[str], rows: Sequence[Mapping], errors: Sequence[Mapping], box: Transmission) -> list[str]:
    """Return a line for each shift of a run that did not begin at rest, and for shifts of one way that began differently."""
    known = [errors[i] if i < len(errors) else {} for i in range(len(rows))]
    lines = [f"{name} did not begin at rest: {text}" for name, row, of in zip(names, rows, known) if (text := begun(row, of, box))]
    return lines + unlike([(str(number), row, of) for number, (row, of) in enumerate(zip(rows, known), 1)], box)


def unlike(shifts: Iterable[tuple[str, Mapping, Mapping]], box: Transmission, what: str = "shifts") -> list[str]:
    """Return a sentence for each state in which shifts of one way differed at their orders, by more than their results' errors.

    Parameters
    ----------
    shifts : iterable of (str, mapping, mapping)
        What each shift is called in a sentence, its metrics, and their largest errors.
    box : Transmission
        The transmission.
    what : str
        What the names are of, in the plural.
    """
    ways: dict[tuple[int, int], list[tuple[str, Mapping, Mapping]]] = {}
    for one in shifts:
        ways.setdefault((one[1]["from_gear"], one[1]["to_gear"]), []).append(one)
    lines = []
    for way, members in ways.items():
        time, share, _ = _least([(row, errors) for _, row, errors in members])
        found: list[str] = []
        for clutch in box.shift(*way).engaging:
            states = [(name, row, (row.get("at_order") or {}).get("clutches", {}).get(clutch.name, {})) for name, row, _ in members]
            pistons = [(name, _saved(row, one), 1e3 * one["piston_m"]) for name, row, one in states if "piston_m" in one]
            found += _apart(f"travel of the piston of {clutch.name}", pistons, time, "mm", 1, "t_c and E_loss depend on it")
            lines_of = [
                (name, _saved(row, one, "line_done"), 1e6 * one["line_m3"]) for name, row, one in states if "line_m3" in one
            ]
            found += _apart(f"oil left in the line of {clutch.name}", lines_of, time, "cm3", 1, "t_c and E_loss depend on it")
            plates = [(name, one["friction_change"], one["plates_degc"]) for name, _, one in states if "plates_degc" in one]
            found += _apart(f"plates of {clutch.name}", plates, share, "degC", 0, "their friction depends on it")
        advice = ["pause longer before the order"] if found else []
        oils = [(name, row["at_order"]["oil_degc"]) for name, row, _ in members if "oil_degc" in (row.get("at_order") or {})]
        least = 2.0 * temperature_error(max((value for _, value in oils), default=0.0))
        found += _apart("oil", [(name, value, value) for name, value in oils], least, "degC", 0, "fill and drag depend on it")
        if found:
            lines.append(f"{what} {box.way(*way)} began in different states: {'; '.join([*found, *advice])}")
    return lines


def _apart(subject: str, states: Sequence[tuple[str, float, float]], least: float, unit: str, digits: int, why: str) -> list[str]:
    """Return the clause on a state (name, effect, shown value) of some shifts, when their effects differ by more than ``least``."""
    effects = [effect for _, effect, _ in states]
    if not effects or max(effects) - min(effects) <= least:
        return []
    groups: list[list[int]] = []  # places of states, with gaps of more than that between the groups
    for k in sorted(range(len(states)), key=lambda k: effects[k]):
        if not groups or effects[k] - effects[groups[-1][-1]] > least:
            groups.append([])
        groups[-1].append(k)
    if not 1 < len(groups) <= MOST_GROUPS:
        ends = [groups[0][0], groups[-1][-1]]
        return [f"{subject} {' to '.join(f'{states[k][2]:z.{digits}f} {unit} (in {states[k][0]})' for k in ends)}, and {why}"]
    clauses = []
    for group in groups:
        values = list(dict.fromkeys(f"{states[k][2]:z.{digits}f}" for k in (group[0], group[-1])))
        clauses.append(f"{' to '.join(values)} {unit} in {_names([states[k][0] for k in sorted(group)])}")
    return [f"{subject} {', '.join(clauses)}, and {why}"]


def _names(names: Sequence[str]) -> str:
    shown = ", ".join(names[:MOST_NAMED])
    return f"{shown} and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else shown
