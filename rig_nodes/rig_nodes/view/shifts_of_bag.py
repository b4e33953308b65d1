# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The figures of the shifts of a bag of any length, of which only the time around each shift is held.

`rig report` puts them on its page; view.figure_of_shift describes them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from .figure_of_shift import figure_of_shift, signals_of, window_of
from .recorded import samples_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from .figure import Description
    from .pages import Pages

MOST = 12  # shifts that are drawn
SPARE = 0.05  # s read on both sides of what a figure shows


@dataclass(frozen=True)
class Samples:
    """Values (n,) of a signal [SI] with their times (n,) [s]."""

    values: np.ndarray
    time: np.ndarray

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        return np.asarray(self.values, dtype)


def figures_of_shifts(path: str, report: Mapping, pages: Pages, span: tuple[float, float]) -> list[Description]:
    """Return the figures of the first shifts of a bag, which is read once.

    Parameters
    ----------
    path : str
        Folder of a run or its .mcap file; of a damaged one what is left is read.
    report : mapping
        Its report.
    pages : Pages
        The pages of its rig.
    span : (float, float)
        First and last time of the run [s].
    """
    box, numbers = pages.box, range(1, min(len(report["shifts"]), MOST) + 1)
    if box is None or not numbers:
        return []
    windows = [window_of(report, number, pages, span) for number in numbers]
    kept: list[dict[str, list[Samples]]] = [{} for _ in numbers]
    for name, t, values in samples_of(path, pages, signals_of(box)):
        for (first, last), found in zip(windows, kept):
            part = slice(*np.searchsorted(t, (first - SPARE, last + SPARE)))
            if len(t[part]):
                found.setdefault(name, []).append(Samples(values[part], t[part]))
    joined = [{name: _joined(parts) for name, parts in found.items()} for found in kept]
    return [figure_of_shift(report, number, pages, signals, span) for number, signals in zip(numbers, joined)]


def _joined(parts: list[Samples]) -> Samples:
    return Samples(np.concatenate([one.values for one in parts]), np.concatenate([one.time for one in parts]))
