# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The heads of a logger's blocks of samples: whether they agree with each other, and whether the rows between them can be filled.

bags.reader uses it.
"""

from __future__ import annotations

import math

import numpy as np

from . import limits


def false_heads(head: np.ndarray) -> str:
    """Return what the heads of a logger's blocks contradict each other in; empty when they agree."""
    first, rows, period = head["first_sample"], head["rows"], head["period"]
    if not np.all((period == period[0]) & (period > 0.0) & (period < math.inf)):
        return "the period is not one and the same above 0 in all its blocks"
    if "seq" in (head.dtype.names or ()):
        # where a block was lost, or is there twice, the numbers of the messages tell it
        follows = head["seq"][1:] == head["seq"][:-1] + np.uint64(1)
        wrong = np.flatnonzero(follows & (first[1:] != first[:-1] + rows[:-1]))
        if len(wrong):
            at = wrong[0]
            return f"a block begins with row {first[at + 1]}, not with {int(first[at]) + int(rows[at])} as the one before it says"
    return ""


def out_of_reach(head: np.ndarray, columns: int) -> str:
    """Return why the rows from the first block to the last cannot be held in memory; empty when they can."""
    first, rows = head["first_sample"], head["rows"]
    if not first.max() <= limits.LAST:  # nor is it a number, in messages of another definition
        return f"a block begins with row {first.max()}, which no run reaches"
    missing = int(first[-1]) + int(rows[-1]) - int(first[0]) - int(rows.sum(dtype=np.int64))
    if missing * columns > limits.FILLED:
        return f"{missing} rows are missing between its blocks, more than the {limits.FILLED // columns} that are filled with NaN"
    return ""
