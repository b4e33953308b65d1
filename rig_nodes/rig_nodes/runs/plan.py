# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The engine's plan of a rig from its configuration: driveline, devices with their wires, torque meters.

runs.rig uses it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base import RigError
from ..driveline import System, losses
from ..plant import Instance, Meter, Plan, derived_of_pack
from ..plant import part as parts
from ..rig import CLUTCHES, Device, RigConfig, bodies_shown, build_driveline, inertias_of, inputs_of, leave_out, shaft_of

UNMOVED = 1e6  # kg m2 on an input whose speed is to stay constant; no published torque or energy contains it
HELD = "output_speed"  # name of what bounds the output's speed, where pressures are prescribed


@dataclass(frozen=True)
class Planned:
    """The plan of a rig; ``true`` is its driveline as it really is, where that of the plan has a heavy input."""

    plan: Plan
    true: System


def plan_of(config: RigConfig) -> Planned:
    """Return the plan of a rig, and its true driveline."""
    return _Planner(config).planned()


class _Planner:
    """Makes the plan of one rig."""

    def __init__(self, config: RigConfig) -> None:
        self.config, self.structure, self.effects = config, config.structure, config.effects
        self.values = leave_out(config)
        inertias = inertias_of(self.structure, self.values)
        self.true = self.system = build_driveline(self.structure, inertias, self.values)
        self.tied = build_driveline(self.structure, inertias, self.values, lossless=True) if self.true.meshes else self.true
        self.stiff = not self.effects.motor_speed and self.structure.input is not None
        if self.stiff:
            heavy = {**inertias, self.structure.of_role(parts.SOURCE)[0].wires["body"]: UNMOVED}
            self.system = build_driveline(self.structure, heavy, self.values)
        self.losses = self.structure.of_role(parts.LOSS)
        self.bodies = bodies_shown(self.structure)
        self.meters = {one.name: self._meter(one) for one in self.structure.of_role(parts.METER)}
        self.lines = tuple(self.structure.line_of(one.name) for one in self.structure.of_role(parts.OIL)) + tuple(
            one.name for one in self.structure.clutches if "line" in parts.part(self._part(one)).wires
        )

    def _part(self, device: Device) -> str:
        """The name of a device's part; a clutch whose pressure is prescribed is a curve_clutch."""
        if device.role == parts.CLUTCH and self.config.prescribed is not None:
            return "curve_clutch"
        return device.part

    def _wired(self, device: Device) -> tuple[str, ...]:
        return parts.part(self._part(device)).wires

    def turns(self, body: str, system: System | None = None) -> np.ndarray:
        """Return the speed of a body by the driveline's speeds (speeds,)."""
        system = system or self.system
        return system.bodies_from_speeds[system.bodies.index(body)]

    def reduced(self, body: str) -> float:
        """Return all inertia that is felt at a body while every clutch is open [kg m2]."""
        turns = self.turns(body, self.tied)
        return float(1.0 / (turns @ self.tied.minv @ turns))

    def mobility(self, body: str) -> float:
        """Return the acceleration of a body by a torque on it [1/(kg m2)], as the plan's driveline has it while nothing holds."""
        turns = self.turns(body)
        return float(turns @ self.system.minv @ turns)

    def ratio(self, body: str, of: str) -> float:
        """Return the speed of a body divided by that of another one; 0 where gears do not tie them together."""
        own, other = self.turns(body), self.turns(of)
        j = np.abs(other).argmax()
        return float(own[j] / other[j]) if np.allclose(own * other[j], other * own[j]) else 0.0

    def column(self, body: str) -> int:
        """Return the index of the driveline's speed that is this body's own."""
        return int(np.abs(self.turns(body)).argmax())

    def _meter(self, device: Device) -> Meter:
        """A torque meter: what its source gives or its load takes, minus what the inertia between them takes."""
        values, body = self.values[device.name], device.wires["body"]
        if "load" in device.wires:
            beyond = values.inertia if values.side == "beyond" else self.reduced(body) - values.inertia
            load = self.structure.device(device.wires["load"])
            on = load.wires["body"]
            ratio = self.ratio(on, body)
            pushed = {on: -ratio} if parts.part(load.part).account else {}
            return Meter(device.name, friction={load.name: ratio}, push=pushed, rate={body: beyond})
        if self.structure.device(device.wires["source"]).role == parts.COUPLING:
            return self._behind_coupling(device, self.structure.device(device.wires["source"]))
        whole = self.own_inertia(body)
        beyond = values.inertia if values.side == "beyond" else whole - values.inertia
        if self.stiff:  # (6.82): what the gears take, as no torque of the drive is known
            j = self.column(body)
            taken = {name: float(self.system.w[f, j]) for f, name in enumerate(self.system.elements) if self.system.w[f, j]}
            return Meter(device.name, friction=taken, rate={body: whole - beyond})
        return Meter(device.name, push={body: 1.0}, rate={body: -beyond})

    def _behind_coupling(self, device: Device, coupling: Device) -> Meter:
        """A torque meter behind a coupling: what that one gives to its body, minus what the inertia between them takes."""
        values, body = self.values[device.name], device.wires["body"]
        way = 1.0 if body == coupling.wires["joins"][1] else -1.0
        beyond = values.inertia if values.side == "beyond" else self.own_inertia(body) - values.inertia
        return Meter(device.name, friction={coupling.name: way}, rate={body: -beyond}, shaft={shaft_of(coupling): way})

    def own_inertia(self, body: str) -> float:
        """Return the inertia of a body by its values, or for a massless one all that is felt at it [kg m2]."""
        whole = getattr(self.values[body], "inertia", None) if body not in self.structure.massless else None
        return self.reduced(body) if whole is None else whole

    def _loss_rows(self) -> np.ndarray:
        """The losses by torque for the driveline's step (n, loss_width), Annex D; the step itself sets BASE and FACTOR."""
        system, place = self.system, self.system.elements.index
        m = len(system.elements)
        out = np.zeros((len(self.losses), losses.loss_width(*system.w.T.shape)))
        for k, device in enumerate(self.losses):
            values, weights = self.values[device.name], out[k, losses.WEIGHTS :]
            factor = self.axis(device)
            out[k, : losses.OWN] = values.constant * factor, values.share * factor, values.square * factor
            on = self.elsewhere(device) or device.name
            out[k, [losses.OWN, losses.ON, losses.FACTOR, losses.WAY]] = (
                place(device.name),
                place(on),
                1.0,
                self.column(device.wires["body"]),
            )
            if "torque" not in device.wires:
                out[k, : losses.OWN] = 0.0
                continue
            if device.wires["torque"] == CLUTCHES:
                body = device.wires["body"]
                # a clutch brakes what drives it and drives what is behind it; both are counted as the torque that it passes on
                behind = self.structure.output is not None and self.ratio(body, self.structure.output.body) != 0.0
                j = self.column(body)
                counted = (-1.0 if behind else 1.0) * float(self.turns(body)[j])
                for clutch in (*self.structure.clutches, *self.structure.freewheels):
                    weights[place(clutch.name)] = system.w[place(clutch.name), j] / counted
                continue
            meter = self.meters[device.wires["torque"]]
            if "load" in self.structure.device(meter.name).wires and meter.push:
                raise RigError(
                    f"'{self.config.name}': parts.{device.name}.torque names {meter.name}, whose load pushes; a loss "
                    f"by torque can follow friction torques only, so name '{CLUTCHES}'"
                )
            for name, weight in meter.friction.items():
                weights[place(name)] = weight
            for body, weight in meter.rate.items():
                weights[m:] += weight * self.turns(body)
        return out

    def axis(self, device: Device) -> float:
        """Return the speed of the axis on which a loss is stated, divided by that of the body that it brakes."""
        if "axis" not in device.wires:
            return 1.0
        own, other = self.turns(device.wires["body"]), self.turns(device.wires["axis"])
        return float(abs(other[np.abs(own).argmax()] / own[np.abs(own).argmax()]))

    def elsewhere(self, device: Device) -> str | None:
        """Return the loss on whose shaft this one's part by torque brakes, when that is another loss; else None."""
        return device.wires.get("driving") if self.values[device.name].torque_side == "driving" else None

    # ---- devices

    def planned(self) -> Planned:
        """Return the whole plan, and the driveline as it really is."""
        instances, structure = [], self.structure
        roles = (
            parts.OIL,
            parts.CLUTCH,
            parts.PRESS,
            parts.VALVE,
            parts.SOURCE,
            parts.COUPLING,
            parts.MASS,
            parts.LEVER,
            parts.LOAD,
            parts.LOSS,
        )
        for role in roles:
            instances += map(self._instance, structure.of_role(role))
        if self.config.prescribed is not None and self.config.prescribed.bounded:
            instances.append(self._bounds())
        shown = {one.name: one.shows for one in structure.transducers}
        currents = {
            valve.name: next(one.name for one in structure.transducers if one.shows == f"{valve.name}.current")
            for valve in structure.valves
        }
        channels = shown | {f"U_{valve.key}": f"{valve.name}.on" for valve in structure.valves}
        encoders = tuple(one.name for one in structure.transducers if one.type == "speed")
        return Planned(
            Plan(
                self.system,
                self.bodies,
                self.lines,
                tuple(instances),
                tuple(self.meters.values()),
                self._loss_rows(),
                channels,
                encoders,
                structure.outputs,
                currents,
                untouched=len(structure.valves),
                inputs=inputs_of(structure),
            ),
            self.true,
        )

    def _instance(self, device: Device) -> Instance:
        name, part, values = device.name, self._part(device), self.values[device.name]
        configs, derived, start, tables = (values,), {}, {}, {}
        oil = self.structure.of_role(parts.OIL)
        temperature = getattr(self.config, self.structure.oil_of(device)).temperature if oil else 0.0
        if device.role == parts.OIL:
            start = {"oil_temperature": values.temperature}
        elif part == "dc_motor":
            derived = {
                "stiff": float(self.stiff),
                "inertia": self.reduced(device.wires["body"]),
                "mobility": self.mobility(device.wires["body"]),
            }
        elif device.role == parts.LEVER:
            start = {"position": values.rest}
        elif device.role == parts.MASS:
            derived = {"mobility": self.mobility(device.wires["body"])}
        elif device.role == parts.LOSS:
            derived = {"elsewhere": float(bool(self.elsewhere(device))), "steady": values.drag * self.axis(device)}
        elif device.role == parts.VALVE:
            pulses = self.effects.pwm_frequency or self.config.alfa46.values.pwm_frequency
            derived = {"ideal_current": float(not self.effects.current_loop), "pwm": self.effects.pwm_frequency, "pulses": pulses}
        elif "plates" in device.wires:
            pack = self.values[device.wires["plates"]]
            clearance = values.clearance if hasattr(values, "clearance") else self.values[device.wires["press"]].contact_travel
            derived = derived_of_pack(pack, values, clearance, self.effects.spline_hysteresis)
            if part == "pressed_clutch":
                derived["clearance"] = clearance
            start, configs = {"temperature": temperature}, (values, pack)
            if part == "wet_clutch":
                start["empty"] = values.drained_volume
            if part == "curve_clutch":
                k = self.structure.clutches.index(device)
                configs, tables = (*configs, self.config.prescribed.forces[k]), {"pieces": self.config.prescribed.pieces[k]}
        return Instance(name, part, configs, derived, self._wires(device, part), start, tables)

    def _wires(self, device: Device, part: str) -> dict[str, str | int]:
        """What each wire of the part's record leads to; every wire has the same meaning for all parts."""
        structure, wires = self.structure, device.wires
        valve = structure.valve_of(device.name)
        oil = structure.oil_of(device, "supply" if device.role == parts.VALVE else "oil") if structure.of_role(parts.OIL) else ""
        driven = valve or (device if device.role == parts.VALVE else None)
        known = {
            "element": lambda: device.name,
            "shaft": lambda: shaft_of(device),
            "body": lambda: wires["body"],
            "oil": lambda: oil,
            "press": lambda: wires["press"],
            "line": lambda: structure.line_of(wires.get("feeds", device.name)),
            "supply": lambda: structure.line_of(oil) if oil else parts.NOWHERE,
            "valve": lambda: valve.name,
            "output": lambda: self.config.wiring[structure.valves.index(driven)],
            "beside": lambda: wires.get("beside", parts.NOWHERE),
            "turns_with": lambda: wires.get("turns_with", parts.NOWHERE),
            "driving": lambda: wires["driving"],
            "driven": lambda: wires["driven"],
            "given": lambda: list(self.system.factors).index(wires["moves"]),
            "row": lambda: self.losses.index(device),
            "braked": lambda: structure.device(self.elsewhere(device)).wires["body"] if self.elsewhere(device) else wires["body"],
        }
        # a wire with a name of the part's own leads to the device that the rig's file names under this key
        return {wire: known[wire]() if wire in known else wires[wire] for wire in parts.part(part).wires}

    def _bounds(self) -> Instance:
        """The bounds of the output's speed, as of an integrator with limits: there one clutch or the other has no slip."""
        structure, system = self.structure, self.system
        held, by = self.column(structure.output.body), self.column(structure.input.body)
        rows = [system.w[system.elements.index(clutch.name)] for clutch in structure.clutches]
        low, high = sorted(-row[by] / row[held] for row in rows)[:: len(rows) - 1]
        return Instance(HELD, "speed_bounds", derived={"lowest": low, "highest": high}, wires={"held": held, "by": by})
