# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""How the run of a bag ended, and whether the bag was cut off before that.

A bag of `rig run` or `rig simulate` ends with a metadata record of it. Its beginning (the library's name) says that there will be
one, so a bag without it was cut off: whoever led the run was killed. Other bags of a sequence show its end by its events.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..base import RigError

if TYPE_CHECKING:
    from .reader import Bag

RECORD_NAME = "rig_end"  # of the metadata record, which holds the fields of RunEnd
OF_RUN = " run"  # the library's name ends with it where that record will follow
OF_COPY = "rig_bag "  # that of `rig bag` begins with it: it writes parts of runs
NO_REPORT = "the run left no report"  # reason of an end that nobody has told
CUT_OFF = "cut off"  # state of a run whose bag ends before it
STOPPED = "stopped"  # state of a run whose recorder does not know why it was stopped
STATE, EVENTS = "/rig/state", "/sequencer/events"
WITHOUT_END = (None, "none", "fmu")  # sequences of runs that no event ends
_ENDS = {"sequence_done": "ended", "sequence_failed": "failed", "sequence_cancelled": "failed"}  # events of a sequence's end
NAMED = 3  # topics that a sentence names
_TRIPPED = 3  # RigState.TRIPPED


@dataclass(frozen=True)
class RunEnd:
    """How a run ended: ``state`` as in its report (ended, failed, tripped, interrupted), the reason, and the name of its trip."""

    state: str
    reason: str
    trip: str = ""

    def plain(self) -> dict[str, str]:
        """Return it as a report holds it, with the name of a trip only where there is one."""
        return {"state": self.state, "reason": self.reason} | ({"trip": self.trip} if self.trip else {})

    @classmethod
    def of(cls, record: Mapping[str, str]) -> RunEnd | None:
        """Return what a bag's record of the end says; None without one, and for a recorder that did not know."""
        state = record.get("state", STOPPED)
        return None if state == STOPPED else cls(state, record.get("reason", ""), record.get("trip", ""))


def end_of_run(bag: Bag) -> RunEnd | None:
    """Return how the run of a bag ended, by its record of it, else by its messages; None when neither shows it.

    Parameters
    ----------
    bag : Bag
        The bag, which needs only STATE and EVENTS.
    """
    return RunEnd.of(bag.end) or _by_messages(bag) or (RunEnd(STOPPED, bag.end.get("reason", "")) if bag.end else None)


def with_end(bag: Bag, run: dict) -> dict:
    """Return the run part of a report, with the end that the bag shows in place of none or of one that it denies.

    Parameters
    ----------
    bag : Bag
        The bag.
    run : dict
        The run part; a bad end in it stays where an earlier version wrote both, because it knew more than it put into the bag.
    """
    end = run.get("end")
    end = end if isinstance(end, dict) else {"reason": end or NO_REPORT}
    state, unknown = end.get("state"), end.get("reason") == NO_REPORT
    if state not in ("ended", CUT_OFF) and not unknown and not bag.library.endswith(OF_RUN):
        return run
    if sentence := cut_off(bag):
        return {**run, "end": {"state": CUT_OFF, "reason": sentence}}
    found = end_of_run(bag) if unknown else None
    return run if found is None else {**run, "end": found.plain()}


def faults_of(bag: Bag, run: dict) -> list[str]:
    """Return why the results of a bag may not be those of its run: it was cut off, or its messages are not as they were sent.

    Parameters
    ----------
    bag : Bag
        The bag, whole.
    run : dict
        The run part of its report (:func:`with_end`).
    """
    end, found = run.get("end"), []
    if isinstance(end, dict) and end.get("state") == CUT_OFF:
        found.append(end["reason"])
    if disorder := bag.disorder():
        more = f"; {len(disorder) - NAMED} topics more" if len(disorder) > NAMED else ""
        named = "; ".join(disorder[:NAMED])
        found.append(f"the bag's messages are not as they were sent: {named}{more}; `rig bag recover` puts them in order")
    return found + list(bag.false_blocks().values())


def _by_messages(bag: Bag) -> RunEnd | None:
    try:
        for _, topic, name, text, _ in reversed(bag.events()):
            if topic == EVENTS and name in _ENDS:
                return RunEnd(_ENDS[name], text)
        last = bag.newest(STATE)
        if last is not None and last.state == _TRIPPED:
            return RunEnd("tripped", last.reason)
    except (RigError, AttributeError):
        pass  # messages of another form show nothing
    return None


def cut_off(bag: Bag) -> str:
    """Return a sentence when the bag of a run ends before the run did; empty otherwise, and for bags of no rig.

    A part that `rig bag` wrote is not cut off, nor is a bag whose recorder came late, nor a run by hand of an earlier version,
    which left nothing that shows its end.

    Parameters
    ----------
    bag : Bag
        The bag, which needs only STATE, EVENTS and its record of the run.
    """
    if bag.end or bag.library.startswith(OF_COPY):
        return ""
    found = _by_messages(bag)
    if found is not None and (found.state == "ended" or not bag.library.endswith(OF_RUN)):
        return ""
    if not bag.library.endswith(OF_RUN):
        try:
            info = bag.run_info()
            if info.get("sequence") in WITHOUT_END or info.get("imported") or bag.recorded_from > 0.0:
                return ""
        except RigError:
            return ""
    elif not bag.began:
        return ""
    why = f"; the rig's last state: {found.reason}" if found else ""
    return f"the run was cut off at {bag.recorded_to / 1e9:.3f} s: the bag holds no record of its end{why}"
