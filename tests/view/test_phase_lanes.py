# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Phases of a shift in the viewer and on the page are those of the report, also where two of them overlap."""

import numpy as np
import pytest

from rig_nodes.analysis.metrics import metric_keys
from rig_nodes.rig.configuration import load_rig
from rig_nodes.view import layout
from rig_nodes.view.moments import MARK_COLOURS, shift_page
from rig_nodes.view.pages import Pages
from rig_nodes.view.report_plots import Plots

# a shift whose new clutch comes too late: the output departs at 0.394 s, and the kiss point is at 0.786 s
LATE = dict.fromkeys(metric_keys()) | {
    "from_gear": 1,
    "to_gear": 2,
    "t_order_s": 3.845,
    "kiss_s": 0.786,
    "departure_s": 0.394,
    "interrupted_s": 0.392,
    "t_c_s": 0.944,
    "t_p_s": 0.550,
    "t_dt_s": 0.844,
    "t_o_s": 0.032,
}


def moment(row):
    """Returns the one moment of the viewer's page of a shift."""
    shift = layout.Shift(3.845, 1, 2, 6.0, load_rig("hydmag").transmission)
    return shift_page(Pages(load_rig("hydmag").as_dict()), [[shift]], [row]).moments[0]


def test_the_fill_goes_on_to_the_kiss_point_beside_the_interruption():
    lanes = {lane: [(one.name, one.start, one.end) for one, _ in bars] for lane, bars in moment(LATE).lanes.items()}
    assert [name for name, *_ in lanes["phases"]] == ["fill", "inertia phase"]
    assert lanes["phases"][0][1:] == pytest.approx((0.0, 0.786)) and lanes["phases"][1][1:] == pytest.approx((0.786, 0.944))
    assert lanes["interrupted"] == [("interrupted", pytest.approx(0.394), pytest.approx(0.786))]


def test_no_mark_is_dropped_where_phases_overlap():
    marks = {colour: at for at, colour in moment(LATE).marks[1:]}
    expected = {"kiss point": 0.786, "departure": 0.394, "lock-up": 0.944}
    assert marks == {MARK_COLOURS[name]: pytest.approx(at) for name, at in expected.items()}


def test_the_page_has_the_phases_and_marks_of_the_viewer():
    plots = Plots(Pages(load_rig("hydmag").as_dict()), [LATE], 0.0, 6.0)
    plots.add("M_wej", np.array([3.8, 4.0, 5.0]), np.array([70.0, 30.0, 90.0]))
    figure = plots.shift_figures()[0]
    texts = ("fill, to the kiss point", "interrupted: no clutch carries", "inertia phase, to lock-up")
    assert all(text in figure for text in texts) and "torque phase" not in figure
    assert figure.split("</svg>")[0].count("<line") == 1 + len(MARK_COLOURS)
