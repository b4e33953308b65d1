# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The verdict on a shift and its phases, on the synthetic shift whose true values are known."""

import numpy as np
import pytest
from synthetic_shift import FakeBag, Shift

from rig_nodes.analysis.phases import FILL, INERTIA, INTERRUPTED, TORQUE, phases_of, times_of
from rig_nodes.analysis.quality import quality_of, sentence_of
from rig_nodes.analysis.report_text import format_report
from rig_nodes.analysis.run_report import build_report
from rig_nodes.analysis.shift import shifts
from rig_nodes.rig.configuration import load_rig


@pytest.fixture(scope="module")
def row():
    (row,) = shifts(Shift(peak=160.0).recording())
    return row


ORDERS = [(0.0, "/controller/events", "shift_ordered", "", 1.0), (1.0, "/controller/events", "shift_ordered", "", 2.0)]


def grade(row, **changes):
    return quality_of(row | changes, load_rig("hydmag").transmission)


def test_a_shift_in_time_without_dip_and_peak_is_good(row):
    assert grade(row) == {"grade": "good", "peak_ratio": pytest.approx(160.0 * 1.025 / 80.0, rel=0.01), "reasons": []}
    assert sentence_of(grade(row)) == "" == sentence_of(None)


@pytest.mark.parametrize(
    ("changes", "expected", "words"),
    [
        ({"input_torque_high_nm": 263.6}, "fair", "M_wej rose to 3.4 times the 78 Nm that the load asks in gear II"),
        ({"t_c_s": 0.8}, "fair", "it took 0.800 s from the order, over 0.725 s"),
        ({"t_c_s": 1.2}, "poor", "over 0.725 s"),
        ({"k": 0.94}, "poor", "the output dipped to 94 % of its speed"),
        ({"k": 0.3}, "failed", "the output dipped to 30 %"),
        ({"k": 0.0, "output_speed_min_rpm": 0.2}, "failed", "the output stood still"),
        (
            {"k": 0.0, "output_speed_min_rpm": 0.2, "interrupted_s": 0.206, "t_c_s": 1.012},
            "failed",
            "the drive was interrupted (for 206 ms no clutch carries the load: engage S2 earlier or release S1 later); it took",
        ),
        ({"t_c_s": None, "k": None, "input_torque_high_nm": None}, "failed", "gear II was not reached"),
        ({"output_speed_low_rpm": 800.0}, "poor", "the output dipped to 74 % of its speed"),
        ({"input_torque_low_nm": 10.0}, "fair", "M_wej fell to 10 Nm, 17 % of the 58 Nm that the load asks in gear I"),
        ({"input_torque_low_nm": -66.0, "reversed_s": 0.03}, "fair", "M_wej fell to -66 Nm, against the load for 30 ms"),
        ({"input_torque_high_nm": None, "input_torque_at_least_nm": 500.0}, "fair", "M_wej rose to at least 6.4 times"),
        (
            {"k": 0.94, "output_speed_min_rpm": 0.2, "t_c_s": 1.2},
            "failed",
            "the output stood still: the drive was interrupted; it took",
        ),
    ],
)
def test_each_fault_has_its_grade_and_reason_the_worst_first(row, changes, expected, words):
    verdict = grade(row, **changes)
    assert verdict["grade"] == expected and words in sentence_of(verdict)


def test_an_engagement_from_neutral_and_a_load_near_zero_are_not_judged_by_what_has_no_meaning_there(row):
    assert grade(row, from_gear=0) is None
    assert grade(row, output_torque_nm=0.4)["peak_ratio"] is None and grade(row, output_torque_nm=0.4)["grade"] == "good"


def test_a_shift_whose_output_stops_does_not_pass_as_valid_in_the_plain_report():
    stopped = Shift(dip=1.0, peak=160.0, depart=0.5)
    report = build_report(FakeBag(stopped.recording(), events=ORDERS), {})
    text = format_report(report)
    assert "NO   failed" in text and "is failed: the output stood still: the drive was interrupted" in text


def test_the_phases_meet_at_kiss_point_departure_and_lock_up(row):
    assert row["kiss_s"] == pytest.approx(0.35, abs=3e-3)
    fill, torque, inertia = phases_of(row)
    assert [one.name for one in (fill, torque, inertia)] == [FILL, TORQUE, INERTIA]
    assert (fill.start, fill.end, torque.end, inertia.end) == pytest.approx((1.0, 1.35, 1.6, 1.7), abs=4e-3)
    assert fill.end == torque.start and torque.end == inertia.start
    ends = {one.name: (one.start, one.end) for one in times_of(row)}
    assert ends["t_c"] == pytest.approx((1.0, 1.7), abs=4e-3) and ends["t_d"] == pytest.approx((1.45, 1.7), abs=4e-3)
    assert ends["t_p"] == pytest.approx((1.6, 1.7), abs=4e-3) and ends["t_o"][1] - ends["t_o"][0] == pytest.approx(row["t_o_s"])


def test_without_lock_up_only_what_came_before_it_is_marked(row):
    unreached = row | {"t_c_s": None, "t_p_s": None}
    assert [one.name for one in phases_of(unreached)] == [FILL, TORQUE] and times_of(unreached) == []
    assert [one.name for one in phases_of(unreached | {"departure_s": None})] == [FILL]


def test_an_output_that_no_clutch_carries_is_interrupted_from_its_departure_to_the_kiss_point():
    case = Shift(peak=160.0, fall=0.2, release=0.4, depart=0.45, engage=0.6)
    (row,) = shifts(case.recording())
    fill, interrupted, inertia = phases_of(row)
    assert [one.name for one in (fill, interrupted, inertia)] == [FILL, INTERRUPTED, INERTIA]
    assert (interrupted.start, interrupted.end) == pytest.approx((1.45, 1.6), abs=4e-3) and fill.end == interrupted.end
    assert row["interrupted_s"] == pytest.approx(0.15, abs=4e-3) and inertia.start == interrupted.end


def test_an_output_that_is_never_driven_again_is_interrupted_to_the_end_of_the_search():
    case = Shift(peak=70.0, fall=0.2, release=0.4, depart=0.45, engage=0.6)
    channels = case.channels()
    n_wyj = channels["n_wyj"][0] * np.interp(np.arange(30_000) * 1e-4, [1.45, 2.2], [1.0, 0.0])
    (row,) = shifts(case.recording(p2=0.0 * channels["p2"], n_wyj=n_wyj))
    assert [one.name for one in phases_of(row)] == [INTERRUPTED]
    assert row["interrupted_s"] == pytest.approx(1.55, abs=0.01), "the recording ends at 3 s"
