# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Why the input torque of a shift was high or low, from what both clutches carried at that instant, and what to change.

analysis.quality adds it to its reasons. Torques are reduced to the input shaft; a positive one drives the output.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from ..rig import Clutch, Shift, Transmission
from .course import CLEAR, LEAST_TORQUE, asked_of_input

LOCKED = 2e-3  # s after lock-up from which the gear counts as engaged
TIED = 0.25  # share of the engaging clutch's torque from which that of the releasing one, which opposes it, is part of a cause
LEAST_TIME = 0.02  # s from which a part of a shift is a cause of its length
SWING = 0.3  # s after lock-up within which the course of the torque is still that of the shift


def cause(row: Mapping, box: Transmission, which: str) -> str:
    """Return the cause of the highest or the lowest input torque with its remedy; empty when the torques do not show one.

    With A and B the torques of both clutches, a and b the ratios of their gears and a the larger one, the input torque is
    A + B = (a A + b B) / b - A (a / b - 1). The first part reaches the output: it drives the load and accelerates it, it is small
    in a hole, and negative where a clutch brakes the output. The second part counts when A is negative while B is not: both gears
    are held at once, a tie-up, which can only raise the input torque. In a change of direction a / b is negative, and a tie-up is
    A and B of one sign. After lock-up neither clutch decides.

    Parameters
    ----------
    row : mapping
        Row of shift.shift_metrics, with ``torques`` and, where they are known, the ``errors`` of its metrics.
    box : Transmission
        The transmission.
    which : str
        ``high`` or ``low``.
    """
    found, asked = (row.get("torques") or {}).get(which), asked_of_input(row, box)
    at, reached = row[f"t_{which}_s"], row[f"input_torque_{which}_nm"]
    if found is None or asked is None or asked < 0.0 or at is None:
        return ""
    moved = box.shift(row["from_gear"], row["to_gear"])
    old, new = _named(moved.releasing, "the old gear"), _named(moved.engaging, "the new gear")
    releasing, engaging, clear = found["releasing"], found["engaging"], max(found["error"], LEAST_TORQUE)
    step = box.ratios[row["from_gear"]] / box.ratios[row["to_gear"]]
    opposed = step * releasing * engaging < 0.0 and min(abs(releasing), abs(engaging)) > clear  # at the output
    slower, step = (releasing, step) if abs(step) > 1.0 else (engaging, 1.0 / step)
    carried = f"{old} {_do(moved.releasing, 'carries')} {releasing:.0f} Nm and {new} {engaging:.0f} Nm"
    tied = f"{carried}, a tie-up: release {old} earlier or engage {new} later"
    if which == "low":
        return _cause_of_low(row, box, (releasing, engaging), clear, moved)
    if opposed and -slower * (step - 1.0) >= 0.5 * (reached - asked):
        return tied
    if row["t_c_s"] is not None and at > row["t_c_s"] + max(LOCKED, _error(row, "t_c_s", "t_high_s")):
        return _swing(row, at, moved.engaging, new)
    if engaging > max(releasing, asked, clear):
        against = f", {old} {_do(moved.releasing, 'brakes')} with {abs(releasing):.0f} Nm" if opposed else ""
        late = f"release {old} earlier and " if opposed and abs(releasing) > TIED * engaging else ""
        slips = f"{_do(moved.engaging, 'carries')} {engaging:.0f} Nm as {'it slips' if len(moved.engaging) < 2 else 'they slip'}"
        return f"{new} {slips}{against}: {late}{_softer(moved.engaging, new)}"
    return ""


def cause_of_time(row: Mapping, box: Transmission, limit: float) -> str:
    """Return why a shift took longer than a limit [s], with the remedy; empty where neither clutch alone decides it.

    A cause is what would have brought lock-up within the limit: the time for which the old gear holds the output after the new
    clutch has begun to carry, or that for which no clutch carries the load.
    """
    moved = box.shift(row["from_gear"], row["to_gear"])
    old, new = _named(moved.releasing, "the old gear"), _named(moved.engaging, "the new gear")
    kiss, left, none = row.get("kiss_s"), row.get("departure_s"), row.get("interrupted_s") or 0.0
    tied = kiss is not None and left is not None and (row.get("overlap_s") or 0.0) > _error(row, "overlap_s")
    held = left - kiss if tied else 0.0
    longest = max(held, none)
    if longest < LEAST_TIME or row["t_c_s"] - longest > limit:
        return ""
    if held > none:
        if held <= _error(row, "kiss_s", "departure_s"):
            return ""
        holds, begun = _do(moved.releasing, "holds"), "has" if len(moved.engaging) < 2 else "have"
        after = f"{1e3 * held:.0f} ms after {new} {begun} begun to carry"
        return f"{old} {holds} for {after}, a tie-up: release {old} earlier"
    return cause_of_dip(row, box)


