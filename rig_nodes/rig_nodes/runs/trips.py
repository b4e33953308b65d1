# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The trips that every rig has besides those of its limits (rig.trips), by name, and the sentences of a plant that cannot be moved.

Whatever brings a rig into its safe state gives one of these names with its reason.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..base import COMMAND_TIMEOUT, Floats, RigError
from ..rig import REACTION, RESET

if TYPE_CHECKING:
    from ..rig import RigConfig

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


OF_CONTROLLERS = {  # quantity, criterion and threshold of what is watched, and while
    NO_COMMAND: (
        "age of the newest valve command",
        "above",
        f"{COMMAND_TIMEOUT * 1e3:g} ms",
        "the shift controller is a program of its own",
    ),
    BAD_CONTROLLER: ("answers of the shift controller", "is", "an error, no finite number, or none any more", "always"),
}
OF_ALL = {
    RED_BUTTON: ("red button", "is", "pressed", "always"),
    NO_ANSWER: ("answers of a device outside the plant", "is", "none in time", "a device is a node of its own"),
    PROCESS_LOST: ("processes of the graph", "is", "one gone", "on the graph"),
    STOOD_STILL: ("time between two samples, or between two signs of the recorder", "above", "1 s", "on the graph, in real time"),
    ENDED_EARLY: ("end of the run", "is", "before its sequence is done", "always"),
    NO_NUMBER: ("every value of the plant", "is", "no finite number", "always"),
    UNSETTLED: ("friction of clutches and brakes", "is", "not settled within a step", "always"),
}


def trips_without_limits(config: RigConfig) -> list[dict[str, str]]:
    """Return the trips of a rig that have no limit one can set, as rows like those of ``Trip.row``."""
    shifts = OF_CONTROLLERS if config.structure.shifts else {}
    return [
        {
            "trip": name,
            "quantity": quantity,
            "criterion": criterion,
            "threshold": threshold,
            "enabled while": enabled,
            "delay": "0 ms",
            "hysteresis": "none",
            "warning": "none",
            "reaction": REACTION,
            "reset": RESET,
            "SPN": "none",
            "FMI": "none",
            "source": "rule of the bench",
        }
        for name, (quantity, criterion, threshold, enabled) in {**OF_ALL, **shifts}.items()
    ]


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
