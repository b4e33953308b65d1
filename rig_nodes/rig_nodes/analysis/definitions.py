# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The numbers in the definitions of a shift's metrics, and what these definitions withhold of a rig or of a single shift.

analysis.shift cuts shifts by the numbers, and the records of analysis.metrics refer to them. The thesis defines the metrics for a
drive that holds the input's speed and a load on the output.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import pi
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

    from ..rig import Transmission
    from .metrics import Metric

NO_SEQUENCE = "none"  # stands where a run that was ordered by hand would name its sequence
RPM = 30.0 / pi
STANDSTILL = 1.0  # rad/s, below which a shaft counts as standing still
BEFORE = 0.2  # s before the order from which the initial state of the shift is taken
LONGEST = 3.0  # s after the order in which a shift is searched; untuned shifts took over 1 s
PRESSURE_MEAN = 1e-3  # s
TORQUE_SPEED_MEAN = 2e-3  # s
HOLD = 20e-3  # s for which the mean slip must stay within the threshold
SLIP_UP, SLIP_DOWN = 0.05e-2, 0.1e-2  # thesis 7.1.5
SLIP_INSTRUMENT_LIMIT = 0.3e-2
SLIP_OLD_GEAR = 1e-2  # above it the gear counts as not engaged before the order
DIP = 0.05  # the minimum counts as a dip below 0.95 of the input speed over i1 (Annex A)
DIP_SEARCH = 2.0  # s in which Annex A searches the minimum of a downshift
K_MOST = 1.01  # the output cannot turn faster than in the slower gear at the input's old speed; Annex A's edge of that speed
# Annex A does not give its factor; 2 Nm is twice the torque meter's largest error
SETTLED_BAND, SETTLED_BAND_NM = 0.05, 2.0
SETTLED_FOR = 0.1  # s; Annex A: 1000 samples
SETTLED_AFTER = 0.5  # s after the input speed has recovered, at which Annex A takes the settled torque


def withhold(row: dict, box: Transmission, metrics: Iterable[Metric]) -> None:
    """Take out of a row of metrics what is not defined, with the reasons under its key ``undefined``.

    Parameters
    ----------
    row : dict
        Row of shift.shift_metrics.
    box : Transmission
        The transmission that was shifted; ``drive_yields`` is what the rig's description says about its drive.
    metrics : iterable of Metric
        The metrics.
    """
    reasons = row["undefined"] or {}
    for metric in metrics:
        value = row[metric.key]
        if metric.held_input and box.drive_yields:
            reasons[metric.key] = f"defined for an input whose speed is held; here {box.drive_yields} (use the clutch heat)"
        elif value is not None and metric.absurd and (why := metric.absurd(value, box)):
            reasons[metric.key] = why
    row["undefined"] = reasons
    row.update(dict.fromkeys(reasons))


def reasons_in(row: Mapping) -> Mapping[str, str]:
    """Return the reasons of the metrics that a row withholds, by their keys; none for a row of an older report."""
    return row.get("undefined") or {}


def undefined_lines(names: Sequence[str], rows: Iterable[Mapping], metrics: Iterable[Metric], box: Transmission) -> list[str]:
    """Return a line for each reason with which metrics are withheld, the reasons that hold for all shifts without their names.

    Parameters
    ----------
    names : sequence of str
        Names of the shifts.
    rows : iterable of mapping
        Their metrics.
    metrics : iterable of Metric
        The metrics that are shown.
    box : Transmission
        The transmission.
    """
    found: dict[tuple[str, str], list[str]] = {}
    for name, row in zip(names, rows):
        by_reason: dict[str, list[str]] = {}
        for metric in metrics:
            if reason := reasons_in(row).get(metric.key):
                by_reason.setdefault(reason, []).append(metric.named(box))
        for reason, of_it in by_reason.items():
            found.setdefault((", ".join(of_it), reason), []).append(name)
    return [f"{'' if len(of) == len(names) else '; '.join(of) + ': '}no {of_it}: {reason}" for (of_it, reason), of in found.items()]