def cause_of_dip(row: Mapping, box: Transmission) -> str:
    """Return for how long no clutch carried the load, with the remedy; empty for a shift in which the drive was not interrupted."""
    none = row.get("interrupted_s") or 0.0
    if none < max(LEAST_TIME, _error(row, "interrupted_s")):
        return ""
    moved = box.shift(row["from_gear"], row["to_gear"])
    old, new = _named(moved.releasing, "the old gear"), _named(moved.engaging, "the new gear")
    return f"for {1e3 * none:.0f} ms no clutch carries the load: engage {new} earlier or release {old} later"


def _cause_of_low(row: Mapping, box: Transmission, carried: tuple[float, float], clear: float, moved: Shift) -> str:
    (releasing, engaging), at = carried, row["t_low_s"]
    old, new = _named(moved.releasing, "the old gear"), _named(moved.engaging, "the new gear")
    if engaging < -clear:
        later = (
            f"engage {new} later, or " if releasing > max(clear, -TIED * engaging) else ""
        )  # no help once the old clutch is open
        brakes = f"{_do(moved.engaging, 'carries')} {engaging:.0f} Nm and {_do(moved.engaging, 'brakes')}"
        return f"{new} {brakes} the output: {later}{_softer(moved.engaging, new)}"
    if releasing < -clear:
        # where the drive was interrupted before, an earlier release would make that worse
        sooner = f"empty {old} faster" if cause_of_dip(row, box) else f"release {old} earlier"
        brakes = f"{_do(moved.releasing, 'carries')} {releasing:.0f} Nm and {_do(moved.releasing, 'brakes')}"
        return f"{old} {brakes} the output: {sooner}"
    if row["t_c_s"] is not None and at > row["t_c_s"] + max(LOCKED, _error(row, "t_c_s", "t_low_s")):
        return _swing(row, at, moved.engaging, new)
    load = row["output_torque_nm"]
    if math.copysign(1.0, load) * (box.ratios[row["from_gear"]] * releasing + box.ratios[row["to_gear"]] * engaging) < 0.9 * abs(
        load
    ):
        both = releasing + engaging
        carry = f"carry {both:.0f} Nm" if abs(both) > CLEAR else "carry nothing"
        return f"{old} and {new} together {carry}, a torque hole: engage {new} earlier or release {old} later"
    return ""


def _error(row: Mapping, *keys: str) -> float:
    """Return the largest error of a difference of metrics of a row, or of one of them; 0 where none is known."""
    errors = row.get("errors") or {}
    return sum(errors.get(key, 0.0) for key in keys)


def _do(clutches: tuple[Clutch, ...], verb: str) -> str:
    """Return a verb for clutches, given as for one."""
    return verb if len(clutches) < 2 else {"carries": "carry"}.get(verb, verb.removesuffix("s"))


def _named(clutches: tuple[Clutch, ...], else_: str) -> str:
    return " and ".join(clutch.name for clutch in clutches) or else_


def _softer(clutches: tuple[Clutch, ...], name: str) -> str:
    pressures = " and ".join(clutch.pressure for clutch in clutches if clutch.pressure)
    return f"let {pressures} rise more slowly" if pressures else f"engage {name} more slowly"


def _swing(row: Mapping, at: float, clutches: tuple[Clutch, ...], name: str) -> str:
    """Return the cause of an extreme behind lock-up; empty when it is so late that the drive or the load made it."""
    after = at - row["t_c_s"]
    if after > SWING or row["t_p_s"] is None or row["t_p_s"] <= _error(row, "t_p_s"):
        return ""
    drawn = row["t_p_s"] - (row.get("interrupted_s") or 0.0)
    return (
        f"{1e3 * after:.0f} ms after lock-up, as inertia swings on: the speeds were drawn together in {1e3 * drawn:.0f} ms; "
        f"{_softer(clutches, name)}"
    )
