# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Faults of the messages from a shift controller outside to the rig: runs.faults has them act on each command."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from .fault import FIRST_SPN, MESSAGES, NETWORK, UPDATE, Fault, Size

if TYPE_CHECKING:
    from .fault import Target

SPN = FIRST_SPN + 224


def written(key: str, messages: Target, size: float) -> None:
    """Write the size under a key."""
    messages[key] = max(messages[key], size)


FAULTS = (
    Fault(
        *("late", MESSAGES, "line", "Commands come late."),
        *("the answer to an order, and all that follows, is late", partial(written, "late"), SPN, UPDATE),
        Size("time", 0.0, 2.0, 0.03, "delay"),
    ),
    Fault(
        *("lost", MESSAGES, "line", "Commands are lost."),
        *("the age of the commands grows", partial(written, "lost"), SPN, UPDATE),
        Size("ratio", 0.0, 1.0, 0.2, "share of the commands"),
    ),
    Fault(
        *("doubled", MESSAGES, "line", "Commands come a second time, behind the next one."),
        *("commands act out of order; current and pressure hardly show it", partial(written, "doubled"), SPN, NETWORK),
        Size("ratio", 0.0, 1.0, 0.2, "share of the commands"),
    ),
    Fault(
        *("corrupted", MESSAGES, "line", "Commands are corrupted, in their range."),
        *("current and pressure jump", partial(written, "corrupted"), SPN, NETWORK),
        Size("ratio", 0.0, 1.0, 0.02, "share of the commands"),
    ),
)
