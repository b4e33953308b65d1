# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Levers of a rig: a sequence or controller moves the throttle of an engine's map and the ratio of a variator."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from rig_nodes.base.errors import RigError
from rig_nodes.driveline.run import run
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.rig import Rig

FOLDER = Path(__file__).parent / "levers"
TEXT = (FOLDER / "rig.yaml").read_text()


def test_levers_move_a_throttle_and_a_ratio_as_inputs_over_time_do():
    rig = Rig(load_rig(FOLDER, {"effects.transducers": "off"}))
    rig.set("pedal_lever", 0.8, True)
    rig.advance(0.5)
    assert rig.true("pedal.position") == pytest.approx(0.8) and rig.true("engine.speed") > 110.0
    rig.set("cone_lever", 1.2, True)
    rig.advance(1.0)
    given = {"throttle": ([0.0, 0.16], [0.0, 0.8]), "belt": ([0.5, 1.3], [2.0, 1.2])}
    alone = run(rig.world.plan.system, 1.5, 1e-3, given)
    for body in ("engine", "wheel"):
        assert rig.true(f"{body}.speed") == pytest.approx(alone.speed(body)[-1], rel=1e-4), body
    assert rig.true("engine.speed") == pytest.approx(1.2 * rig.true("wheel.speed"), rel=1e-9)
    energy = rig.energy()
    assert abs(energy["residual"]) < 1e-9 * abs(energy["torques"])
    work = np.trapezoid(alone.torque("map") * alone.speed("engine") + alone.torque("drag") * alone.speed("wheel"), alone.t)
    assert energy["torques"] == pytest.approx(-work, rel=1e-3), "none of it comes from the variator"
    rig.e_stop()
    rig.advance(1.0)
    assert rig.true("pedal.position") == 0.0 and rig.true("cone.position") == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        (
            "moves: throttle",
            "moves: throtle",
            "parts.pedal.moves names 'throtle', expected an input over which a table is.*'throttle'",
        ),
        ("moves: belt", "moves: throttle", "names 'throttle', which follows pedal already; one is possible"),
        ("signals:", 'inputs: {throttle: [50 %, "x"]}\nsignals:', "which follows the table over time under inputs already"),
        ("of: [engine, throttle]", "of: [engine, wheel]", "there is 'wheel' among the bodies already; name the input otherwise"),
        (
            "by: [speed, input]",
            "by: [speed, inputs]",
            "map.by is .'speed', 'inputs'., expected two of speed, angle, ratio, input, time",
        ),
        (
            ", [4000 rpm, 100 %, 60 Nm]",
            "",
            "has 3 points with 2 values of the first quantity and 2 of the second; one for each pair",
        ),
        ("[0 rpm, 0 %, 0 Nm]", "[0 rpm, 0 Nm]", r"a point is \[angular velocity, ratio, torque\], each with its unit"),
        ("of: [engine, throttle]", "of: engine", "map.of is 'engine', expected a list with what each quantity"),
    ],
)
def test_a_wrong_map_or_lever_is_refused_in_one_sentence_with_its_line(tmp_path, old, new, sentence):
    assert old in TEXT
    shutil.copytree(FOLDER, tmp_path / "rig")
    (tmp_path / "rig" / "rig.yaml").write_text(TEXT.replace(old, new, 1))
    with pytest.raises(RigError, match=sentence) as refused:
        load_rig(tmp_path / "rig")
    assert "rig.yaml:" in str(refused.value) and "\n" not in str(refused.value)
