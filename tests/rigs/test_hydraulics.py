# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Valves, cylinders and oil of the rig hydmag: filling, ramps of the pressures, cold oil, and oil that warms."""

import dataclasses

import numpy as np
import pytest

from rig_nodes.bags.reader import Bag
from rig_nodes.base.names import DEFAULT_RIG
from rig_nodes.rig.configuration import load_rig
from rig_nodes.rigs.hydmag.laboratory.calibration_rows import CURVES, FIRST_RISE, distances, first_true, pressures
from rig_nodes.rigs.hydmag.laboratory.targets import load_targets
from rig_nodes.runs.rig import Rig
from rig_nodes.runs.sequence import load_sequence
from rig_nodes.runs.simulation import simulate

COLD, USUAL = "-10 degC", "40 degC"
# clutch -> times after the first rise between which the current ramps and Annex D has a straight line [s]: S1 fills, then follows
# its valve; S2 fills. S1's piston is at the plates 13 ms before the end of Annex D's first line
RAMPS = {"S1": ((0.03, 0.068), (0.1786, 0.4)), "S2": ((0.03, 0.2285),)}
WINDOW = 20  # samples over which a slope is taken


def oil_at(temperature: str) -> Rig:
    """Returns the rig with its supply up, true values, and oil that keeps a temperature."""
    config = load_rig(DEFAULT_RIG, {"oil_supply.temperature": temperature, "oil_supply.tank_heat_capacity": "0 J/K"})
    rig = Rig(config.replaced(effects=dataclasses.replace(config.effects, transducers=False), trips_watched=False))
    rig.set("oil", 4e6, True)
    rig.advance_samples(300)
    return rig


@pytest.fixture(scope="module")
def rises():
    """Pressure of each clutch at each millisecond after it is ordered."""
    return {name: pressures(load_rig("hydmag"), name)[0] for name in CURVES}


@pytest.mark.parametrize("name", CURVES)
def test_pressures_follow_annex_d_along_its_ramps(rises, name):
    rise, target = rises[name], next(row for row in load_targets() if row.id == CURVES[name][0])
    apart = np.abs(distances(target, rise, first_true(rise > rise[0] + FIRST_RISE, 9.0)))
    for begins, ends in RAMPS[name]:
        assert apart[round(1e3 * begins) : round(1e3 * ends)].max() < 0.1e6


@pytest.mark.parametrize("name", CURVES)
def test_no_pressure_rests_while_the_current_ramps(rises, name):
    """Annex D has 1.3 to 1.6 MPa/s while a cylinder fills and 5.9 MPa/s after that: at half of this it is not at rest."""
    rise, least = rises[name], iter((0.65e6, 2.9e6))
    first = round(1e3 * first_true(rise > rise[0] + FIRST_RISE, 9.0))
    for begins, ends in RAMPS[name]:
        part = rise[first + round(1e3 * begins) : first + round(1e3 * ends)]
        assert (part[WINDOW:] - part[:-WINDOW]).min() > next(least) * WINDOW * 1e-3


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
    """10 l/min at 4 MPa are 667 W: 2 K of a tank of 1 kJ/K take 3 s, and slightly more because of the tank's cooling."""
    text = """\
description: oil warms by what its pump does
steps:
  - oil: {pressure: 4 MPa}
  - wait: {until: {signal: T_oil, above: 32 degC}, hold: 100 ms, timeout: 20 s}
"""
    (tmp_path / "warm.yaml").write_text(text)
    tank = {"temperature": "30 degC", "ambient_temperature": "20 degC", "tank_heat_capacity": "1000 J/K", "tank_cooling": "10 W/K"}
    config = load_rig(DEFAULT_RIG, {f"oil_supply.{name}": value for name, value in tank.items()})
    end = simulate(config, load_sequence(tmp_path / "warm.yaml", default="hydmag"), tmp_path / "run")["end"]
    assert end["state"] == "ended", end["reason"]
    t, oil = Bag(tmp_path / "run").series("T_oil")
    assert oil[0] == pytest.approx(30.0, abs=1.0) and oil[-1] > 31.5
    assert 2.5 < t[-1] - t[0] < 6.0
