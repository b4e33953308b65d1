# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The clutch bench for the engine, from its configuration; used by testbench.clutch_bench."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..alfa46 import law
from ..engine.plan import Instance, Plan
from ..parts import plates
from ..plant.driveline import Driveline
from ..plant.driveline_losses import loss_width
from .clutch_bench_configuration import ClutchBenchConfig

CHANNELS = {"M_e": "torque_meter.torque", "n": "shaft.speed", "p_z": "cylinder.pressure", "s": "cylinder.travel",
            "p_sh": "hydraulic_motor.pressure", "T_emp": "oil_supply.oil_temperature", "F_ps": "cylinder.force"}


def plan_of(config: ClutchBenchConfig) -> Plan:
    """Motor, torque meter, shaft, pack to the held housing, friction of the motor; the cylinder presses the pack."""
    c, effects = config, config.effects
    d = Driveline()
    d.inertia("motor", c.hydraulic_motor.inertia)
    d.inertia("shaft", c.shaft.inertia)
    d.shaft("torque_meter", "motor", "shaft", stiffness=c.shaft.meter_stiffness, damping=c.shaft.meter_damping)
    d.brake("clutch_pack", "shaft")
    d.brake("friction", "motor")
    system = d.build()
    cylinder, pack = c.cylinder, c.plate_pack
    if not effects.seal_friction:
        cylinder = replace(cylinder, seal_friction=0.0, seal_friction_back=0.0)
    if not effects.plate_heat:
        pack = replace(pack, friction_per_kelvin=0.0)
    temperature = c.oil_supply.temperature
    instances = (
        Instance("oil_supply", "oil_supply", (c.oil_supply,), wires={"line": "supply"},
                 start={"oil_temperature": temperature}),
        Instance("hydraulic_motor", "hydraulic_motor", (c.hydraulic_motor,),
                 wires={"body": "motor", "element": "friction", "oil": "oil_supply"}),
        Instance("cylinder", "press_cylinder", (cylinder,), wires={"oil": "oil_supply"}),
        Instance("clutch_pack", "pressed_clutch", (c.pack, pack),
                 {**plates.derived(pack, c.pack, cylinder.contact_travel), "clearance": cylinder.contact_travel},
                 {"element": "clutch_pack", "oil": "oil_supply", "press": "cylinder"}, {"temperature": temperature}))
    return Plan(system, ("motor", "shaft"), ("supply",), instances, (), np.zeros((0, loss_width(*system.w.T.shape))),
                CHANNELS, ("n",), law.OUTPUTS)
