# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which metrics of a shift the definitions of the thesis allow on a rig, and what is withheld of a single shift.

analysis.metrics uses it. The thesis defines them for a drive that holds the input's speed and a load on the output.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from ..rig.transmission import Transmission

if TYPE_CHECKING:
    from collections.abc import Iterable

# t_o ends when the input has its old speed again (Annex A); the energy of (6.108) includes the drive's own inertia, which lies
# outside the torque meter and cancels only when its speed is the same at both ends
RECOVERS = ("t_o_s", "e_loss_j", "e_loss_settled_j")
LOSSES = ("e_loss_j", "e_loss_settled_j")
K_MOST = 1.01  # the output cannot turn faster than in the slower gear at the input's old speed; Annex A's edge of that speed


def undefined_on(box: Transmission) -> dict[str, str]:
    """Return the metrics that are not defined on a rig, each with its reason.

    Parameters
    ----------
    box : Transmission
        The transmission; ``drive_yields`` is what the rig's description says about its drive.

    Returns
    -------
    dict of str to str
        Reason by the metric's key; empty where a drive holds the input's speed.
    """
    if not box.drive_yields:
        return {}
    return dict.fromkeys(
        (*RECOVERS, "k"), f"defined for an input whose speed is held; here {box.drive_yields} (use the clutch heat)"
    )


def withhold(row: dict, box: Transmission) -> None:
    """Take out of a row of metrics what is not defined, with the reasons under its key ``undefined``.

    Parameters
    ----------
    row : dict
        Row of metrics.shift_metrics.
    box : Transmission
        The transmission that was shifted.
    """
    reasons = undefined_on(box)
    if row["k"] is not None and row["k"] > K_MOST:
        faster = f"{box.input.speed} rose: at its lowest {box.output.speed} was {row['k']:.2f} times that of the slower gear"
        reasons.setdefault("k", f"defined for an input whose speed is held; {faster} at the old speed")
    for key in LOSSES:
        if row[key] is not None and row[key] < 0.0:
            reasons.setdefault(key, f"it came out at {row[key]:.0f} J, and no loss is negative")
    row["undefined"] = reasons
    row.update(dict.fromkeys(reasons))


def reasons_in(row: Mapping) -> Mapping[str, str]:
    """Return the reasons of the metrics that a row withholds, by their keys; none for a row of an older report."""
    return row.get("undefined") or {}


def undefined_lines(names: Sequence[str], rows: Iterable[Mapping], columns: Iterable[tuple[str, str, float, int]]) -> list[str]:
    """Return a line for each reason with which metrics are withheld, the reasons that hold for all shifts without their names.

    Parameters
    ----------
    names : sequence of str
        Names of the shifts.
    rows : iterable of mapping
        Their metrics.
    columns : iterable of (str, str, float, int)
        Heading, key, factor and digits of the metrics that are shown.
    """
    found: dict[tuple[str, str], list[str]] = {}
    for name, row in zip(names, rows):
        by_reason: dict[str, list[str]] = {}
        for heading, key, *_ in columns:
            if reason := reasons_in(row).get(key):
                by_reason.setdefault(reason, []).append(heading.rpartition(" ")[0] or heading)
        for reason, metrics in by_reason.items():
            found.setdefault((", ".join(metrics), reason), []).append(name)
    return [
        f"{'' if len(of) == len(names) else '; '.join(of) + ': '}no {metrics}: {reason}" for (metrics, reason), of in found.items()
    ]
