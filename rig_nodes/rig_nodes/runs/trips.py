# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the trips of a rig are to its runs: the rows of those without a limit, and the sentences of a plant that cannot be moved.

rig.trips and rig.bench_trips have the trips themselves.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..base import Floats, RigError
from ..rig import ENDED_EARLY, PROCESS_LOST, bench_trips

if TYPE_CHECKING:
    from ..rig import RigConfig

FOLLOWING = (PROCESS_LOST, ENDED_EARLY)  # trips of a run that something else has ended already
SUMS = (": drawn", ": heat")  # endings of the names of values that several parts add to


def trips_without_limits(config: RigConfig) -> list[dict[str, str]]:
    """Return the trips of a rig that have no limit one can set, as rows like those of ``Trip.row``."""
    return [rule.row() for rule in bench_trips(config)]


class Tripped(RigError):
    """A rig that went into its safe state, so that nothing can be measured; the message has the reason and the time."""

    exit_code = 1


def not_settled(when: str, driven: bool, worst: str) -> str:
    """Return the reason of a trip for friction that did not settle.

    Parameters
    ----------
    when : str
        The sample, in words.
    driven : bool
        True for a rig with tables that follow its motion.
    worst : str
        The element with the largest residual, with its values; empty where none stands out.

    Returns
    -------
    str
        The reason.
    """
    also = ", or what follows a table of the motion," if driven else ""
    least = f", least of all {worst}" if worst else ""
    return (
        f"{when} the friction of clutches and brakes{also} did not settle within a step{least}; a value of the rig is "
        "far from any real one, or its step too long"
    )


def not_finite(when: str, names: list[str], values: Floats) -> str:
    """Return the reason of a trip for a value that is no finite number.

    Parameters
    ----------
    when : str
        The sample, in words.
    names : list of str
        Names of the values.
    values : (n,) array of float
        The values; the reason names the first that is not finite, and a sum of what several parts give only where none of these is
        at fault.

    Returns
    -------
    str
        The reason.
    """
    first = min(np.flatnonzero(~np.isfinite(values)), key=lambda i: (names[i].endswith(SUMS), i))
    return (
        f"{names[first]} became {values[first]} {when}, which is no finite number; the plant stays where it was "
        "before, and a value of the rig is far from any real one"
    )
