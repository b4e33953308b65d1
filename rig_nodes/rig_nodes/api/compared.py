# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recordings side by side from Python and for `rig compare`: clocks, metrics and signals with their differences."""

from __future__ import annotations

from functools import cached_property
from html import escape
from typing import TYPE_CHECKING

from ..analysis import aligned, clock_lines, compare, metric_tables, reasons, signal_tables
from ..base import optional, printable
from ..rig import catalogue
from .given import chosen
from .table import Table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

    from ..analysis import Comparison, Source

UNITS_OF = {"first": "", "other": "", "difference": "", "error": "", "in_errors": "", "reason": ""}


class Compared:
    """What a comparison with the first recording found; ``Run.compare`` makes it, and printing it shows its tables.

    Attributes
    ----------
    found : Comparison
        Names, clocks, rows and curves.
    record : mapping
        The record of the first recording's rig.
    """

    def __init__(self, sources: Sequence[Source], by: str | None = None) -> None:
        """Compare recordings with the first one, aligned ``by`` events or correlation."""
        self.found: Comparison = compare(sources, by)
        self.record = sources[0].record
        self.box, self.catalogue = sources[0].recording.transmission, catalogue(self.record).signals

    @cached_property
    def metrics(self) -> Table:
        """A row for each metric of each shift and recording after the first; values are in the unit that ends the metric's name."""
        return Table({"run": "", "shift": "", "metric": "", **UNITS_OF}, self.found.metrics)

    @cached_property
    def signals(self) -> Table:
        """A row for each signal and recording after the first: mean, rms and largest difference in SI, and in measuring errors."""
        names = ("run", "signal", "mean", "rms", "largest", "error", "in_errors", "reason")
        return Table(dict.fromkeys(names, ""), self.found.signals)

    def plot(self, shift: int = 1, dark: bool = False) -> Figure:
        """Draw a shift of all recordings over each other, each from its own order on, and the differences from the first.

        Parameters
        ----------
        shift : int
            Its number in the first recording, from 1 on; without shifts the whole run is drawn.
        dark : bool
            True for a dark ground.

        Returns
        -------
        matplotlib.figure.Figure
            The figure, of which a notebook shows the picture.

        Raises
        ------
        RigError
            When there is no such shift, or matplotlib is not installed.
        """
        optional("matplotlib")
        from ..view import Pages, draw_figure, figures_of_compare

        drawn = figures_of_compare(self.found, Pages(self.record))
        return draw_figure(drawn[chosen("shift", shift, len(drawn), "the first recording")], dark)

    def __repr__(self) -> str:
        lines = clock_lines(self.found)
        for head, rows in (*metric_tables(self.found, self.box), *signal_tables(self.found, self.catalogue)):
            lines += ["", *aligned([head, *rows])] if rows else []
        if why := reasons(self.found, self.box):
            lines += ["", *(f"-: {one}" for one in why)]
        return "\n".join(printable(line) for line in lines)

    def _repr_html_(self) -> str:
        return f"<pre>{escape(repr(self))}</pre>"
