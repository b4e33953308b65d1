# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Calibration: its parameters and their bounds, the rows that judge it, and the writing of the result to the rig's files."""

import dataclasses
import shutil

import numpy as np
import pytest

from rig_nodes.base.config import CONFIG_DIR, RIGS_DIR
from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import main
from rig_nodes.plant.kiss_point import kiss_pressure
from rig_nodes.rig.configuration import load_rig
from rig_nodes.rigs.hydmag.laboratory import calibration_rows as rows
from rig_nodes.rigs.hydmag.laboratory import trade_off
from rig_nodes.runs.trips import Tripped
from rig_nodes.studies.validation import calibrate as c

TARGETS = rows.calibrating()


@pytest.fixture(scope="module")
def config():
    return load_rig("hydmag")


def test_the_rig_lies_within_what_may_change(config):
    for stage, parameters in rows.calibration().stages.items():
        for name, p in parameters.items():
            place, times = next(iter(p.of.items()))
            part, _, key = place.partition(".")
            assert p.low <= getattr(config.values(part), key) / times <= p.high, f"{stage}.{name}"


@pytest.mark.parametrize(
    "old, new, sentence",
    [
        ("losses:", "loses:", "unknown key 'loses'"),
        ("low: 4 Nm", "low: 40 Nm", "low must be below high"),
        ("[loss_in.at_rest]", "[loss_in.at]", "there is no value of loss_in 'at'; did you mean 'at_470'"),
        ("high: 15 Nm", "high: 15 rpm", "expected a torque"),
    ],
)
def test_a_wrong_list_of_parameters_is_refused(tmp_path, old, new, sentence):
    text = rows.STAGES_FILE.read_text()
    assert old in text
    path = tmp_path / "calibration.yaml"
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(RigError, match=sentence):
        rows.calibration(path)


def test_a_curve_of_chapter_9_begins_and_ends_as_printed():
    fall = TARGETS["ch9_pressure_up_p1"]
    t = np.array([-0.01, 0.0, 0.1, 0.38869, 1.0])
    # 2.3 - 13.028 t + 18.294 t^2 MPa, then 0
    assert rows.on_curve(fall, t) == pytest.approx([2.3e6, 2.3e6, 1.18014e6, 0.0, 0.0], abs=10.0)
    p = rows.on_curve(fall, np.arange(0.0, 1.0, 1e-3) - 0.2)
    assert rows.fall_begins(fall, p) == pytest.approx(0.2, abs=1.5e-3)
    assert np.abs(rows.distances(fall, p, 0.2)).mean() < 2e3 < np.abs(rows.distances(fall, p, 0.21)).mean()


def test_kiss_pressure_by_hand(config):
    """2408 mm2, no square term: (128 N + 128 N/mm x 2 mm + 25 N) / 2408 mm2 = 0.170 MPa."""
    cylinder = dataclasses.replace(
        config.clutch_s1,
        piston_area=2408e-6,
        force_per_pressure_squared=0.0,
        spring_preload=128.0,
        spring_rate=128e3,
        clearance=2e-3,
        seal_friction=25.0,
        seal_friction_share=0.0,
    )
    assert kiss_pressure(cylinder) == pytest.approx(409.0 / 2408e-6)
    squared = dataclasses.replace(cylinder, force_per_pressure_squared=140e-12)
    p = kiss_pressure(squared)
    assert 2408e-6 * p + 140e-12 * p * p == pytest.approx(409.0)


@pytest.mark.campaign  # 10 s of processor time; test_own_calibration.py finds a value again in one
def test_losses_are_found_again(config):
    """From values that are far off, least squares bring the coast-down back into its tolerance."""
    parameters = rows.calibration().stages["losses"]
    off = c.with_values(config, parameters, {"loss_at_470": 4.2, "loss_out_constant": 14.0})
    before = {miss.row: abs(miss.tolerances) for miss in rows.loss_misses(off, TARGETS)}
    values = c.search(off, parameters, rows.ROWS["losses"], generations=0, jobs=1, seed=1)
    after = {miss.row: abs(miss.tolerances) for miss in rows.loss_misses(c.with_values(off, parameters, values), TARGETS)}
    assert before["coast_down_torque"] > 3.0 > 1.0 > after["coast_down_torque"]
    assert sum(x * x for x in after.values()) < 0.2 * sum(x * x for x in before.values())


