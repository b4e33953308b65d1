"""Calibration: what may change, how far, what it is judged by, and how the result gets into the rig's files."""

import dataclasses
import shutil

import numpy as np
import pytest

from rig_nodes.cli.main import main
from rig_nodes.config import CONFIG_DIR
from rig_nodes.errors import RigError
from rig_nodes.testbench.configuration import load_rig
from rig_nodes.validation import calibrate as c

TARGETS = c._targets()


@pytest.fixture(scope="module")
def config():
    return load_rig()


def test_the_rig_lies_within_what_may_change(config):
    for stage, parameters in c.load_stages().items():
        for name, p in parameters.items():
            place, times = next(iter(p.of.items()))
            part, _, key = place.partition(".")
            owner = config.alfa46.values if part == "alfa46" else getattr(config, part)
            assert p.low <= getattr(owner, key) / times <= p.high, f"{stage}.{name}"


@pytest.mark.parametrize("old, new, sentence", [
    ("losses:", "loses:", "unknown key 'loses'"), ("low: 0.5 -", "low: 5 -", "low must be below high"),
    ("[gearbox.loss_in_speed]", "[gearbox.loss]", "no value 'gearbox.loss'"),
    ("high: 15 Nm", "high: 15 rpm", "expected a torque")])
def test_a_wrong_list_of_parameters_is_refused(tmp_path, old, new, sentence):
    text = c.CALIBRATION_FILE.read_text()
    assert old in text
    path = tmp_path / "calibration.yaml"
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(RigError, match=sentence):
        c.load_stages(path)


def test_a_curve_of_chapter_9_begins_and_ends_as_printed():
    fall = TARGETS["ch9_pressure_up_p1"]
    t = np.array([-0.01, 0.0, 0.1, 0.38869, 1.0])
    # 2.3 - 13.028 t + 18.294 t^2 MPa, then nothing
    assert c.on_curve(fall, t) == pytest.approx([2.3e6, 2.3e6, 1.18014e6, 0.0, 0.0], abs=10.0)
    p = c.on_curve(fall, np.arange(0.0, 1.0, 1e-3) - 0.2)
    assert c.fall_begins(fall, p) == pytest.approx(0.2, abs=1.5e-3)
    assert c.deviation(fall, p, 0.2) < 2e3 < c.deviation(fall, p, 0.21)


def test_kiss_pressure_by_hand(config):
    """2408 mm2, no square term: (128 N + 128 N/mm x 2 mm + 25 N) / 2408 mm2 = 0.170 MPa."""
    cylinder = dataclasses.replace(
        config.clutch_s1, piston_area=2408e-6, force_per_pressure_squared=0.0, spring_preload=128.0, spring_rate=128e3,
        clearance=2e-3, seal_friction=25.0, seal_friction_share=0.0)
    assert c.kiss_pressure(cylinder) == pytest.approx(409.0 / 2408e-6)
    squared = dataclasses.replace(cylinder, force_per_pressure_squared=140e-12)
    p = c.kiss_pressure(squared)
    assert 2408e-6 * p + 140e-12 * p * p == pytest.approx(409.0)


def test_losses_are_found_again(config):
    """From values that are far off, a few generations bring the coast-down back inside its tolerance."""
    parameters = c.load_stages()["losses"]
    off = c.with_values(config, parameters, {"loss_speed": 0.6, "loss_out_constant": 14.0})
    before = {miss.row: abs(miss.tolerances) for miss in c.loss_misses(off, TARGETS)}
    values = c.search(off, parameters, c.loss_misses, generations=6, jobs=2, seed=1)
    after = {miss.row: abs(miss.tolerances) for miss in c.loss_misses(c.with_values(off, parameters, values), TARGETS)}
    assert before["coast_down_torque"] > 3.0 > 1.0 > after["coast_down_torque"]
    assert sum(x * x for x in after.values()) < 0.2 * sum(x * x for x in before.values())


def test_what_is_found_is_written_where_the_rig_reads_it(tmp_path):
    for kind in ("rigs", "controllers"):
        shutil.copytree(CONFIG_DIR / kind, tmp_path / kind)
    rig, controller = tmp_path / "rigs" / "hydmag.yaml", tmp_path / "controllers" / "alfa46.yaml"
    lines = len(rig.read_text().splitlines())
    c.write_values({"losses.loss_speed": 1.25, "clutch_s2.clearance": 5.25e-3}, rig, controller)
    read = load_rig(rig, {})
    assert read.gearbox.loss_in_speed == 1.25 and read.clutch_s2.clearance == pytest.approx(5.25e-3)
    assert 'loss_in_speed: [1.25 -, "calibrated: rig calibrate"]' in rig.read_text()
    assert len(rig.read_text().splitlines()) == lines
    rig.write_text(rig.read_text().replace("  loss_in_speed: ", "  loss_in_sped: "))
    with pytest.raises(RigError, match="no line 'loss_in_speed"):
        c.write_values({"losses.loss_speed": 1.25}, rig, controller)


@pytest.mark.parametrize("arguments, sentence", [
    (["--stages", "loses"], "no stage 'loses'; known are losses"), (["--generations", "0"], "expected at least 1")])
def test_wrong_arguments_are_refused(capsys, arguments, sentence):
    assert main(["calibrate", *arguments]) == 2
    assert sentence in capsys.readouterr().err
