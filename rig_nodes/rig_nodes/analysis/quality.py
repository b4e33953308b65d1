# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The verdict on the quality of a shift: does the output keep turning, how high is the torque's peak, how long does it take.

analysis.report puts it beside the metrics from which alone it follows. The limits and their sources are explained in
docs/how_to/report.md.
"""

from __future__ import annotations

from collections.abc import Mapping

from ..transmission import Transmission
from .metrics import RPM, STANDSTILL

GOOD, FAIR, POOR, FAILED = GRADES = ("good", "fair", "poor", "failed")  # from the best to the worst
# k (7.3), (7.4): the thesis calls n_wyj below 0.95 n_wej / i1 a dip (Annex A) and its own shifts stay above it (7.4.2.3). Half of
# the speed lost is this project's border between a dip and a drive that is as good as interrupted.
K_DIP, K_LOST = 0.95, 0.5
# t_c of the laboratory's tuned shifts was below 0.725 s upwards (7.4.1) and 0.5 s downwards (7.4.2); untuned ones took over 1 s.
SLOW_UP, SLOW_DOWN, UNTUNED = 0.725, 0.5, 1.0
# Highest input torque by that which the load asks: the last application factor of ISO 6336-6 table B.1, for heavy shocks of motor
# and machine. A higher peak alone makes a shift no worse than fair, because the laboratory accepted such peaks at small loads.
SHOCK = 2.25
LEAST_TORQUE = 10.0  # Nm, ten errors of the torque meter, below which a ratio of torques is meaningless


def quality_of(row: Mapping, box: Transmission) -> dict | None:
    """Return the verdict on a shift.

    Parameters
    ----------
    row : mapping
        Row of metrics.shift_metrics.
    box : Transmission
        The transmission that was shifted.

    Returns
    -------
    dict or None
        ``grade`` (one of GRADES, that of the worst criterion; None when nothing could be judged), ``peak_ratio`` (highest input
        torque by the one that the load asks, None when it is not known) and ``reasons``, a clause for each criterion that is not
        good, the worst first. None for an engagement from neutral, which releases no clutch.
    """
    if not box.changes(row["from_gear"], row["to_gear"]):
        return None
    reasons: list[tuple[str, str]] = []
    judged = False
    if row["t_c_s"] is None and row["input_speed_rpm"] is not None:
        reasons.append((FAILED, f"gear {box.names[row['to_gear']]} was not reached"))
    elif row["t_c_s"] is not None:
        judged = True
        slow = SLOW_UP if row["to_gear"] > row["from_gear"] else SLOW_DOWN
        if row["t_c_s"] > slow:
            grade = POOR if row["t_c_s"] > UNTUNED else FAIR
            reasons.append((grade, f"it took {row['t_c_s']:.3f} s from the order, over {UNTUNED if grade == POOR else slow:g} s"))
    if row["k"] is not None:
        judged = True
        if _stood(row):
            reasons.append((FAILED, "the output stood still: the drive was interrupted"))
        elif row["k"] < K_DIP:
            grade = FAILED if row["k"] < K_LOST else POOR
            reasons.append((grade, f"the output dipped to {100.0 * row['k']:.0f} % of its speed in the slower gear"))
    ratio = peak_ratio(row, box)
    if ratio is not None and ratio > SHOCK:
        tied = row["overlap_s"]
        both = f", and both clutches were pressed for {1e3 * tied:.0f} ms" if tied and tied > 0.0 else ""
        reasons.append((FAIR, f"{box.input.torque} rose to {ratio:.1f} times the torque that the load requires{both}"))
    worst = max((GRADES.index(grade) for grade, _ in reasons), default=0)
    return {
        "grade": GRADES[worst] if judged or reasons else None,
        "peak_ratio": ratio,
        "reasons": [text for _, text in sorted(reasons, key=lambda one: -GRADES.index(one[0]))],
    }


def _stood(row: Mapping) -> bool:
    return row["output_speed_min_rpm"] is not None and row["output_speed_min_rpm"] < STANDSTILL * RPM


def peak_ratio(row: Mapping, box: Transmission) -> float | None:
    """Return the highest input torque of a shift by the torque that the load asks of the input in the gear that asks more.

    The load is the output torque before the order; losses are not counted. None when one is not known or the load asks less than
    LEAST_TORQUE.
    """
    peak, load = row["input_torque_max_nm"], row["output_torque_nm"]
    if peak is None or load is None:
        return None
    asked = load / min(abs(box.ratios[gear]) for gear in (row["from_gear"], row["to_gear"]))
    return peak / asked if asked > LEAST_TORQUE else None


def sentence_of(verdict: Mapping | None) -> str:
    """Return the grade with its reasons, such as ``fair: ...``; empty for a good shift and one without a verdict."""
    return f"{verdict['grade']}: {'; '.join(verdict['reasons'])}" if verdict and verdict["reasons"] else ""
