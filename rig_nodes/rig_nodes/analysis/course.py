# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The course of a shift from its order until the input torque has settled, which the verdict judges and the plots show.

analysis.metrics fills a row with it. The thesis's own highest torque and lowest speed end at lock-up; a shift does not.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .clutch_torques import split_by_logger

if TYPE_CHECKING:
    from ..rig.transmission import Transmission
    from .metrics import _Shift

COURSE_KEYS = (
    "input_torque_high_nm",
    "t_high_s",
    "input_torque_low_nm",
    "t_low_s",
    "reversed_s",
    "output_speed_low_rpm",
    "interrupted_s",
    "input_torque_at_least_nm",
    "course_s",
)
LEAST_TORQUE = 10.0  # Nm, ten errors of the torque meter, below which a load has no clear sign and a ratio of torques no meaning
CLEAR = 2.0  # Nm by which a torque must pass zero, or its level: twice the torque meter's largest error
LEVEL = 20e-3  # s over which the level at the end is taken


def fill_course(row: dict, shift: _Shift, last: int) -> None:
    """Put the extremes from the order to a sample into a row, with the torques of both clutches at those of the input torque.

    A time stays None, without a reason, when the torque does not pass its levels before and behind the shift. ``reversed_s`` is
    None without a load. Neither it nor the lowest speed has a meaning in a change of direction.

    Parameters
    ----------
    row : dict
        The row of metrics.shift_metrics.
    shift : _Shift
        The shift.
    last : int
        The last sample: where the torque has settled, or where the search for the shift ends.
    """
    box, part = shift.box, slice(shift.order, last + 1)
    torque, raw = shift.smooth[box.input.torque][part], shift.raw[box.input.torque]
    levels = shift.before(box.input.torque), float(np.mean(raw[max(shift.order, last + 1 - shift.samples(LEVEL)) : last + 1]))
    high, low = int(torque.argmax()), int(torque.argmin())
    row["input_torque_high_nm"], row["input_torque_low_nm"] = float(torque[high]), float(torque[low])
    row["torques"] = {}
    for name, at, clear in (("high", high, torque[high] - max(levels)), ("low", low, min(levels) - torque[low])):
        if clear > CLEAR:
            row[f"t_{name}_s"] = at * shift.period
            row["torques"][name] = split_by_logger(shift, shift.order + at)
    if box.turns_round(row["from_gear"], row["to_gear"]):
        return
    if (asked := asked_of_input(row, box)) is not None:
        row["reversed_s"] = float(np.count_nonzero(np.sign(asked) * torque < -CLEAR) * shift.period)
    row["output_speed_low_rpm"] = shift.lowest(shift.order, last) * 30.0 / np.pi


def asked_of_input(row: dict, box: Transmission, least: bool = False) -> float | None:
    """Return the torque that the load asks of the input [Nm], in the gear that asks more of it.

    The load is the output torque before the order; losses are not counted.

    Parameters
    ----------
    row : dict
        The row of metrics.shift_metrics.
    box : Transmission
        The transmission.
    least : bool
        True for the gear that asks less.

    Returns
    -------
    float or None
        The torque; None for a load that is not known or asks less than LEAST_TORQUE in the gear that asks more.
    """
    load = row["output_torque_nm"]
    ratios = [box.ratios[gear] for gear in (row["from_gear"], row["to_gear"]) if gear in box.ratios]
    if load is None or not ratios:
        return None
    sizes = [abs(ratio) for ratio in ratios]
    most = np.sign(ratios[0]) * load / min(sizes)
    return None if abs(most) <= LEAST_TORQUE else float(most * (min(sizes) / max(sizes) if least else 1.0))
