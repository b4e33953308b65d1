# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Elements of the driveline beside clutches, valves, losses by torque and meters: one step moves laws and devices."""

import pytest

from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.rig import Rig

BASE = "description: three speeds and more\nbase: three_speed\n"
WITHOUT = (
    BASE
    + """\
torques:
  air: {body: output, table: [[[0 rpm, 0 Nm], [3000 rpm, 0 Nm]], "nothing"]}
"""
)
WITH = (
    BASE
    + """\
torques:
  air: {body: output, table: [[[0 rpm, 0 Nm], [3000 rpm, -30 Nm]], "assumed"]}
bodies: {wheel_2: {inertia: [0.01 kg m2, "assumed"]}}
meshes:
  - {name: second, bodies: [input, wheel_2], teeth: [30, 48], efficiency: [90 %, "assumed"], source: "as the base"}
"""
)


def driven(folder, text: str | None, gear: int) -> Rig:
    if text is not None:
        folder.mkdir()
        (folder / "rig.yaml").write_text(text)
    rig = Rig(load_rig(folder if text is not None else "three_speed", {"effects.transducers": "off"}))
    rig.set("oil", 4e6, True)
    rig.advance(0.3)
    rig.set("motor", 100.0, True)
    rig.set("load", 3e6, True)
    rig.order_gear(gear)
    rig.advance(2.5)
    return rig


def test_a_law_that_does_nothing_leaves_the_gearbox_as_it_was(tmp_path):
    plain, law = driven(tmp_path, None, 1), driven(tmp_path / "law", WITHOUT, 1)
    assert law.world.plan.driven and not plain.world.plan.driven and law.reason == plain.reason == ""
    for what in ("input.speed", "output.speed", "M_in", "M_out", "clutch_2.pressure", "loss_in.torque", "brake_1.temperature"):
        assert law.true(what) == pytest.approx(plain.true(what), rel=1e-5, abs=1e-6), what
    one, other = plain.energy(), law.energy()
    assert abs(other["residual"]) < 1e-9 * other["motor"] and abs(other["torques"]) < 1e-6
    for name, value in one.items():
        assert other[name] == pytest.approx(value, rel=1e-4, abs=1e-3), name


def test_a_gear_whose_mesh_loses_keeps_its_ratio_and_takes_its_share_of_the_power(tmp_path):
    rig = driven(tmp_path / "lossy", WITH, 2)
    w_in, w_out = rig.true("input.speed"), rig.true("output.speed")
    assert (
        rig.reason == ""
        and rig.config.transmission.ratios[2] == pytest.approx(1.6)
        and w_in / w_out == pytest.approx(1.6, rel=1e-9)
    )
    taken, given = rig.true("second.torque"), rig.friction_torque("clutch_2")
    assert given * w_out == pytest.approx(0.9 * taken * w_in, rel=1e-6), "what the wheel gives the clutch"
    energy = rig.energy()
    assert rig.true("air.torque") == pytest.approx(-30.0 * w_out / 314.159, rel=1e-4)
    assert abs(energy["residual"]) < 1e-9 * energy["motor"] and energy["torques"] > 100.0 and energy["elements"] > 100.0


def test_the_acceleration_of_a_body_counts_the_shaft_on_it():
    rig = Rig(load_rig("clutch_bench", {"effects.transducers": "off"}))
    rig.set("motor", 8.0, True)
    rig.set("relief", 5e6, True)
    rig.advance(0.05)
    place = rig.world.plan.bodies.index("shaft")
    rates, before = [], rig.true("shaft.speed")
    for _ in range(20):
        rig.advance(0.001)
        rates.append(float(rig.world.line["rate"][place]))
    # the only friction at this body is the pack's drag; all other torque is transmitted by the shaft
    assert max(map(abs, rates)) > 5.0
    assert sum(rates) * 0.001 == pytest.approx(rig.true("shaft.speed") - before, rel=0.15)
