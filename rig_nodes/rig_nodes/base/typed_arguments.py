# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Types of arguments that several command lines take, those of verbs and of nodes; each refuses a wrong text in one sentence."""

from __future__ import annotations

import argparse
import math


def number_within(text: str, what: str, low: float, high: float) -> float:
    """Return the number of an argument.

    Parameters
    ----------
    text : str
        The argument.
    what : str
        What it should be and what would be right, for the sentence "TEXT is no WHAT".
    low, high : float
        Least and greatest number that is taken.

    Returns
    -------
    float
        The number.

    Raises
    ------
    argparse.ArgumentTypeError
        When the text is no number, or one outside these bounds.
    """
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not low <= value <= high:
        raise argparse.ArgumentTypeError(f"{text} is no {what}")
    return value


def seconds_of_bag(text: str) -> float:
    """Return seconds after the beginning of a bag; ArgumentTypeError when the text is no such number."""
    return number_within(text, "time; give seconds after the beginning of the bag, e.g. 1.5", 0.0, 1e9)
