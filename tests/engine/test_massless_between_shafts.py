# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A rig with a body without inertia between two shafts."""

import numpy as np
import pytest
from small_rig import HEAD

from rig_nodes.base.errors import RigError
from rig_nodes.driveline.run import Run
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.plan import plan_of
from rig_nodes.runs.rig import Rig

RIG = (
    "description: two shafts with a flange between them\n"
    + HEAD
    + """bodies:
  engine: {inertia: [0.3 kg m2, x], speed: [100 rad/s, x]}
  flange: massless
  fan: {inertia: [0.4 kg m2, x], speed: [90 rad/s, x]}
shafts:
  first: {joins: [engine, flange], stiffness: [900 Nm/rad, x], damping: [0.9 Nm s/rad, x]}
  second: {joins: [flange, fan], stiffness: [300 Nm/rad, x], damping: [0.3 Nm s/rad, x]}
"""
)


def rig_of(tmp_path, text):
    (tmp_path / "rig.yaml").write_text(text.replace(" x]", ' "assumed"]'))
    return load_rig(tmp_path, {"effects.transducers": "off"})


def test_it_moves_as_python_alone_says(tmp_path):
    config = rig_of(tmp_path, RIG)
    rig, run = Rig(config), Run(plan_of(config).plan.system, 1e-4)
    system = rig.world.plan.system
    for k in range(1, 101):
        rig.advance(0.001)
        assert system.bodies_from_speeds @ rig.v == pytest.approx(run.to(0.001 * k).speeds, rel=1e-9)
    twists = run.result().shaft_torques
    assert np.abs(twists[1:, 0] - twists[1:, 1]).max() < 1e-9 and np.abs(twists).max() > 1.0
    assert abs(rig.energy()["residual"]) < 1e-9 * abs(rig.energy()["stored"])


@pytest.mark.parametrize(
    "was, now, words",
    [
        ("body: engine, torque", "body: flange, torque", "'flange' has no inertia and stands between shafts.*and motor does"),
        ("shafts:", "inputs:\n  flange: [[[0 s, 1 Nm], [1 s, 2 Nm]], x]\nshafts:", "stands between shafts.*and an input does"),
        ("[0.3 Nm s/rad, x]", "[0.4 Nm s/rad, x]", "'flange' has no inertia, and the damping of its shafts"),
    ],
)
def test_what_does_not_fit_is_refused_with_file_and_line(tmp_path, was, now, words):
    with pytest.raises(RigError, match=rf"rig\.yaml:\d+: .*{words}"):
        rig_of(tmp_path, RIG.replace(was, now))
