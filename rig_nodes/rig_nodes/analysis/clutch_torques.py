# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the releasing and the engaging clutch carry at one instant of a shift, reduced to the input shaft.

The verdict's reasons follow from it (analysis.causes). A simulated run records the torque of each clutch; in a measured one it is
what the balances of both shafts leave, with an error that the losses and the accelerations make large.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..base import RigError
from .clutch_pressures import pressed

if TYPE_CHECKING:
    from collections.abc import Mapping

    from ..bags import Bag
    from ..rig import Transmission
    from .gathered import Gathered
    from .shift import CutShift

STATE = ("torque", "slip")
SHAFTS, SPEEDS = "/gearbox/state", ("speed_in", "speed_out")
# s; an acceleration is taken over SLOPE around the instant, which a shaft's swing of some 60 Hz asks for, or the LEAST rows of a
# slower logger up to SLOWEST; next to lock-up, which is a corner, up to CORNER before that
CORNER, SLOPE, SLOWEST, LEAST = 0.5e-3, 2e-3, 8e-3, 4
LEAST_SLIP = 1.0  # rad/s of a gear at the input, from which it shows the ratio between a clutch's torque and the input's
TORQUE_ERROR = 1.01  # Nm, thesis tab. 7.1


def split_by_logger(shift: CutShift, at: int) -> dict[str, float] | None:
    """Return the torques of both clutches from the logger's channels.

    With ``a`` and ``b`` the ratios of both gears, the torques A and B that their clutches pass on from the input shaft satisfy
    A + B = M_in - J_w dw_in/dt and a A + b B = M_out + J dw_out/dt + loss; J_w are the wheels behind the input's meter, the loss is
    that before the order. A clutch whose pressure lies below its kiss pressure carries nothing, which needs no second balance.

    Parameters
    ----------
    shift : CutShift
        The shift.
    at : int
        The sample.

    Returns
    -------
    dict or None
        ``releasing``, ``engaging`` and their largest ``error`` [Nm], and the accelerations ``input_rate`` and ``output_rate``
        [rad/s2]; None from neutral and next to the order.
    """
    box, corner, span = shift.box, shift.samples(CORNER), max(LEAST, shift.samples(SLOPE))
    if shift.old is None or at - corner - span < 0 or span * shift.period > SLOWEST:
        return None
    behind = min(at + span // 2, shift.raw[box.input.speed].size)
    if shift.end is not None and at - span // 2 - corner <= shift.end:
        behind = min(behind, shift.end - corner)
    part = slice(behind - span, behind)
    a, b = box.ratios[shift.old], box.ratios[shift.new]
    carried = float(shift.smooth[box.input.torque][at])
    of_input, growth = (
        float(np.polyfit(shift.period * np.arange(span), shift.raw[end.speed][part], 1)[0]) for end in (box.input, box.output)
    )
    rates = {"input_rate": of_input, "output_rate": growth}
    for clutches, empty, full in (
        (shift.shift.engaging, "engaging", "releasing"),
        (shift.shift.releasing, "releasing", "engaging"),
    ):
        if clutches and not pressed(shift, clutches)[at - shift.order]:
            return {full: carried, empty: 0.0, "error": TORQUE_ERROR, **rates}
    loss = a * shift.before(box.input.torque) - shift.before(box.output.torque)
    into, out = (float(np.mean(shift.raw[end.torque][part])) for end in (box.input, box.output))
    swung = box.inertias.wheels * of_input
    into, carried = into - swung, carried - swung
    engaging = (a * into - out - loss - box.inertias.on_output * growth) / (a - b)
    error = (abs(loss) + TORQUE_ERROR * (abs(a) + 1.0)) / abs(a - b)
    return {"releasing": carried - engaging, "engaging": engaging, "error": error, **rates}


def put_torques(bag: Bag | Gathered, rows: list[dict], box: Transmission) -> None:
    """Replace the torques of rows by those that a simulated run has recorded; a bag without them leaves the rows as they are.

    Parameters
    ----------
    bag : Bag or Gathered
        The recording.
    rows : list of dict
        Rows of shift.shift_metrics.
    box : Transmission
        The transmission.
    """
    try:
        known = {clutch.name: bag.fields(clutch.state, list(STATE)) for clutch in box.clutches} if rows else {}
        t, speeds = bag.fields(SHAFTS, list(SPEEDS)) if rows else (np.empty(0), [])
    except RigError:
        return  # a bag of another version
    if not len(t) or not all(len(one[0]) for one in known.values()):
        return
    for row in rows:
        moved = box.shift(row["from_gear"], row["to_gear"])
        if not row.get("torques") or len(moved.engaging) > 1 or len(moved.releasing) > 1:
            continue  # with two clutches for one gear, a torque of one is no torque of the gear
        for name in row["torques"] if box.changes(row["from_gear"], row["to_gear"]) else ():
            at, carried = row["t_order_s"] + row[f"t_{name}_s"], row[f"input_torque_{name}_nm"]
            found = {
                role: reduced
                for role, those, gear in (
                    ("releasing", moved.releasing, row["from_gear"]),
                    ("engaging", moved.engaging, row["to_gear"]),
                )
                for one in those
                if (reduced := _reduced(known[one.name], box.ratios[gear], (t, *speeds), row["t_order_s"], at)) is not None
            }
            if found:
                row["torques"][name] = (row["torques"][name] or {}) | _nearest(found, carried)


def _reduced(
    state: tuple[np.ndarray, list[np.ndarray]], ratio: float, shafts: tuple[np.ndarray, ...], order: float, at: float
) -> np.ndarray | None:
    """Return a clutch's torque reduced to the input, at the states before and behind an instant [Nm]; None where it never slips."""
    t, (torque, slip) = state
    near = np.flatnonzero((t > order - 0.2) & (t < at + 0.2))
    w_in, w_out = (np.interp(t[near], shafts[0], one) for one in shafts[1:])
    lever = lever_of(slip[near], w_in - ratio * w_out)
    if lever is None:
        return None
    behind = min(max(int(np.searchsorted(t, at)), 1), len(t) - 1)
    return lever * torque[behind - 1 : behind + 1]


def lever_of(slip: np.ndarray, of_gear: np.ndarray) -> float | None:
    """Return the factor from a clutch's torque to that at the input shaft; None where the clutch never slips.

    Its power is torque times slip in the clutch and torque times slip of the gear at the input shaft, so the ratio of the slips,
    taken where they are largest around the shift, is that of the torques.

    Parameters
    ----------
    slip, of_gear : (n,) array of float
        Slip of the clutch and of its gear at the input shaft [rad/s], at the same times.
    """
    widest = int(np.abs(of_gear).argmax())
    return None if abs(of_gear[widest]) < LEAST_SLIP else float(slip[widest] / of_gear[widest])


def _nearest(found: Mapping[str, np.ndarray], carried: float) -> dict[str, float]:
    """Return the torques at the state whose sum comes nearest to the input torque; the rest is of the gear without one."""
    both = np.sum(list(found.values()), axis=0)
    at = int(np.abs(both - carried).argmin())
    out = {role: float(values[at]) for role, values in found.items()}
    for role in ("releasing", "engaging"):
        out.setdefault(role, carried - float(both[at]))
    return {**out, "error": 0.0}
