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

from ..errors import RigError

if TYPE_CHECKING:
    from .reader import Bag

RECORD_NAME = "rig_end"  # of the metadata record, which holds the fields of RunEnd
OF_RUN = " run"  # the library's name ends with it where that record will follow
OF_COPY = "rig_bag "  # that of `rig bag` begins with it: it writes parts of runs
STATE, EVENTS = "/rig/state", "/sequencer/events"
_ENDS = {"sequence_done": "ended", "sequence_failed": "failed", "sequence_cancelled": "failed"}  # events of a sequence's end
_TRIPPED = 3  # RigState.TRIPPED


@dataclass(frozen=True)
class RunEnd:
    """How a run ended: ``state`` as in its report (ended, failed, tripped, interrupted), and the reason."""

    state: str
    reason: str

    @classmethod
    def of(cls, record: Mapping[str, str]) -> RunEnd | None:
        """Return what a bag's record says; None without one."""
        return cls(record.get("state", ""), record.get("reason", "")) if record else None


def end_by_topics(bag: Bag) -> RunEnd | None:
    """Return how a run ended by the messages of its sequencer and its rig; None when they do not show it.

    Parameters
    ----------
    bag : Bag
        The bag, which needs only STATE and EVENTS.
    """
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
    found = end_by_topics(bag)
    if found is not None and (found.state == "ended" or not bag.library.endswith(OF_RUN)):
        return ""
    if not bag.library.endswith(OF_RUN):
        try:
            if not bag.run_info().get("sequence") or bag.recorded_from > 0.0:
                return ""
        except RigError:
            return ""
    elif not bag.began:
        return ""
    why = f"; the rig's last state: {found.reason}" if found else ""
    return f"the run was cut off at {bag.last / 1e9:.3f} s: the bag holds no record of its end{why}"
