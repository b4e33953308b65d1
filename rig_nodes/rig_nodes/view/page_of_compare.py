# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A comparison as one self-contained HTML page with its curves; `rig compare --html` writes it."""

from __future__ import annotations

from ..analysis import Comparison, clock_lines, metric_tables, reasons, short_names, signal_tables
from .figure_of_compare import figures_of_compare
from .page import figures, page, table, words
from .pages import Pages

MOST = 12  # shifts that are drawn


def compare_page(found: Comparison, pages: Pages) -> str:
    """Return the page: each shift of all recordings over each other, clocks, metrics and signals.

    Parameters
    ----------
    found : Comparison
        The comparison.
    pages : Pages
        The pages of the first recording's rig.
    """
    assert pages.box is not None  # runs with shifts are compared
    box = pages.box
    clocks = table(["recording", "offset ms", "drift ppm", "aligned by"], _clock_rows(found))
    said = words(line.strip() for line in clock_lines(found) if line.startswith("  "))
    metrics = [part for head, rows in metric_tables(found, box) for part in table(head, rows)]
    compared = [part for head, rows in signal_tables(found, pages.known.signals) for part in table(head, rows)]
    notes = words([f"-: {line}" for line in reasons(found, box)], "note")
    drawn = figures(figures_of_compare(found, pages)[:MOST], "shift")
    return page("Comparison", [("", [*clocks, *said, *drawn]), ("Metrics of shifts", metrics), ("Signals", [*compared, *notes])])


def _clock_rows(found: Comparison) -> list[list[str]]:
    return [
        [name, f"{clock.offset * 1e3:z.2f}", f"{clock.drift * 1e6:z.1f}", clock.by if n else "the first clock"]
        for n, (name, clock) in enumerate(zip(short_names(found.names), found.clocks))
    ]
