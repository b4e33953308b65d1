# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The course of a shift from its order until the input torque has settled, which the verdict judges and the plots show.

analysis.shift finds it. The thesis's own highest torque and lowest speed end at lock-up; a shift does not.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from .clutch_torques import split_by_logger

if TYPE_CHECKING:
    from collections.abc import Mapping

    from ..rig import Transmission
    from .shift import CutShift

LEAST_TORQUE = 10.0  # Nm, ten errors of the torque meter, below which a load has no clear sign and a ratio of torques no meaning
CLEAR = 2.0  # Nm by which a torque must pass zero, or its level: twice the torque meter's largest error
LEVEL = 20e-3  # s over which the level at the end is taken


@dataclass(frozen=True)
class Course:
    """The course of a shift.

    Attributes
    ----------
    extremes : dict of str to float
        Highest and lowest input torque [Nm] under ``high`` and ``low``.
    times : dict of str to float
        When they were, from the order on [s]; without one that does not pass the torque's levels before and behind the shift.
    torques : dict of str to dict or None
        The torques of both clutches at those times.
    reversed : float or None
        Time in which the torque acts against the load [s]; None without a load and in a change of direction.
    lowest : float or None
        Lowest output speed [rpm]; None in a change of direction.
    """

    extremes: dict[str, float]
    times: dict[str, float]
    torques: dict[str, dict[str, float] | None]
    reversed: float | None = None
    lowest: float | None = None


def course_of(shift: CutShift) -> Course:
    """Return the course from the order to the last sample: where the torque has settled, or where the search for the shift ends.

    Parameters
    ----------
    shift : CutShift
        The shift.
    """
    box, part = shift.box, slice(shift.order, shift.last + 1)
    torque, raw = shift.smooth[box.input.torque][part], shift.raw[box.input.torque]
    behind = slice(max(shift.order, part.stop - shift.samples(LEVEL)), part.stop)
    levels = shift.before(box.input.torque), float(np.mean(raw[behind]))
    high, low = int(torque.argmax()), int(torque.argmin())
    found = Course({"high": float(torque[high]), "low": float(torque[low])}, {}, {})
    for name, at, clear in (("high", high, torque[high] - max(levels)), ("low", low, min(levels) - torque[low])):
        if clear > CLEAR:
            found.times[name] = at * shift.period
            found.torques[name] = split_by_logger(shift, shift.order + at)
    if shift.turns_round:
        return found
    gears = {"from_gear": shift.shift.from_gear, "to_gear": shift.new, "output_torque_nm": shift.before(box.output.torque)}
    asked = asked_of_input(gears, box)
    against = None if asked is None else float(np.count_nonzero(np.sign(asked) * torque < -CLEAR) * shift.period)
    return replace(found, reversed=against, lowest=shift.lowest(part) * 30.0 / np.pi)


def asked_of_input(row: Mapping, box: Transmission, least: bool = False) -> float | None:
    """Return the torque that the load asks of the input [Nm], in the gear that asks more of it.

    The load is the output torque before the order; losses are not counted.

    Parameters
    ----------
    row : mapping
        The row of shift.shift_metrics.
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
