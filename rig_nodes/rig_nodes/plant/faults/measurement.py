# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Faults of the messages with which the rig tells a plugged controller what it measures: runs.rig has them act on each sample.

A controller computes at each tick of its own clock, which is the number of the sample, with what has come by then: values of before
where a message is late or lost. There is none that comes doubled: its number tells the controller that it has it.
"""

from __future__ import annotations

from functools import partial

from .fault import FIRST_SPN, MEASUREMENTS, NETWORK, UPDATE, Fault, Size
from .message import written

SPN = FIRST_SPN + 320

FAULTS = (
    Fault(
        *("late", MEASUREMENTS, "line", "Measurements come late to the controller."),
        *("the controller answers late to what is measured, and its loops swing", partial(written, "late"), SPN, UPDATE),
        Size("time", 0.0, 2.0, 0.03, "delay"),
    ),
    Fault(
        *("lost", MEASUREMENTS, "line", "Measurements are lost on the way to the controller."),
        *("commands stand still, then jump, while what is measured moves evenly", partial(written, "lost"), SPN, UPDATE),
        Size("ratio", 0.0, 1.0, 0.2, "share of the samples"),
    ),
    Fault(
        *("corrupted", MEASUREMENTS, "line", "Measurements are corrupted on the way to the controller, in their range."),
        *("the controller answers to what no transducer shows", partial(written, "corrupted"), SPN, NETWORK),
        Size("ratio", 0.0, 1.0, 0.02, "share of the samples"),
    ),
)
