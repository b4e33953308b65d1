# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A load that is given as a torque on a rig without gears and output: it brakes by the speed of its own body, or is refused."""

import pytest

from rig_nodes.base.errors import RigError
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs import Session, load_sequence, record

RIG = """\
description: a motor that turns a load pump
step: [100 us, x]
bodies:
  shaft: {inertia: [0.5 kg m2, x]}
  other: {inertia: [0.1 kg m2, x]}
meshes:
  - {bodies: [shaft, other], teeth: [20, 20], source: own}
parts:
  motor: {part: dc_motor, body: shaft, torque_limit: [500 Nm, x], braking_limit: [200 Nm, x], power_limit: [70 kW, x],
    torque_time: [3.3 ms, x], speed_gain: [80 Nm s/rad, x], speed_gain_integral: [6000 Nm/rad, x], ramp: [3000 rpm/s, x]}
  load_pump: {part: load_pump, called: load, body: shaft, displacement: [100 cm3/rev, x], mechanical_loss: [0.5 Nm, x],
    pressure_time: [20 ms, x], pressure_limit: [25 MPa, x]}
transducers:
  n: {type: speed, shows: shaft.speed, at: motor, range: [0 rpm, 3000 rpm], text: Speed of the shaft.}
  p: {type: pressure, shows: load_pump.pressure, at: load_pump, range: [0 MPa, 25 MPa], text: Pressure of the pump.}
instruments: {speed_range: [3600 rpm, x], speed_gate: [2 ms, x], pressure_range: [25 MPa, x], hum_frequency: [50 Hz, x],
  anti_alias: [1 kHz, x], resolution_bits: [12 -, x]}
"""
SEQUENCE = """\
description: a load by torque
steps:
  - motor: {speed: 1000 rpm}
  - wait: {until: {signal: n, above: 990 rpm}}
  - load: {torque: 50 Nm}
  - wait: {for: 1 s}
"""


@pytest.fixture
def bench(tmp_path):
    """A function that writes the rig with one text in place of another, and returns its folder; the sequence lies there too."""

    def write(old="", new=""):
        (tmp_path / "rig.yaml").write_text(RIG.replace(old, new) if old else RIG)
        (tmp_path / "brake.yaml").write_text(SEQUENCE)
        return tmp_path

    return write


def test_the_speed_of_its_own_body_counts(bench):
    folder = bench()
    config = load_rig(folder)
    session = Session(config)
    session.set("motor", "1000 rpm")
    session.advance(2.0)
    session.set("load", "50 Nm")
    session.advance(1.0)
    assert session.true("load_torque") == pytest.approx(50.0, abs=1.0)
    run = record(config, load_sequence(folder / "brake.yaml", rig=folder, config=config), plant_states=("load_torque",))
    assert run.plant_states["load_torque"][-1] == pytest.approx(50.0, abs=1.0)
    (folder / "brake.yaml").write_text(SEQUENCE.replace("50 Nm", "900 Nm"))
    with pytest.raises(RigError, match=r"brake\.yaml:5: load\.torque is 900 Nm; the rig takes 0 to 398"):
        load_sequence(folder / "brake.yaml", rig=folder, config=config)


def test_without_a_transducer_of_it_a_torque_is_refused_in_one_sentence(bench):
    folder = bench("shows: shaft.speed", "shows: other.speed")
    config = load_rig(folder)
    sentence = (
        "a torque of load_pump needs the speed of its body, which nothing measures; set its pressure, or give transducers one"
    )
    with pytest.raises(RigError, match=f"^{sentence} with type: speed, shows: shaft.speed$"):
        Session(config).set("load", "50 Nm")
    with pytest.raises(RigError, match=rf"brake\.yaml:5: load\.torque: {sentence}"):
        load_sequence(folder / "brake.yaml", rig=folder, config=config)
