# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Valves, cylinders and oil of the rig hydmag: cold oil, and oil that warms."""

import dataclasses

import pytest

from rig_nodes.bags.reader import Bag
from rig_nodes.config.names import DEFAULT_RIG
from rig_nodes.testbench.configuration import load_rig
from rig_nodes.testbench.rig import Rig
from rig_nodes.testbench.sequence import load_sequence
from rig_nodes.testbench.simulate import simulate

COLD, USUAL = "-10 degC", "40 degC"


def oil_at(temperature: str) -> Rig:
    """Returns the rig with its supply up, true values, and oil that keeps a temperature."""
    config = load_rig(DEFAULT_RIG, {"oil_supply.temperature": temperature, "oil_supply.tank_heat_capacity": "0 J/K"})
    rig = Rig(config.replaced(effects=dataclasses.replace(config.effects, transducers=False)))
    rig.set("oil", 4e6, True)
    rig.advance_samples(300)
    return rig


def test_cold_oil_fills_slowly():
    """At -10 degC the oil is some fifty times as viscous as at 40 degC: filling S1 takes clearly longer."""
    taken = {}
    for temperature in (COLD, USUAL):
        rig = oil_at(temperature)
        rig.order_gear(1)
        taken[temperature] = next(t for t in range(5000) if rig.advance_samples(1) or rig.clutches[0]["clamp"] > 200.0)
    assert taken[COLD] > 1.5 * taken[USUAL]


@pytest.mark.parametrize("temperature", [COLD, USUAL, "90 degC"])
def test_no_pressure_falls_below_vacuum(temperature):
    rig, least = oil_at(temperature), 0.0
    for gear in (1, 0, 2, 1, 2, 0):
        rig.order_gear(gear)
        for _ in range(1500):
            rig.advance_samples(1)
            ports = (rig.fed_pressure(valve) for valve in rig.valve_names)
            least = min(least, *ports, *(clutch["chamber"] for clutch in rig.clutches))
    assert rig.reason == "" and least > -101325.0


def test_a_sequence_waits_for_a_temperature_that_comes_by_itself(tmp_path):
    """10 l/min at 4 MPa are 667 W: 2 K of a tank of 1 kJ/K take 3 s, and some more by what the tank gives off."""
    text = """\
description: oil warms by what its pump does
steps:
  - oil: {pressure: 4 MPa}
  - wait: {until: {signal: T_oil, above: 32 degC}, hold: 100 ms, timeout: 20 s}
"""
    (tmp_path / "warm.yaml").write_text(text)
    tank = {"temperature": "30 degC", "ambient_temperature": "20 degC", "tank_heat_capacity": "1000 J/K", "tank_cooling": "10 W/K"}
    config = load_rig(DEFAULT_RIG, {f"oil_supply.{name}": value for name, value in tank.items()})
    end = simulate(config, load_sequence(tmp_path / "warm.yaml"), tmp_path / "run")["end"]
    assert end["state"] == "ended", end["reason"]
    t, oil = Bag(tmp_path / "run").series("T_oil")
    assert oil[0] == pytest.approx(30.0, abs=1.0) and oil[-1] > 31.5
    assert 2.5 < t[-1] - t[0] < 6.0