def test_what_is_found_is_written_where_the_rig_reads_it(tmp_path):
    shutil.copytree(RIGS_DIR / "hydmag", tmp_path / "hydmag")
    shutil.copytree(CONFIG_DIR / "controllers", tmp_path / "controllers")
    rig, controller = tmp_path / "hydmag" / "rig.yaml", tmp_path / "controllers" / "alfa46.yaml"
    lines = len(rig.read_text().splitlines())
    found = {"losses.loss_at_470": 6.25, "losses.loss_out_constant": 2.5, "clutches.clearance_s2": 5.25e-3}
    parameters = rows.calibration().parameters
    c.write_values(found, parameters, rig, controller)
    read = load_rig(rig, {})
    assert read.loss_in.at_470 == 6.25 and read.clutch_s2.clearance == pytest.approx(5.25e-3)
    assert read.loss_out.drag == 2.5 and read.loss_out.at_470 == read.loss_in.drag == 0.0, "those of the other loss stay"
    assert read.clutch_s1.clearance == load_rig("hydmag").clutch_s1.clearance
    assert '    at_470: [6.25 Nm, "calibrated: rig calibrate"]' in rig.read_text()
    assert len(rig.read_text().splitlines()) == lines
    rig.write_text(rig.read_text().replace("    at_470: [6.25", "    at_47: [6.25"))
    with pytest.raises(RigError, match="no line 'at_470.* in loss_in"):
        c.write_values({"losses.loss_at_470": 6.25}, parameters, rig, controller)


@pytest.mark.parametrize(
    "arguments, sentence",
    [
        (["--stages", "loses"], "there is no stage 'loses'; did you mean 'losses'?"),
        (["--generations", "-1"], "generations is -1, expected a whole number of at least 0"),
        (["--json", "/nowhere/x.json"], "--json /nowhere/x.json: there is no folder /nowhere"),
    ],
)
def test_wrong_arguments_are_refused(capsys, arguments, sentence):
    assert main(["calibrate", *arguments]) == 2
    assert sentence in capsys.readouterr().err


def made_up(config):
    """Returns two rows that a constant loss of the driven side of 2 Nm and of 6 Nm would meet, and one independent of this loss."""
    loss = config.loss_out.drag
    return [rows.Miss("low", loss, loss - 2.0), rows.Miss("high", loss, (loss - 6.0) / 2.0), rows.Miss("far", 0.0, 3.0)]


# arctan((x - 2)^2) + arctan(((x - 6) / 2)^2) is least at 2.059 (1.32), and a little less low at 5.934 (1.51)
LEAST, SECOND = 2.059, 5.934


def test_of_two_rows_that_exclude_each_other_one_is_met(config):
    """Least squares would give 2.8 Nm, which meets neither row; here a row that cannot be met has no influence."""
    parameters = {"loss_out_constant": rows.calibration().stages["losses"]["loss_out_constant"]}

    def found(loss, generations):
        off = c.with_values(config, parameters, {"loss_out_constant": loss})
        return c.search(off, parameters, made_up, generations, jobs=1, seed=1)["loss_out_constant"]

    assert found(7.0, 0) == pytest.approx(SECOND, abs=5e-3), "near where the rig is"
    assert found(7.0, 15) == pytest.approx(LEAST, abs=5e-3), "over all bounds"


def test_the_spread_moves_the_sum_of_squared_misses_by_one(config):
    """For a curve that 2.8 Nm meet best: (3 d + 1)^2 + (1 - 3 d)^2 = 2 + 18 d^2 is 1 more at d = 0.2357 Nm."""

    def curve(config):
        parts = tuple(way * 3.0 * (config.loss_out.drag - 2.8) + 1.0 for way in (1.0, -1.0))
        return [rows.Miss("curve", 0.0, float(np.hypot(*parts)), parts)]

    parameters = {"loss_out_constant": rows.calibration().stages["losses"]["loss_out_constant"]}
    slopes, spread, profile = c.sensitivities(config, parameters, {"loss_out_constant": 2.8}, curve)
    assert spread["loss_out_constant"] == profile["loss_out_constant"] == pytest.approx(18.0**-0.5)
    assert slopes["loss_out_constant"]["curve"] == pytest.approx(0.0, abs=1e-9)


def test_a_parameter_that_another_can_replace_is_less_determined_than_its_slope_says(config):
    """Rows 3 x + 4 y and 3 x: with y held, x is determined to 1 / sqrt(18); with y fitted again, by the second row alone."""

    def both(config):
        x, y = config.loss_in.at_rest, config.loss_out.drag
        return [rows.Miss("sum", 0.0, 3.0 * x + 4.0 * y), rows.Miss("one", 0.0, 3.0 * x)]

    parameters = {name: p for name, p in rows.calibration().stages["losses"].items() if name != "loss_at_470"}
    _, spread, profile = c.sensitivities(config, parameters, {"loss_at_rest": 3.0, "loss_out_constant": 5.0}, both)
    assert spread["loss_at_rest"] == pytest.approx(18.0**-0.5) and profile["loss_at_rest"] == pytest.approx(1.0 / 3.0)


