# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Causal cuts: a device outside the plant, what goes over the cut and back, and the rig's own other side.

Used by testbench.cuts (the plant's end), by `simulate` and by the stand-alone device nodes, which step the
physics that the engine would have stepped. A cut is held for a tick: the port in, the answer out.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numba import njit

from ..config.names import unknown
from ..config.schema import fill, record_dtype
from ..errors import RigError
from ..parts import dc_motor as motor_model
from ..parts import load_pump as load_model
from ..parts import part as parts
from ..parts import proportional_valve as valve_model

if TYPE_CHECKING:
    from ..arrays import Record
    from .cut_rig import CutRig, Device, Devices

MOTOR, LOAD, VALVE = "dc_motor", "load_pump", "proportional_valve"  # parts that can stand outside
LOOP = 0.35  # crossover of the motor's speed loop times the tick: 0.3 costs 0.2 % of a shift's loss, 0.45 6 %, 0.75 swings
# roles of devices that are no such pair, and why
NOT_CUT = {
    parts.CLUTCH: "clutches that lock are solved together with the shafts in every step, and a friction torque that is a tick "
    "old would chatter at standstill",
    parts.FREEWHEEL: "it holds and lets go within a step, together with all that it holds",
    parts.OIL: "all valves draw on its stiff pressure in every step, so it is no single device's port",
    parts.LOSS: "it brakes a shaft by a torque of the same instant, and one that is a tick old cannot",
    parts.PRESS: "it clamps plates that lock and break away within a step",
    parts.SOURCE: "it is joined to the oil of the rig within every step",
    parts.METER: "it measures and carries no power; its wire is a topic anyway",
    parts.VALUES: "it is no device, but values that others share",
}
# what is in a rig and no device of its description, and why it is no such pair
NOT_DEVICES = {
    "gearbox": "its shafts carry the clutches that lock and break away within a step, and a torque that is a "
    "tick old cannot hold them",
    "instruments": "they measure the plant and carry no power; their wires are topics anyway",
    "alfa46": "it carries no power and its wires are topics anyway; give --controller",
}


class Port(NamedTuple):
    """The plant's side at one sample, SI: all that the device needs. 0 where a device has no such value."""

    tick: float  # s that each side holds what the other one gave
    speed: float = 0.0  # motor: of w0; load pump: of wk
    pressure: float = 0.0  # valve: of the port, gauge
    supply: float = 0.0  # valve: of its supply, gauge
    current: float = 0.0  # valve: in the coil's wires
    setpoint: float = 0.0  # motor: speed; valve: duty 0 to 1; load pump: relief setting
    enable: bool = False
    safe: bool = False


class Answer(NamedTuple):
    """The device's side, SI; it acts from the next tick on. 0 where a device has no such value."""

    torque: float = 0.0  # motor: on the shaft; load pump: what it can hold, >= 0
    flow: float = 0.0  # valve: into the clutch's line while its port has ``pressure``
    flow_slope: float = 0.0  # valve: change of flow by port pressure, <= 0
    pressure: float = 0.0  # valve: port pressure that flow belongs to; load pump: in its pressure line
    position: float = 0.0  # valve: of the spool
    setpoint: float = 0.0  # motor: speed setpoint after its ramp
    work: float = 0.0  # as the device counts it: motor: given; load pump: taken; valve: given to the port


NOTHING = Answer()


def cuttable(device: Device) -> bool:
    """True of a device (description.structure.Device) that can stand outside."""
    return device.part in (MOTOR, LOAD, VALVE)


def why_not(structure: Devices, name: str) -> str | None:
    """The sentence on a device of a rig that cannot be cut out, None for one that can; RigError when there is none."""
    if name in NOT_DEVICES:
        return f"{name} cannot be cut out of the plant: {NOT_DEVICES[name]}"
    known = [device.name for device in structure.devices if cuttable(device)]
    device = next((one for one in structure.devices if one.name == name), None)
    if device is None:
        raise RigError(unknown("device", name, known))
    return None if cuttable(device) else f"{name} cannot be cut out of the plant: {NOT_CUT[device.role]}"


def check_device(structure: Devices, name: str) -> None:
    """RigError unless this is a device of the rig that can be cut out."""
    if why := why_not(structure, name):
        raise RigError(why)


MOTOR_SIDE = np.dtype([("torque", "f8"), ("integral", "f8"), ("setpoint", "f8"), ("mean", "f8"), ("work", "f8")])
LOAD_SIDE = np.dtype([("pressure", "f8"), ("mean", "f8"), ("work", "f8")])
VALVE_SIDE = np.dtype([("magnet", "f8"), ("spool", "f8"), ("share", "f8"), ("mean", "f8"), ("slope", "f8"), ("work", "f8")])


@njit(cache=True)
def motor_tick(side: Record, speed: float, target: float, drive: bool, steps: int, h: float, motor: Record) -> None:
    """A motor over ``steps`` of h [s] on a shaft of held speed [rad/s]; leaves its mean torque."""
    side.mean = 0.0
    for _ in range(steps):
        side.setpoint = motor_model.next_setpoint(side.setpoint, target, speed, drive, h, motor)
        before = side.torque if drive else 0.0
        side.torque, side.integral = motor_model.drive_torque(side.torque, side.integral, side.setpoint, speed, drive, h, motor)
        side.mean += 0.5 * (before + side.torque) / steps
    side.work += side.mean * speed * steps * h


@njit(cache=True)
def load_tick(side: Record, speed: float, setting: float, enabled: bool, steps: int, h: float, load: Record) -> None:
    """A load pump over ``steps`` of h [s] on a shaft of held speed [rad/s]; leaves its mean capacity."""
    side.mean = 0.0
    for _ in range(steps):
        side.pressure = load_model.line_pressure(side.pressure, setting, enabled, speed, h, load)
        side.mean += load_model.torque_capacity(side.pressure, load) / steps
    side.work += side.mean * abs(speed) * steps * h


@njit(cache=True)
def valve_tick(
    side: Record,
    old_current: float,
    new_current: float,
    pressure: float,
    supply: float,
    speed_by_root: float,
    steps: int,
    h: float,
    valve: Record,
) -> None:
    """A valve over ``steps`` of h [s] at a held port pressure [Pa] while its current changes evenly.

    Leaves its mean flow and the mean slope of its orifice's flow by port pressure.
    """
    side.mean = side.slope = 0.0
    for i in range(steps):
        current = old_current + (new_current - old_current) * (i + 1) / steps
        side.magnet = valve_model.magnet_pressure(side.magnet, current, valve)
        side.spool = valve_model.spool_position(side.spool, side.magnet, pressure, h, valve)
        side.share = valve_model.opening(side.spool, valve)
        flow, slope = valve_model.port_flow(side.share, pressure, supply, speed_by_root, valve)
        side.mean += flow / steps
        side.slope += slope / steps
    side.work += pressure * side.mean * steps * h


def _record(*instances: object) -> np.void:
    out = np.zeros(1, record_dtype(*map(type, instances)))
    fill(out, *instances)
    return out[0]


class OtherSide:
    """The device of a cut, with the rig's own physics. config: of the rig, with the values of the device.

    The device itself moves from port to port, on the mean of the two. Its answer is a forecast with the
    newest port held: the mean of the tick in which it will act, which begins one tick after the port. So what
    is left of the delay is that the port moves on; a valve's slope makes up for much of that.
    """

    def __init__(self, device: str, config: CutRig) -> None:
        """device: name of one that can be cut. RigError for a motor whose speed loop is too quick for the cut's tick."""
        entry = config.structure.device(device)
        self.device, values = entry.part, getattr(config, device)
        # 1/s, crossover of the speed loop
        turns = values.speed_gain / config.felt_at(entry.wires["body"]) if entry.part == MOTOR else 0.0
        if turns * config.cut.tick > LOOP:
            raise RigError(
                f"cut.tick is {config.cut.tick * 1e3:g} ms: the motor's speed loop (speed_gain over inertia, {turns:.0f} "
                f"1/s) swings behind answers that are so late; give at most {1e3 * LOOP / turns:.1f} ms, or the motor a "
                "smaller speed_gain"
            )
        self._h = config.kernel.step
        self._values = _record(values)
        if entry.part == VALVE:
            self._speed_by_root = valve_model.orifice_speed(getattr(config, config.structure.oil_of(entry, "supply")).density)
        kind = {MOTOR: MOTOR_SIDE, LOAD: LOAD_SIDE, VALVE: VALVE_SIDE}[entry.part]
        self._side, self._ahead = np.zeros(1, kind)[0], np.zeros(1, kind)
        self._last: Port | None = None

    def step(self, port: Port, ticks: int = 1) -> Answer:
        """The answer to a port that comes so many ticks after the last one."""
        last, self._last = self._last, port
        if last is not None:
            between = last._replace(
                **{name: 0.5 * (getattr(last, name) + getattr(port, name)) for name in ("speed", "pressure", "supply")}
            )
            for _ in range(ticks):
                self._move(self._side, between, port.current)
        self._ahead[0] = self._side
        ahead = self._ahead[0]
        soon = port._replace(current=self._coil(port))
        later = self._coil(soon)
        if self.device == MOTOR:  # held as the speed is: a setpoint that ramps on alone would ask for too much
            soon = soon._replace(setpoint=float(ahead["setpoint"]))
            port = port._replace(setpoint=float(ahead["setpoint"]))
        self._move(ahead, port, soon.current)
        self._move(ahead, soon, later)
        work = float(self._side["work"])
        if self.device == MOTOR:
            return Answer(torque=float(ahead["mean"]), setpoint=float(ahead["setpoint"]), work=work)
        if self.device == LOAD:
            return Answer(torque=float(ahead["mean"]), pressure=float(ahead["pressure"]), work=work)
        slope = self._slope(ahead, port)
        return Answer(
            flow=float(ahead["mean"]), flow_slope=slope, pressure=port.pressure, position=float(ahead["spool"]), work=work
        )

    def _coil(self, port: Port) -> float:
        """Coil current of a valve a tick later, its duty held; 0 for other devices."""
        if self.device != VALVE:
            return 0.0
        duty = 0.0 if port.safe else port.setpoint
        return float(valve_model.coil_current(port.current, duty, port.tick, self._values))

    def _move(self, side: np.void, port: Port, current: float) -> None:
        """Move a state over a tick with the port held, but for the coil current: it goes to ``current``."""
        steps = round(port.tick / self._h)
        if self.device == MOTOR:
            drive = port.enable and not port.safe
            motor_tick(side, port.speed, port.setpoint, drive, steps, self._h, self._values)
        elif self.device == LOAD:
            load_tick(side, port.speed, port.setpoint, port.enable, steps, self._h, self._values)
        else:
            valve_tick(side, port.current, current, port.pressure, port.supply, self._speed_by_root, steps, self._h, self._values)

    def _slope(self, side: np.void, port: Port) -> float:
        """Change of a valve's answer by port pressure: the steeper of the orifice's and the way to no flow.

        The latter ends at the port pressure that, held from the port on, would have closed the valve in the
        middle of the tick in which the answer acts. In a stiff line the pressure gets there within that tick;
        a slope that knew the orifice alone would let it swing.
        """
        closed = valve_model.closing_pressure(
            float(self._side["spool"]), side["mean"] > 0.0, float(side["magnet"]), 1.5 * port.tick, self._values
        )
        slope = float(side["slope"])
        if side["mean"] != 0.0 and closed != port.pressure:
            slope = min(slope, -abs(float(side["mean"]) / (closed - port.pressure)))
        return min(0.0, slope)


def drained(pressure: float, config: CutRig, device: str) -> Answer:
    """The answer of a valve without current whose spool has come to rest: what stands in for a silent one."""
    values = _record(getattr(config, device))
    oil = getattr(config, config.structure.oil_of(config.structure.device(device), "supply"))
    flow, slope = valve_model.port_flow(-1.0, pressure, 0.0, valve_model.orifice_speed(oil.density), values)
    return Answer(flow=flow, flow_slope=slope, pressure=pressure)
