# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The trips that every rig has besides those of its limits (rig.trips): rules of the bench, which nobody can set.

Whatever brings a rig into its safe state gives one of their names with its reason; messages and bags hold the reason alone.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..base import COMMAND_TIMEOUT
from ..plant import ERRATIC
from .trip import FIRST_SPN, THERE, summary_row

if TYPE_CHECKING:
    from .configuration import RigConfig

RED_BUTTON = "e_stop"  # a person pressed the red button
NO_COMMAND, BAD_CONTROLLER = "controller_silent", "controller_failed"  # its commands are too old; it cannot go on
NO_ANSWER, PROCESS_LOST = (
    "device_silent",
    "process_lost",
)  # a device outside the plant does not answer; a process of the graph is gone
ENDED_EARLY = "ended_early"  # somebody ended the run before its sequence was done
STOOD_STILL = "stood_still"  # in real time, the rig made no sample for longer than any controller may be silent
NO_NUMBER, UNSETTLED = "no_finite_number", "not_settled"  # the plant could not be moved
STATUS = "rig_"  # how names of events on the status of a rig begin
TRIPPED, WARNING = f"{STATUS}tripped", f"{STATUS}warning"  # names of the events of a trip, and of one that is near
RESET_EVENT = "reset"  # name of the event of a person's reset; that of the red button is RED_BUTTON
LATE, BAD_DEVICE = 9, 12  # failure mode identifiers: abnormal update rate, bad intelligent device
BENCH_SPN = FIRST_SPN + 1920  # of the first rule, whose numbers stay whatever a rig has; those of faults follow
_TRIP = re.compile(r"\btrip ([^\s:,]+)")


@dataclass(frozen=True)
class Rule:
    """A trip without a limit that one can set.

    Parameters
    ----------
    name : str
        Its name.
    quantity, criterion, threshold, enabled : str
        What is watched, and while what.
    fmi : int
        Failure mode identifier of SAE J1939-73.
    reason : str
        Regular expression that its reasons contain, and those of no other trip.
    spn : int
        Suspect parameter number.
    """

    name: str
    quantity: str
    criterion: str
    threshold: str
    enabled: str
    fmi: int
    reason: str
    spn: int

    def row(self) -> dict[str, str]:
        """Return the row of the summary table."""
        never = {"delay": "0 ms", "hysteresis": "none", "warning": "none"}
        what = {"quantity": self.quantity, "criterion": self.criterion, "threshold": self.threshold}
        criteria = {**what, "enabled while": self.enabled, **never}
        return summary_row(self.name, criteria, self.spn, self.fmi, "rule of the bench")


RULES = {
    rule.name: rule
    for rule in (
        Rule(RED_BUTTON, "red button", "is", "pressed", "always", THERE, r"^emergency stop$", BENCH_SPN),
        Rule(
            *(NO_ANSWER, "answers of a device outside the plant", "is", "none in time", "a device is a node of its own"),
            *(LATE, r"^\S+: (no answer on|nobody sends) ", BENCH_SPN + 1),
        ),
        Rule(
            *(PROCESS_LOST, "processes of the graph", "is", "one gone", "on the graph", BAD_DEVICE),
            *(r"^(container: |\w+ (killed by signal|ended)\b|the process of rig run)", BENCH_SPN + 2),
        ),
        Rule(
            *(STOOD_STILL, "time between two samples, or between two signs of the recorder", "above", "1 s"),
            *("on the graph, in real time", LATE, r"^the \w+ (stood|stands) still for ", BENCH_SPN + 3),
        ),
        Rule(
            *(ENDED_EARLY, "end of the run", "is", "before its sequence is done", "always", THERE),
            *(r"^the (run|rig) was ended ", BENCH_SPN + 4),
        ),
        Rule(
            *(NO_NUMBER, "every value of the plant", "is", "no finite number", "always", ERRATIC),
            *(r", which is no finite number", BENCH_SPN + 5),
        ),
        Rule(
            *(UNSETTLED, "friction of clutches and brakes", "is", "not settled within a step", "always", ERRATIC),
            *(r"did not settle within a step", BENCH_SPN + 6),
        ),
        Rule(
            *(NO_COMMAND, "age of the newest valve command", "above", f"{COMMAND_TIMEOUT * 1e3:g} ms"),
            *("the shift controller is a program of its own", LATE),
            *(r"^(valve commands older than|none of the first \d+ samples) ", BENCH_SPN + 7),
        ),
        Rule(
            *(BAD_CONTROLLER, "answers of the shift controller", "is", "an error, no finite number, or none any more", "always"),
            *(BAD_DEVICE, r"^(controller |the shift controller)", BENCH_SPN + 8),
        ),
    )
}
OF_CONTROLLERS = (NO_COMMAND, BAD_CONTROLLER)


def bench_trips(config: RigConfig) -> tuple[Rule, ...]:
    """Return the rules of the bench that a rig has."""
    return tuple(rule for rule in RULES.values() if config.structure.shifts or rule.name not in OF_CONTROLLERS)


def trips_named(reason: str) -> list[str]:
    """Return the names of the trips that a reason is of: several that fired in the same sample, none of a reason not known."""
    if reason.startswith("trip "):
        return _TRIP.findall(reason)
    return [rule.name for rule in RULES.values() if re.search(rule.reason, reason)][:1]