def test_no_calibrated_value_stands_at_a_bound(config):
    for stage, parameters in rows.calibration().stages.items():
        for name, share in zip(parameters, c.shares_of(config, parameters), strict=True):
            assert 0.01 < share < 0.99, f"{stage}.{name} at {share:.3f} of its bounds"


def test_random_places_are_no_worse_than_the_one_at_hand(config):
    """The best place is found from any start; the given place is kept where the others are no better."""
    parameters = {"loss_out_constant": rows.calibration().stages["losses"]["loss_out_constant"]}
    shares = c.anywhere([0.99], 3, 1, 1, config, parameters, made_up)
    assert c.at_shares(config, parameters, shares)[1]["loss_out_constant"] == pytest.approx(LEAST, abs=5e-3)
    best = [
        (LEAST - parameters["loss_out_constant"].low) / (parameters["loss_out_constant"].high - parameters["loss_out_constant"].low)
    ]
    assert c.anywhere(best, 3, 1, 1, config, parameters, made_up) == pytest.approx(best, abs=1e-3)


def test_a_trade_off_runs_from_one_row_to_the_other(config, monkeypatch):
    """With weight w on the one row the misses are least at (w 2 + 6 / (4 w)) / (w + 1 / (4 w))."""
    monkeypatch.setitem(rows.ROWS, "losses", made_up)
    after = {"losses": made_up(c.with_values(config, rows.calibration().stages["losses"], {"loss_out_constant": 2.8}))}
    sensitivities = {"losses.loss_out_constant": {"low": 1.5, "high": 0.75, "far": 0.0}}
    (curve,) = trade_off.trade_offs(config, after, sensitivities, jobs=1)
    assert curve.rows == ("low", "high")
    for point in curve.points:
        w = point.weight
        loss = (2.0 * w + 6.0 / (4.0 * w)) / (w + 1.0 / (4.0 * w))
        assert point.rows[0] == pytest.approx(loss, abs=0.02)
        assert point.misses == pytest.approx((loss - 2.0, (loss - 6.0) / 2.0), abs=0.02)
    low, high = zip(*(np.abs(point.misses) for point in curve.points))
    assert list(low) == sorted(low) and list(high) == sorted(high, reverse=True)


def test_rows_that_can_be_mended_together_are_no_conflict():
    after = [rows.Miss("a", 0.0, 1.0), rows.Miss("b", 0.0, 2.0), rows.Miss("c", 0.0, -1.0), rows.Miss("d", 0.0, 0.1)]
    same = {"losses.x": {"a": 1.0, "b": 1.0, "c": 1.0, "d": -1.0}}
    assert trade_off.conflicts(after, same) == [("a", "c"), ("b", "c")]


def test_a_clutch_that_holds_longer_lets_the_dip_begin_later(config):
    """The time for which a released S1 holds shows in the delay t12 from which on the output dips."""
    parameters = rows.calibration().stages["clutches"]
    borders = [rows.s1_releases(c.with_values(config, parameters, {"rest": torque}), TARGETS)[0].value for torque in (40.0, 60.0)]
    assert borders[0] < borders[1] - 5e-3


def test_a_downshift_that_does_not_end_counts_in_every_row(config):
    """Such a shift has as many misses as others; otherwise a search by least squares could not compare the two."""
    weak = config.replaced(plate_pack=dataclasses.replace(config.plate_pack, friction_correction=0.3))
    ends, never = (rows.s2_releases(one, TARGETS) for one in (config, weak))
    assert [miss.row for miss in never] == [miss.row for miss in ends]
    assert {miss.tolerances for miss in never} == {rows.UNSHIFTED}


def test_an_upshift_that_is_not_measured_counts_in_every_row(config, monkeypatch):
    monkeypatch.setattr(rows, "shift", lambda *_: dict.fromkeys(("k", "input_torque_max_nm", "t_c_s")))
    assert [miss.tolerances for miss in rows.s1_releases(config, TARGETS)] == [rows.UNSHIFTED] * 5


def test_values_at_which_the_rig_trips_are_left_again(config):
    """From 2.4 Nm the slope points to 4.9 Nm, and this rig trips above 3.5 Nm."""

    def flat(config):
        loss = config.loss_out.drag
        if loss > 3.5:
            raise Tripped("the rig tripped")
        return [rows.Miss("flat", loss, float(np.arctan(5.0 * (loss - 3.0))))]

    parameters = {"loss_out_constant": rows.calibration().stages["losses"]["loss_out_constant"]}
    off = c.with_values(config, parameters, {"loss_out_constant": 2.4})
    assert c.search(off, parameters, flat, 0, jobs=1, seed=1)["loss_out_constant"] == pytest.approx(3.0, abs=1e-3)
