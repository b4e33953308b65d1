# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A measured number as text: the one rule by which tables, pages and comparisons print a value beside its largest error.

A value that is smaller than its error could as well be 0 or have the other sign; what is known of it is a bound.
"""

from __future__ import annotations

from collections.abc import Sequence


def shown(value: float | None, error: float | None, digits: int) -> str:
    """Return a value as people read it.

    Parameters
    ----------
    value : float or None
        The value; None when it was not found.
    error : float or None
        Its largest error in the same unit; None when it is not known.
    digits : int
        Digits behind the decimal point.

    Returns
    -------
    str
        The value; ``<`` and the most that its amount can be, when the error is larger than the value; ``-`` for None.
    """
    if value is None:
        return "-"
    if drowned(value, error):
        return f"<{abs(value) + (error or 0.0):.{digits}f}"
    return f"{value:z.{digits}f}"


def shown_shortly(value: float | None, error: float | None = None) -> str:
    """Return a value as :func:`shown` does, with four significant digits in place of given ones."""
    if value is None:
        return "-"
    return f"<{abs(value) + (error or 0.0):.4g}" if drowned(value, error) else f"{value:z.4g}"


def fixed(value: float | None, factor: float, digits: int) -> str:
    """Return a value times a factor with digits behind the decimal point, without the sign of a zero; ``-`` for None."""
    return "-" if value is None else f"{value * factor:z.{digits}f}"


def drowned(value: float | None, error: float | None) -> bool:
    """Return whether a value is smaller than its largest error, so that it must not be printed."""
    return value is not None and error is not None and error > abs(value)


def in_unit(value: float | None, error: float | None, factor: float) -> tuple[float | None, float | None]:
    """Return a value and its error times the factor to the unit in which they are read."""
    return None if value is None else value * factor, None if error is None else error * factor


def aligned(rows: Sequence[Sequence[str]], left: int = 1) -> list[str]:
    """Return a table for the terminal, a line for each row of cells, the first one its head.

    Parameters
    ----------
    rows : sequence of sequence of str
        The cells, as many in each row.
    left : int
        Columns, from the first one, that are words and not numbers.
    """
    widths = [max(map(len, column)) for column in zip(*rows)]
    return [
        "  ".join(cell.ljust(width) if i < left else cell.rjust(width) for i, (cell, width) in enumerate(zip(row, widths))).rstrip()
        for row in rows
    ]
