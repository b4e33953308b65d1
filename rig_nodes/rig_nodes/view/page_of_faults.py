# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What became of a controller's shifts with each fault of a rig, as one self-contained HTML page.

`rig controller check --faults --html` writes it.
"""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, NamedTuple

from ..rig import read_fault
from ..runs import BADLY, FAILED, HARM, IN_TIME, WELL, WORSE
from .page import page, table, words

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..rig import RigConfig
    from .page import Cell


class Shown(NamedTuple):
    """How the page shows an outcome: a sign beside its word, because colour alone does not tell, its class, what it means."""

    sign: str
    css: str
    meaning: str


# the outcomes, the worst first
OUTCOMES = {
    HARM: Shown("✗", "failed", "A limit of the machine tripped, or the clutches of two gears were clamped at once."),
    FAILED: Shown("■", "failed", "The controller broke down, fell silent, or brought the plant to where it cannot be moved."),
    BADLY: Shown(
        "▼",
        "fair",
        f"The gear was not reached, time or torque was above {WORSE:g} times that of the healthy shift, or the trip came late.",
    ),
    IN_TIME: Shown("●", "met", "The rig tripped, or the controller told of the fault, before a shift would have been bad."),
    WELL: Shown("✓", "met", "The gear was reached in a time and with a torque near those of the healthy shift."),
}


def faults_page(controller: str, config: RigConfig, outcomes: Sequence[tuple[str, str, str]]) -> str:
    """Return the page of a controller under faults.

    Parameters
    ----------
    controller : str
        Its specification.
    config : RigConfig
        The rig.
    outcomes : sequence of (str, str, str)
        Name of the fault, outcome, and its numbers or reason; the first one is of the shift without a fault, whose name is empty.
    """
    healthy, *ill = outcomes
    worst = list(OUTCOMES)
    ill.sort(key=lambda one: worst.index(one[1]))
    counts = Counter(outcome for _, outcome, _ in ill)
    said = f"{len(ill)} fault{'s' * (len(ill) != 1)}: {', '.join(f'{count} {outcome}' for outcome, count in counts.items())}."
    rows: list[list[Cell]] = [["no fault, for reference", "-", _cell(healthy[1]), healthy[2]]]
    for fault, outcome, text in ill:
        rows.append([fault, read_fault(config, fault, controller).shown_size or "-", _cell(outcome), text])
    meanings = [[_cell(outcome), shown.meaning] for outcome, shown in OUTCOMES.items()]
    return page(
        f"{config.name}: controller {controller} under faults",
        [
            ("", words([said], OUTCOMES[ill[0][1]].css)),
            ("Shift with each fault", table(["fault", "size", "outcome", "numbers or reason"], rows, "text cards")),
            ("What the outcomes mean", table((), meanings, "text")),
        ],
    )


def _cell(outcome: str) -> Cell:
    return f"{OUTCOMES[outcome].sign} {outcome}", OUTCOMES[outcome].css
