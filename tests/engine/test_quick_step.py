# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Steps without an event, of a rig with laws and no shaft, are computed by the quick method, with the results of the full one."""

import numpy as np
import pytest
from small_rig import HEAD

from rig_nodes.driveline.run import Run
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.plan import plan_of
from rig_nodes.runs.rig import Rig

COMMON = (
    "description: what depends on the motion\n"
    + HEAD
    + """bodies:
  engine: {inertia: [0.3 kg m2, x], speed: [100 rad/s, x]}
  saw: {inertia: [0.1 kg m2, x]}
  fan: {inertia: [0.4 kg m2, x]}
"""
)
LAWS = """
  sun: {inertia: [0.6 kg m2, x], speed: [90 rad/s, x]}
  crank: {inertia: [0.05 kg m2, x], speed: [50 rad/s, x]}
  swing: {inertia: [0.8 kg m2, x], speed: [3 rad/s, x]}
clutches:
  coupling: {joins: [saw, fan], drag: [0.3 Nm s/rad, x]}
  shoes: {joins: [engine, saw], capacity: {of: engine, table: [[[0 rad/s, 0 Nm], [60 rad/s, 1 Nm], [120 rad/s, 40 Nm]], x]},
    stick: [1.2 -, x]}
brakes:
  low: {body: sun, drag: [0.02 Nm s/rad, x], friction: [[[0 rad/s, 1 -], [30 rad/s, 0.8 -], [200 rad/s, 0.6 -]], x]}
torques:
  air: {body: fan, table: [[[0 rad/s, 0 Nm], [20 rad/s, -1 Nm], [40 rad/s, -3 Nm], [200 rad/s, -40 Nm]], x]}
  tyre: {body: saw, of: shoes, by: speed, table: [[[-100 rad/s, 2 Nm], [100 rad/s, -6 Nm]], x]}
  gravity: {body: swing, by: angle, period: [360 deg, x], angle: [0.5 rad, x],
    table: [[[0 deg, 0 Nm], [90 deg, -20 Nm], [180 deg, 0 Nm], [270 deg, 20 Nm], [360 deg, 0 Nm]], x]}
slider_cranks:
  piston: {body: crank, mass: [2 kg, x], radius: [80 mm, x], rod: [200 mm, x], angle: [0.4 rad, x]}
inputs:
  engine: [[[0 s, 10 Nm], [0.1 s, 25 Nm], [0.1 s, 15 Nm]], x]
  low: [[[0.02 s, 3 Nm], [0.25 s, 30 Nm]], x]
  tyre: [[[0 s, 1 -], [0.2 s, 2 -]], x]
"""
WORM = """
clutches:
  coupling: {joins: [saw, fan], drag: [0.3 Nm s/rad, x]}
meshes:
  - {name: worm, bodies: [engine, saw], teeth: [20, 40], efficiency: [60 %, x], back: [30 %, x], source: x}
torques:
  air: {body: fan, table: [[[0 rad/s, 0 Nm], [20 rad/s, -1 Nm], [200 rad/s, -40 Nm]], x]}
inputs:
  engine: [[[0 s, 10 Nm], [0.1 s, 25 Nm], [0.2 s, -15 Nm]], x]
"""


