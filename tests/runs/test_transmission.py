# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The transmission as data: its ratios from the wheels, and the names of its signals and devices."""

from __future__ import annotations

import numpy as np
import pytest

from rig_nodes.base.errors import RigError
from rig_nodes.controllers.alfa46.box import Alfa46
from rig_nodes.driveline.builder import Driveline
from rig_nodes.nodes.shift_phase import ShiftPhase
from rig_nodes.rig.alfa46 import Alfa46Config
from rig_nodes.rig.configuration import load_rig
from rig_nodes.rig.driveline import held_ratio
from rig_nodes.rig.transmission import Clutch, Gear, Transmission, transmission_of
from rig_nodes.runs.plan import plan_of
from rig_nodes.runs.rig import Rig

HYDMAG = load_rig("hydmag")
BOX = HYDMAG.transmission
CATALOGUE = HYDMAG.catalogue


@pytest.fixture(scope="module")
def config():
    return load_rig("hydmag")


def test_ratios_are_those_of_tab_3_1_and_of_the_driveline(config):
    box, system = transmission_of(config), plan_of(config).true
    assert box.ratios == {1: pytest.approx(47 / 34), 2: pytest.approx(41 / 40)}
    for number, ratio in box.ratios.items():
        (clutch,) = box.engaged(number)
        slip = system.w[system.elements.index(clutch.instance)]
        into, out = (system.bodies_from_speeds[system.bodies.index(end.body)] for end in (box.input, box.output))
        both = np.flatnonzero(np.abs(into) + np.abs(out))  # the rotor turns with a speed of its own
        speeds = np.linalg.solve([into[both], out[both]], [ratio, 1.0])
        assert slip[both] @ speeds == pytest.approx(0.0, abs=1e-12), (
            "where the speeds have its ratio the gear's clutch does not slip"
        )


def test_the_ratio_of_a_planetary_set_follows_from_what_is_held():
    """Sun 30, ring 70 teeth; bodies sun (input), ring, carrier (output)."""
    drive = Driveline()
    for body in ("sun", "ring", "carrier"):
        drive.inertia(body, 0.1)
    drive.planetary("set", "sun", "ring", "carrier", 70 / 30)
    drive.brake("brake", "ring")
    drive.clutch("lock", "sun", "ring")
    system = drive.build()
    assert held_ratio(system, ["brake"], "sun", "carrier") == pytest.approx(100 / 30)
    assert held_ratio(system, ["lock"], "sun", "carrier") == pytest.approx(1.0)
    with pytest.raises(ValueError, match="leave the ratio of input to output open"):
        held_ratio(system, [], "sun", "carrier")
    with pytest.raises(ValueError, match="let nothing turn"):
        held_ratio(system, ["brake", "lock"], "sun", "carrier")


def test_every_signal_and_device_of_it_is_one_of_the_rig(config):
    box, signals, topics = transmission_of(config), CATALOGUE.signals, CATALOGUE.topics
    for clutch in box.clutches:
        names = [
            clutch.pressure,
            clutch.current,
            clutch.setpoint,
            *map(clutch.signal, ("torque", "capacity", "slip", "mode", "clamp", "piston")),
            *map(clutch.valve_signal, ("duty", "flow")),
        ]
        assert [name for name in names if name not in signals] == []
        assert signals[clutch.signal("torque")].topic == clutch.state and clutch.state in topics
        assert hasattr(config, clutch.instance) and hasattr(config, clutch.valve)
        assert config.wiring[box.clutches.index(clutch)] == clutch.output
    assert set(box.channels) <= {signal.name for signal in CATALOGUE.logger_channels()}
    assert CATALOGUE.signal("gear_ordered").states == box.names
    energies = Rig(config).energy()
    assert all(clutch.heat in energies for clutch in box.clutches)
    assert all(clutch.voltage in Rig(config).channels for clutch in box.clutches)


