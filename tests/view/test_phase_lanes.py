# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Phases of a shift in the viewer are those of the report, also where two of them overlap."""

import itertools

import pytest

from rig_nodes.analysis.metrics import metric_keys, named_metrics
from rig_nodes.rig.configuration import load_rig
from rig_nodes.view import layout
from rig_nodes.view.figure_of_shift import stretches_of
from rig_nodes.view.moments import shift_page
from rig_nodes.view.pages import Pages

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
    assert [name for name, *_ in lanes["phases"]] == ["fill 786 ms", "inertia phase 158 ms", "settling 32 ms"]
    assert lanes["phases"][0][1:] == pytest.approx((0.0, 0.786)) and lanes["phases"][1][1:] == pytest.approx((0.786, 0.944))
    assert lanes["interrupted"] == [("interrupted 392 ms", pytest.approx(0.394), pytest.approx(0.786))]


def test_no_mark_is_dropped_where_phases_overlap():
    assert moment(LATE).marks == pytest.approx((0.0, 0.394, 0.786, 0.944, 0.976))


def test_the_lengths_of_the_phases_are_those_of_the_table_and_add_up_to_its_t_c():
    box, table = load_rig("hydmag").transmission, {one.key: one for one in named_metrics()}
    for tenths in itertools.product(range(10), repeat=3):  # of a ms, the grid of the samples; ties are among them
        kiss, departure, locked = (round(at + 1e-4 * more, 4) for at, more in zip((0.5923, 0.6134, 0.8730), tenths))
        row = dict.fromkeys(metric_keys()) | {"from_gear": 1, "to_gear": 2, "t_order_s": 3.8415, "interrupted_s": 0.0}
        row |= {"kiss_s": kiss, "departure_s": departure, "t_c_s": locked, "t_p_s": locked - departure, "t_o_s": kiss - 0.4}
        lengths = {one.kind: one.texts[-1] for one in stretches_of(row, box)}
        shown = {key: table[key].cell(row, {}) for key in ("kiss_s", "t_p_s", "t_c_s", "t_o_s")}
        assert [lengths[kind] for kind in ("fill", "inertia phase", "settling")] == [
            shown[key] for key in ("kiss_s", "t_p_s", "t_o_s")
        ]
        assert sum(int(lengths[kind]) for kind in ("fill", "torque phase", "inertia phase")) == int(shown["t_c_s"])
