# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The HydmAG rig for the engine, from its configuration; used by testbench.rig."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..alfa46 import law
from ..engine.plan import Instance, Meter, Plan
from ..parts import plates
from ..parts.gear_loss import GearLossConfig
from ..plant import driveline_losses as losses
from ..plant.driveline import Driveline, System
from ..plant.wheels import INPUT, OUTPUT, REDUCTION, SIDES
from .configuration import PARTS, RigConfig
from .effects import leave_out

UNMOVED = 1e6  # kg m2 on w0 where n_wej is to stay, whatever happens; in no torque and no energy that is told
VALVES, CLUTCHES = ("valve_zr_p1", "valve_zr_p2"), ("clutch_s1", "clutch_s2")
# column of the logger -> where its true value is
CHANNELS = {"M_wej": "M_wej", "n_wej": "w0.speed", "M_wyj": "M_wyj", "n_wyj": "wk.speed",
            "p1": "clutch_s1.pressure", "p2": "clutch_s2.pressure", "p_po": "load_pump.pressure",
            "I_zr_p1": "valve_zr_p1.current", "I_zr_p2": "valve_zr_p2.current", "p_p": "supply.pressure",
            "T_oil": "oil_supply.oil_temperature", "U_zr_p1": "valve_zr_p1.on", "U_zr_p2": "valve_zr_p2.on"}


def build_driveline(inertia_in: float, inertia_out_z5: float) -> System:
    """Shafts w0 and wk, clutches S1 and S2 on their wheels, both losses, the load.

    Slip of S1 is wheel z3 (w_wej / i31) minus the intermediate shaft (w_wyj / i48); slip of S2 is w0 minus wheel
    z5 (w_wyj / i58), (6.87)-(6.92). J_od is given on the z5 axis; on wk it is multiplied by (z8/z5)^2.
    """
    d = Driveline()
    d.inertia(INPUT, inertia_in)
    d.inertia(OUTPUT, inertia_out_z5 * REDUCTION**2)
    for name, (driving, driven) in zip(CLUTCHES, SIDES.values()):
        d.clutch(name, INPUT, OUTPUT, ca=driving, cb=driven)
    d.brake("loss_in", INPUT)
    d.brake("loss_out", OUTPUT)
    d.brake("load_pump", OUTPUT)
    return d.build()


def torque_losses(gearbox, system: System) -> np.ndarray:
    """The losses by torque for the driveline's step (2, loss_width), Annex D: by the torque that w0 gives the clutches,
    and by the load's at its torque meter, a parabola on the z5 axis. BASE and FACTOR are the step's to say.
    """
    out = np.zeros((2, losses.loss_width(*system.w.T.shape)))
    weights, place, z5 = out[:, losses.WEIGHTS:], system.elements.index, REDUCTION
    own = place("loss_in"), place("loss_out")
    on = own[0], own[0] if gearbox.loss_by_load_side == "driving" else own[1]
    parabolas = ((gearbox.loss_in_constant, gearbox.loss_in_share, gearbox.loss_in_square),
                 (0.0, gearbox.loss_out_share * z5, gearbox.loss_out_square * z5))
    for k in range(2):
        out[k, :losses.OWN] = parabolas[k]
        out[k, [losses.OWN, losses.ON, losses.FACTOR, losses.WAY]] = own[k], on[k], 1.0, k
    clutches = [place(name) for name in CLUTCHES]
    weights[0, clutches] = system.w[clutches, 0]
    weights[1, place("load_pump")], weights[1, len(system.elements) + 1] = 1.0, gearbox.inertia_pump
    return out


