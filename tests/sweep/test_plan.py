# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The variations of a sweep: names and units of --set and --with, the four methods, and refusals."""

import numpy as np
import pytest

from rig_nodes.base.errors import RigError
from rig_nodes.rig.configuration import load_rig, with_overrides
from rig_nodes.studies.sweep.plan import Plan, make_plan, plan_of, read_plan


def points(plan):
    return [tuple(member.values.values()) for member in plan.members()]


def test_a_grid_has_every_combination_in_order():
    plan = make_plan(Plan("grid_point", "hydmag"), {"speed": "1000 rpm .. 2000 rpm in 3", "alfa46.t12": "-200 ms, -0.1 s"})
    assert points(plan) == [(speed, t12) for speed in (1000.0, 1500.0, 2000.0) for t12 in (-200.0, -100.0)]
    first = plan.members()[0]
    assert first.parameters == {"speed": "1000.0 rpm"} and first.overrides == {"alfa46.t12": "-200.0 ms"}
    assert [member.seed for member in plan.members()] == [1, 2, 3, 4, 5, 6]


def test_a_step_ends_at_the_end():
    plan = make_plan(Plan("demo", "hydmag"), {"alfa46.t12": "-250 ms .. -150 ms step 25 ms"})
    assert points(plan) == [(-250.0,), (-225.0,), (-200.0,), (-175.0,), (-150.0,)]


def test_a_list_goes_row_by_row():
    plan = make_plan(Plan("demo", "hydmag", method="list"), {"alfa46.t12": "-250 ms, -200 ms", "alfa46.t21": "-100 ms, 50 ms"})
    assert points(plan) == [(-250.0, -100.0), (-200.0, 50.0)]
    with pytest.raises(RigError, match="2 of alfa46.t12, 1 of alfa46.t21"):
        make_plan(Plan("demo", "hydmag", method="list"), {"alfa46.t12": "-250 ms, -200 ms", "alfa46.t21": "-100 ms"})


def test_a_latin_hypercube_has_one_sample_in_each_stratum_of_each_parameter():
    plan = make_plan(
        Plan("demo", "hydmag", samples=50), {"alfa46.t12": "-250 ms .. -150 ms", "oil_supply.temperature": "20 degC .. 70 degC"}
    )
    table = np.array(points(plan))
    for column, low, high in ((0, -250.0, -150.0), (1, 20.0, 70.0)):
        strata = np.floor((table[:, column] - low) / (high - low) * 50).astype(int)
        assert sorted(strata) == list(range(50))
    again = make_plan(
        Plan("demo", "hydmag", samples=50), {"alfa46.t12": "-250 ms .. -150 ms", "oil_supply.temperature": "20 degC .. 70 degC"}
    )
    assert points(again) == points(plan)
    assert plan_of(plan.as_dict()) == plan


def test_random_fills_the_range_and_its_logarithm():
    plan = make_plan(Plan("demo", "hydmag", method="random", samples=400), {"w0.inertia": "0.1 kg m2 .. 10 kg m2 log"})
    values = np.array(points(plan))[:, 0]
    assert values.min() > 0.1 and values.max() < 10.0
    assert abs(np.mean(values < 1.0) - 0.5) < 0.08  # half of a decade pair lies below its middle, 1


def test_repeats_have_the_same_values_and_other_seeds():
    plan = make_plan(Plan("demo", "hydmag", repeats=2, seed=7), {"alfa46.t12": "-250 ms, -200 ms"})
    assert points(plan) == [(-250.0,), (-250.0,), (-200.0,), (-200.0,)]
    assert [member.seed for member in plan.members()] == [7, 8, 9, 10]
    seeds = make_plan(Plan("demo", "hydmag"), {"seed": "5, 5, 9"})
    assert [member.seed for member in seeds.members()] == [5, 5, 9]


def test_a_points_time_alone_keeps_its_current():
    config = load_rig("hydmag")
    plan = make_plan(Plan("demo", "hydmag"), {"alfa46.output_1.P1.time": "150 ms, 180 ms", "alfa46.output_1.P2": ["320 ms 280 mA"]})
    changed = with_overrides(config, plan.members()[1].overrides).alfa46.profiles
    assert changed[0, 0] == pytest.approx([0.180, 0.160])  # 160 mA stand in tab. 7.5
    assert changed[0, 1] == pytest.approx([0.320, 0.280])
    assert np.array_equal(changed[1:], config.alfa46.profiles[1:])


def test_a_file(tmp_path):
    (tmp_path / "s.yaml").write_text(
        "sequence: demo\nmethod: lhs\nsamples: 8\nseed: 3\nset: {oil_supply.temperature: 60 degC}\n"
        "vary:\n  alfa46.t12: -250 ms .. -150 ms\n  wiring: [swapped]\n"
    )
    plan = read_plan(tmp_path / "s.yaml", "hydmag")
    assert plan.count() == 8 and plan.seed == 3 and plan.members()[0].overrides["wiring"] == "swapped"
    assert plan.members()[0].overrides["oil_supply.temperature"] == "60 degC"


@pytest.mark.parametrize(
    "vary, options, sentence",
    [
        ({"alfa46.t13": "1 ms, 2 ms"}, {}, "there is no value of alfa46 't13'; did you mean 't"),
        ({"sped": "1 rpm, 2 rpm"}, {}, "no value of the rig .as --set names them. 'sped'; known are "),
        ({"alfa46.t12": "1 Nm, 2 Nm"}, {}, "is a torque, expected a time"),
        ({"alfa46.t12": "-6 s .. 1 s in 3"}, {}, "outside -5 to 5"),
        ({"alfa46.t12": "100 ms .. 50 ms in 3"}, {}, "the range must rise"),
        ({"alfa46.t12": "-250 ms .. -150 ms"}, {}, "method grid needs values"),
        ({"alfa46.t12": "-250 ms .. -150 ms"}, {"method": "lhs"}, "give their number with --samples"),
        ({"alfa46.t12": "-250 ms .. -150 ms"}, {"samples": 0}, "samples is 0, expected 1 to"),
        ({"alfa46.t12": "-250 ms .. -150 ms"}, {"method": "sobol", "samples": 3}, "expected grid, list, random, lhs"),
        ({"alfa46.t12": "-1 ms .. 1 ms log"}, {"samples": 3}, "must be above 0"),
        ({"alfa46.output_1.P1.current": "700 mA, 900 mA"}, {}, "outside 0 to 800 mA"),
        ({"alfa46.t12": "1 ms, 2 ms"}, {"fixed": {"alfa46.t12": "3 ms"}}, "it is set for all members too"),
        ({}, {}, "needs something to vary"),
        ({"seed": "1, 2"}, {"repeats": 3}, "repeats would be the same run again; leave them out"),
        ({"seed": "1 .. 3 in 5"}, {}, "'in 5' makes 1, 2, 2, 2, 3: the same value more than once"),
    ],
)
def test_refused(vary, options, sentence):
    with pytest.raises(RigError, match=sentence):
        make_plan(Plan("demo", "hydmag", **options), vary)
