# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The trips that every rig has besides those of its limits (rig.trips), by name, and the sentences of a plant that cannot be moved.

Whatever brings a rig into its safe state gives one of these names with its reason.
"""

from __future__ import annotations

import numpy as np

from ..base import Floats, RigError

RED_BUTTON = "e_stop"  # a person pressed the red button
NO_COMMAND, BAD_CONTROLLER = "controller_silent", "controller_failed"  # its commands are too old; it cannot go on
NO_ANSWER, PROCESS_LOST = (
    "device_silent",
    "process_lost",
)  # a device outside the plant does not answer; a process of the graph is gone
ENDED_EARLY = "ended_early"  # somebody ended the run before its sequence was done
STOOD_STILL = "stood_still"  # in real time, the rig made no sample for longer than any controller may be silent
NO_NUMBER, UNSETTLED = "no_finite_number", "not_settled"  # the plant could not be moved
WARNING = "rig_warning"  # name of the event of a trip that is near
FOLLOWING = (PROCESS_LOST, ENDED_EARLY)  # trips of a run that something else has ended already
SUMS = (": drawn", ": heat")  # endings of the names of values that several parts add to


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