@pytest.mark.parametrize("more", [LAWS, WORM], ids=["laws", "mesh"])
def test_a_step_without_an_event_is_quick_and_agrees_with_python_alone(tmp_path, more):
    text = (COMMON + more.lstrip("\n")).replace("engine: {inertia: [0.3 kg m2, x], speed: [100 rad/s, x]}", "ENGINE")
    start = "" if more is WORM else ", speed: [100 rad/s, x]"
    text = text.replace("ENGINE", "engine: {inertia: [0.3 kg m2, x]" + start + "}")
    (tmp_path / "rig.yaml").write_text(text.replace(" x]", ' "assumed"]').replace("source: x", 'source: "assumed"'))
    config = load_rig(tmp_path, {"effects.transducers": "off"})
    plan = plan_of(config).plan
    rig, run = Rig(config), Run(plan.system, 1e-4, {name: (table.x, table.y) for name, table in plan.inputs.items()})
    quick, missed = 0, 0.0
    for k in range(1, 301):
        rig.advance(0.001)
        quick += rig.world.line["made"][0] == 1.0
        missed = max(missed, np.abs(rig.world.plan.system.bodies_from_speeds @ rig.v - run.to(0.001 * k).speeds).max())
    result, energy = run.result(), rig.energy()
    # the full method is exact where a torque is a straight line of the motion, the quick one of second order
    assert missed < 1e-6 and result.capped == 0 and rig.reason == ""
    assert quick > 240, "most steps are quick"
    assert abs(energy["residual"]) < 1e-9 * abs(energy["torques"])
    assert energy["torques"] == pytest.approx(-result.e_in[-1], rel=1e-6)
    assert energy["elements"] == pytest.approx((result.e_fric + result.e_visc)[-1].sum(), rel=1e-6)
    for name in [law.name for law in plan.system.laws if law.name in ("shoes", "low", "air", "tyre", "gravity")]:
        assert rig.true(f"{name}.torque") == pytest.approx(result.torque(name)[-1], rel=1e-6, abs=1e-5), name
    rates = plan.system.bodies_from_speeds @ rig.world.line["accel"]
    assert rates == pytest.approx(result.accelerations()[-1], rel=1e-5, abs=1e-4)


def beside(tmp_path, text, seconds):
    """Returns a rig of a text after some seconds, and the largest distance of its speeds from those of Python alone until then."""
    (tmp_path / "rig.yaml").write_text(text.replace(" x]", ' "assumed"]'))
    rig = Rig(load_rig(tmp_path, {"effects.transducers": "off"}))
    plan = plan_of(rig.config).plan
    run, missed = Run(plan.system, 1e-4, {name: (table.x, table.y) for name, table in plan.inputs.items()}), 0.0
    for k in range(1, round(1000 * seconds) + 1):
        rig.advance(0.001)
        missed = max(missed, np.abs(plan.system.bodies_from_speeds @ rig.v - run.to(0.001 * k).speeds).max())
    return rig, missed


@pytest.mark.parametrize("bodies", [1, 4])
def test_a_rig_with_nothing_but_inputs_over_time_moves_as_they_say(tmp_path, bodies):
    """The points of the inputs lie inside of steps; each body gains the area below its input over its inertia."""
    names = ["engine", "a", "b", "c"][:bodies]
    text = "description: free bodies\n" + HEAD + "bodies:\n" + "".join(f"  {name}: {{inertia: [0.3 kg m2, x]}}\n" for name in names)
    text += "inputs:\n" + "".join(f"  {name}: [[[0 s, 50 Nm], [0.01005 s, 50 Nm], [0.02005 s, 30 Nm]], x]\n" for name in names)
    rig, missed = beside(tmp_path, text, 0.03)
    assert rig.v == pytest.approx([(0.5025 + 0.4 + 0.2985) / 0.3] * bodies, rel=1e-9)
    assert missed < 1e-9 and abs(rig.energy()["residual"]) < 1e-9


def test_steps_with_points_of_inputs_between_quick_ones_are_those_of_python_alone(tmp_path):
    """A centrifugal clutch, whose capacity has no place among the shafts, beside an input with points inside of steps."""
    loads = ", ".join(f"[{0.01 * k + 5e-5:.5f} s, {-30 if k % 2 else -5} Nm]" for k in range(2, 9))
    text = (
        "description: a centrifugal clutch\n"
        + HEAD
        + f"""bodies:
  engine: {{inertia: [0.03 kg m2, x]}}
  drum: {{inertia: [0.05 kg m2, x]}}
clutches:
  shoes: {{joins: [engine, drum], capacity: {{of: engine, table: [[[0 rad/s, 0 Nm], [60 rad/s, 1 Nm], [70 rad/s, 140 Nm]], x]}},
    stick: [1.2 -, x]}}
inputs:
  engine: [[[0 s, 40 Nm], [0.1 s, 40 Nm], [0.1 s, -20 Nm]], x]
  drum: [[[0 s, -5 Nm], {loads}, [0.4 s, -5 Nm]], x]
"""
    )
    rig, missed = beside(tmp_path, text, 0.2)
    assert missed < 1e-8 and abs(rig.energy()["residual"]) < 1e-9 * abs(rig.energy()["torques"])