def plan_of(config: RigConfig) -> tuple[Plan, System]:
    """The plan of a rig, and its driveline as it really is (where n_wej is to stay, the plan's has a heavy w0)."""
    effects = config.effects
    c = replace(config, **leave_out({name: getattr(config, name) for name in PARTS}, effects))
    gearbox, stiff = c.gearbox, not effects.motor_speed
    true = build_driveline(gearbox.inertia_in, gearbox.inertia_out_z5)
    system = build_driveline(UNMOVED, gearbox.inertia_out_z5) if stiff else true
    driving = gearbox.loss_by_load_side == "driving"
    instances = [
        Instance("oil_supply", "oil_supply", (c.oil_supply,), wires={"line": "supply"},
                 start={"oil_temperature": c.oil_supply.temperature}),
        Instance("motor", "dc_motor", (c.motor,), wires={"body": "w0"},
                 derived={"stiff": float(stiff), "inertia": gearbox.inertia_in, "mobility": system.minv[0, 0]}),
        Instance("load_pump", "load_pump", (c.load_pump,), wires={"body": "wk", "element": "load_pump"}),
        Instance("loss_in", "gear_loss", (GearLossConfig(
            by_speed=gearbox.loss_in_speed, at_rest=gearbox.loss_in_at_rest, at_470=gearbox.loss_in_at_470, drag=0.0),),
            wires={"body": "w0", "element": "loss_in", "row": 0, "braked": "w0"}),
        Instance("loss_out", "gear_loss", (GearLossConfig(
            by_speed=0.0, at_rest=0.0, at_470=0.0, drag=max(0.0, gearbox.loss_out_constant) * REDUCTION),),
            wires={"body": "wk", "element": "loss_out", "row": 1, "braked": "w0" if driving else "wk"},
            derived={"elsewhere": float(driving)})]
    pulses = effects.pwm_frequency or c.alfa46.values.pwm_frequency
    for k, (name, clutch) in enumerate(zip(VALVES, CLUTCHES)):
        instances.append(Instance(
            name, "proportional_valve", (getattr(c, name),),
            wires={"line": clutch, "supply": "supply", "output": c.wiring[k], "beside": f"p{k + 1}"},
            derived={"ideal_current": float(not effects.current_loop), "pwm": effects.pwm_frequency, "pulses": pulses}))
    for k, (valve, name) in enumerate(zip(VALVES, CLUTCHES)):
        cylinder, start = getattr(c, name), {"temperature": c.oil_supply.temperature}
        derived = plates.derived(c.plate_pack, cylinder, cylinder.clearance, effects.spline_hysteresis)
        wires = {"element": name, "oil": "oil_supply", "line": name}
        if c.prescribed is None:
            instances.append(Instance(name, "wet_clutch", (cylinder, c.plate_pack), derived, {**wires, "valve": valve},
                                      start))
        else:
            instances.append(Instance(name, "curve_clutch", (cylinder, c.plate_pack, c.prescribed.forces[k]), derived,
                                      {**wires, "output": c.wiring[k]}, start,
                                      tables={"pieces": c.prescribed.pieces[c.wiring[k]]}))
    if c.prescribed is not None and c.prescribed.bounded:
        # as an integrator with limits: no slip of S1 against the drive, none of S2 with it
        low, high = (-system.w[system.elements.index(name), 0] / system.w[system.elements.index(name), 1]
                     for name in CLUTCHES)
        instances.append(Instance("output_speed", "speed_bounds", derived={"lowest": low, "highest": high},
                                  wires={"held": 1, "by": 0}))
    outside = gearbox.inertia_in - gearbox.inertia_in_gearbox
    meter_in = Meter("M_wej", push={"w0": 1.0}, rate={"w0": -outside})
    if stiff:  # (6.82): what the gearbox takes, as no torque of the drive is known
        taken = {name: float(system.w[system.elements.index(name), 0]) for name in (*CLUTCHES, "loss_in")}
        meter_in = Meter("M_wej", friction=taken, rate={"w0": gearbox.inertia_in_gearbox})
    meters = meter_in, Meter("M_wyj", friction={"load_pump": 1.0}, rate={"wk": gearbox.inertia_pump})
    return Plan(system, ("w0", "wk"), ("supply", *CLUTCHES), tuple(instances), meters, torque_losses(gearbox, system),
                CHANNELS, ("n_wej", "n_wyj"), law.OUTPUTS, {name: f"I_{name[6:]}" for name in VALVES},
                untouched=len(VALVES)), true