def test_it_is_the_same_from_a_rig_and_from_its_record(config):
    assert transmission_of(config) == transmission_of(config.as_dict())
    swapped = transmission_of(load_rig("hydmag", {"wiring": "swapped"}))
    assert [clutch.output for clutch in swapped.clutches] == [1, 0]


def test_the_kiss_pressure_is_that_of_the_cylinder(config):
    softer = load_rig("hydmag", {"clutch_s1.spring_preload": "100 N"})
    one, other = (transmission_of(rig).clutches for rig in (config, softer))
    lost = (config.clutch_s1.spring_preload - 100.0) / (1.0 - config.clutch_s1.seal_friction_share)
    assert one[0].kiss_pressure - other[0].kiss_pressure == pytest.approx(lost / config.clutch_s1.piston_area, rel=0.03)
    assert one[1].kiss_pressure == other[1].kiss_pressure
    # the thesis prints 0.17 and 0.36 MPa, where the torque clearly rises; the transducers' largest errors are 0.1 and 0.0625 MPa
    assert [clutch.kiss_pressure for clutch in one] == [pytest.approx(0.17e6, abs=0.1e6), pytest.approx(0.36e6, abs=62.5e3)]


def test_the_phases_of_a_shift_are_told_by_the_clutch_that_it_engages(config):
    box = transmission_of(config)
    up, w = ShiftPhase(box, 1, 2), 150.0
    kiss = box.clutches[1].kiss_pressure
    assert up.name(w, w / box.ratios[1], (2e6, 0.9 * kiss)) == "fill"
    assert up.name(w, w / box.ratios[1], (2e6, 1.1 * kiss)) == "torque phase"
    assert up.name(w, 0.9 * w / box.ratios[2], (0.0, 2e6)) == "inertia phase"
    assert up.name(w, w / box.ratios[2], (0.0, 2e6)) == "locked"
    assert ShiftPhase(box, 2, 0).name(w, w, (0.0, 2e6)) == "release"
    assert up.slip(w, 0.9 * w / box.ratios[2]) == pytest.approx(0.1) and up.slip(0.5, 0.1) == 0.0


def test_gears_are_meant_by_name_or_number():
    box = BOX
    assert [box.number(text) for text in ("N", "n", "neutral", "0", "I", "i", "1", "II", "2")] == [0] * 4 + [1] * 3 + [2] * 2
    assert box.number("III") is None and box.number("") is None
    assert box.way(0, 2) == "0 -> II" and box.way(2, 7) == "II -> 7"
    assert [box.changes(*way) for way in ((1, 2), (2, 1), (0, 1), (2, 0), (1, 1))] == [True, True, False, False, False]


def with_gears(count: int) -> Transmission:
    box = BOX
    more = [
        Clutch(f"S{k}", f"clutch_s{k}", f"valve_{k}", f"V{k}", k - 1, f"p{k}", f"I{k}", f"I_set{k}", 0.2e6, 1e7)
        for k in range(3, count + 1)
    ]
    gears = [Gear(k, "I" * k, (f"S{k}",), 1.0 / k, (k - 1,) if k <= 3 else ()) for k in range(3, count + 1)]
    return Transmission(box.input, box.output, (*box.clutches, *more), (*box.gears, *gears), box.inertias)


def test_the_box_takes_the_gears_that_there_are_and_has_three_outputs(config):
    settings = Alfa46Config(config.alfa46.values, config.alfa46.profiles[[0, 1, 0]])  # the third output is not used on this rig
    three = Alfa46(settings, with_gears(3))
    three.order(3)
    for sample in range(700):
        _, setpoint = three.step(sample, [0.0] * 3)
    assert three.gear == 3 and setpoint[2] > 0.0 and not setpoint[:2].any()
    with pytest.raises(RigError, match=r"there is no gear 3; order 0 \(neutral\), 1 \(I\) or 2 \(II\)"):
        Alfa46(config.alfa46, config.transmission).order(3)
    with pytest.raises(RigError, match="the Alfa46 has 3 outputs, and V4 is on output 4; run this rig with a controller"):
        Alfa46(config.alfa46, with_gears(4)).order(4)
