# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""No number is printed whose largest error is larger than itself, in whatever output."""

import json
import re

import pytest
from synthetic_shift import FakeBag, Shift

from rig_nodes.analysis.display import shown, shown_shortly
from rig_nodes.analysis.measured_error import instruments_of, uncertainty
from rig_nodes.analysis.moved import differences, moved_lines
from rig_nodes.analysis.report_text import format_report
from rig_nodes.analysis.results import results_of, spread, spread_lines
from rig_nodes.analysis.run_report import build_report
from rig_nodes.analysis.runs_table import Member, table_of
from rig_nodes.rig.configuration import load_rig
from rig_nodes.view.document import report_document
from rig_nodes.view.page_of_report import Facts, report_page

ORDERS = [(0.0, "/controller/events", "shift_ordered", "", 1.0), (1.0, "/controller/events", "shift_ordered", "", 2.0)]
DROWNED = {"overlap_s": (0.336, 1.43), "e_loss_j": (-444.0, 555.0), "t_c_s": (0.0777, 0.0888)}


def test_a_value_below_its_error_is_a_bound():
    assert [shown(*one) for one in ((336.0, 1430.0, 0), (-0.4, 1.0, 1), (0.0, 0.0, 0), (5.0, 5.0, 0), (7.0, None, 1))] == [
        "<1766",
        "<1.4",
        "0",
        "5",
        "7.0",
    ]
    assert shown(None, 3.0, 0) == "-" and shown_shortly(4.547e-13, 155.0) == "<155" and shown_shortly(-1234.5, 3.0) == "-1234"


@pytest.fixture(scope="module")
def report():
    """A report whose first shift has metrics that are smaller than their errors."""
    found = build_report(FakeBag(Shift(peak=160.0).recording(), events=ORDERS), {})
    row, errors = found["shifts"][-1], found["uncertainty"][-1]
    for key, (value, error) in DROWNED.items():
        row[key], errors[key] = value, error
    return found


def test_no_output_prints_a_number_whose_error_is_larger(report):
    other = json.loads(json.dumps(report))
    other["shifts"][-1] |= {"e_loss_j": 1111.0}
    results = results_of(report)
    outputs = {
        "terminal": format_report(report),
        "page": report_page(report, Facts(), [], []),
        "view": report_document(report, []),
        "moved": "\n".join(moved_lines(report, other)),
        "spread": "\n".join(spread_lines(spread([results, results]))),
        "runs": "\n".join(map(" ".join, table_of([Member("a", "a", results)])[1])),
    }
    for name, text in outputs.items():
        for value in ("336", "444", r"77\.7", "78"):
            assert not re.search(rf"(?<![\d<.]){value}(?!\d)", re.sub(r"<\w[^>]*>|<\d[\d.]*", "", text)), (name, value)
    assert "<999" in outputs["terminal"] and "<999" in outputs["moved"] and "&lt;999" in outputs["page"]


def test_a_torque_that_only_goes_from_one_level_to_the_other_has_no_time_of_its_lowest(report):
    row = report["shifts"][1] | {"input_torque_low_nm": 70.0, "t_low_s": None}
    level = report | {"shifts": [report["shifts"][0], row]}
    (found,) = (one for one in differences(level, level) if (one["shift"], one["metric"]) == (2, "t_low_s"))
    assert found["reason"] == "both: the torque did not go beyond those before and after the shift"


def test_a_peak_of_a_quick_shift_has_the_error_of_its_own_rise(report):
    """At 200 rpm the speeds meet within 13 ms; the mean over 2 ms then shows a peak 8 Nm too low."""
    row = report["shifts"][1] | {"input_torque_low_nm": 70.0, "input_torque_high_nm": 190.0}
    rig = load_rig("hydmag")
    of_rig = instruments_of(rig.as_dict()), rig.transmission
    slow, quick = (uncertainty(row | {"t_p_s": t_p}, *of_rig)["input_torque_high_nm"] for t_p in (0.1, 0.013))
    assert slow == pytest.approx(1.01 + 120.0 / 45.0) and quick == pytest.approx(1.01 + 120.0 / 13.0)
