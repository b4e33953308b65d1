# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the highest input torque of a shift consists of: load, inertia, tie-up and losses, from the states of a simulated run.

The report has it, and the figure of a shift names the parts.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..base import RigError
from .clutch_torques import SHAFTS
from .course import asked_of_input

if TYPE_CHECKING:
    from collections.abc import Mapping

    from ..bags import Bag
    from ..rig import Transmission
    from .gathered import Gathered

FIELDS = ("loss_in", "loss_out")  # of the message of both shafts

PARTS = {"load": "load", "inertia": "inertia", "tie_up": "tie-up", "losses": "losses"}
MOST_ERROR = 0.15  # share of the torque from which what the parts leave makes them no result


def put_peaks(bag: Bag | Gathered, rows: list[dict], box: Transmission) -> None:
    """Add the parts of the highest torque to rows as ``peak``; a bag without the plant's states leaves the rows as they are.

    Parameters
    ----------
    bag : Bag or Gathered
        The recording.
    rows : list of dict
        Rows of shift.shift_metrics with the torques of clutch_torques.put_torques.
    box : Transmission
        The transmission.
    """
    try:
        t, shafts = bag.fields(SHAFTS, list(FIELDS)) if rows else (np.empty(0), [])
    except RigError:
        return  # a bag of another version
    for row in rows if len(t) else ():
        row["peak"] = parts_of_peak(row, box, (t, *shafts))


def parts_of_peak(row: Mapping, box: Transmission, shafts: tuple[np.ndarray, ...]) -> dict[str, float] | None:
    """Return the parts of the highest input torque.

    Let A and B be what both clutches pass on at the input, and a and b the ratios of their gears. Then
    M_in = A + B + loss_in + J_w dw_in/dt, where J_w are the wheels behind the input's meter, and at the output
    a A + b B = M_load + loss_out + J dw_out/dt. With r the ratio by which the torque gets there, A + B = (a A + b B) / r + tie_up.
    As long as both drive, r = (a A + b B) / (A + B) and tie_up = 0; when A opposes B, r = b and tie_up = A (1 - a / b). Hence
    M_in = (M_load + loss_out + J dw_out/dt) / r + J_w dw_in/dt + tie_up + loss_in. The load is that before the order, and J is
    the driven inertia of the energy equation (6.108). The losses and A, which change slowly, are those of the last recorded state
    before the instant, the accelerations those of the logger, and B is what the first equation leaves.

    Parameters
    ----------
    row : mapping
        Row of shift.shift_metrics, with ``torques`` of the plant's states and the logger's accelerations.
    box : Transmission
        The transmission.
    shafts : tuple of (n,) array
        Times [s], losses on input and output [Nm].

    Returns
    -------
    dict or None
        ``load_nm``, ``inertia_nm``, ``tie_up_nm``, ``losses_nm`` at the input shaft and ``error_nm``, by which their sum misses the
        torque. None in a change of direction, without a load that the input drives, and where the error is too large.
    """
    found, asked = (row.get("torques") or {}).get("high"), asked_of_input(row, box)
    ratios = [box.ratios.get(row[key]) for key in ("from_gear", "to_gear")]
    if found is None or asked is None or asked < 0.0 or None in ratios or box.turns_round(row["from_gear"], row["to_gear"]):
        return None
    t, loss_in, loss_out = shafts
    at = int(np.searchsorted(t, row["t_order_s"] + row["t_high_s"], "right")) - 1
    if at < 0 or "input_rate" not in found:
        return None
    of_wheels = box.inertias.wheels * found["input_rate"]
    total = row["input_torque_high_nm"] - of_wheels - loss_in[at]
    carried = (found["releasing"], total - found["releasing"])
    if total <= 0.0:
        return None
    (a, b), opposed = ratios, carried[0] * carried[1] < 0.0
    reached = a * carried[0] + b * carried[1]
    ratio = (b if carried[1] > 0.0 else a) if opposed else reached / total
    parts = {
        "load_nm": row["output_torque_nm"] / ratio,
        "inertia_nm": box.inertias.on_output * found["output_rate"] / ratio + of_wheels,
        "tie_up_nm": total - reached / ratio,
        "losses_nm": loss_in[at] + loss_out[at] / ratio,
    }
    error = abs(row["input_torque_high_nm"] - sum(parts.values()))
    known = error <= MOST_ERROR * abs(row["input_torque_high_nm"])
    return {**{name: float(value) for name, value in parts.items()}, "error_nm": float(error)} if known else None


def sentence_of_peak(row: Mapping) -> str:
    """Return the parts of a row's highest input torque in words; empty where they are not known."""
    found = row.get("peak")
    if not found:
        return ""
    parts = [f"{name} {found[f'{key}_nm']:.0f}" for key, name in PARTS.items() if abs(found[f"{key}_nm"]) >= 0.5]
    within = f"to within {max(found['error_nm'], 1.0):.0f}\u00a0Nm"
    return f"its highest {row['input_torque_high_nm']:.0f} Nm are {', '.join(parts[:-1])} and {parts[-1]}\u00a0Nm, {within}"
