# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The page of a run, one file with its report and its figures: what ``Run.page`` and `rig report --html` write."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..bags import OpenedBags, content_hash, rig_record
from ..rig import CHANGED, changed_settings

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..analysis import Gathered


def page_of(bag: Gathered, report: dict, warnings: Sequence[str] = ()) -> str:
    """Return the page of a run.

    Parameters
    ----------
    bag : Gathered
        The run's bag (analysis.gather).
    report : dict
        Its report.
    warnings : sequence of str, optional
        Sentences that the page shows among its warnings.

    Returns
    -------
    str
        The page, HTML that contains all it shows.

    Raises
    ------
    RigError
        When the bag cannot be read.
    """
    from ..view import Facts, Pages, figures_of_run, figures_of_shifts, report_page

    path, record = str(bag.source), rig_record(report["run"].get("configuration") or bag.record, bag.types)
    settings, note = changed_settings(record)
    changes = [(t, text) for t, _, name, text, _ in bag.events() if name == CHANGED]
    with OpenedBags([path]) as opened:
        source = [("bag", bag.path.name), ("hash by rig bag hash", content_hash(opened)[0]["all"])]
    facts = Facts(source, True, settings, note, changes, list(warnings))
    pages, span = Pages(record), (0.0, bag.recorded_to / 1e9)
    return report_page(report, facts, figures_of_shifts(path, report, pages, span), figures_of_run(report, pages, path, span))
