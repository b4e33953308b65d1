# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Causal cuts: a device outside the plant, the values exchanged at the cut, and the rig's own model of the device.

Used by runs.cuts (the plant's end), by `simulate` and by the stand-alone device nodes, which step the physics that the
engine would have stepped. The values at a cut are held for a tick: the port's values go to the device, its answer comes back.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...base import RigError, fill, njit, record_dtype, unknown
from ..parts import dc_motor as motor_model
from ..parts import load_pump as load_model
from ..parts import part as parts
from ..parts import proportional_valve as valve_model
from ..parts.oil_supply import viscosity_at

if TYPE_CHECKING:
    from ...base import Record
    from .cut_rig import CutRig, Device, Devices

MOTOR, LOAD, VALVE = "dc_motor", "load_pump", "proportional_valve"  # parts that can stand outside
LOOP = 0.35  # limit of the speed loop's crossover times the tick: 0.3 changes a shift's loss by 0.2 %, 0.45 by 6 %, 0.75 oscillates
# roles of devices that cannot stand outside, and why
NOT_CUT = {
    parts.CLUTCH: "clutches that lock are solved together with the shafts in every step, and a friction torque that is a tick "
    "old would chatter at standstill",
    parts.COUPLING: "its torque follows its twist within every step, and one that is a tick old would swing by itself",
    parts.FREEWHEEL: "it holds and lets go within a step, together with all that it holds",
    parts.OIL: "all valves draw on its stiff pressure in every step, so it is no single device's port",
    parts.LOSS: "it brakes a shaft by a torque of the same instant, and one that is a tick old cannot",
    parts.PRESS: "it clamps plates that lock and break away within a step",
    parts.SOURCE: "it is joined to the oil of the rig within every step",
    parts.METER: "it measures and carries no power; its wire is a topic anyway",
    parts.VALUES: "it is no device, but values that others share",
}
NO_PORT = "parts of its type have no port to a node of your own"
# what is in a rig but is not a device of its description, and why it cannot stand outside
NOT_DEVICES = {
    "gearbox": "its shafts carry the clutches that lock and break away within a step, and a torque that is a "
    "tick old cannot hold them",
    "instruments": "they measure the plant and carry no power; their wires are topics anyway",
    "alfa46": "it carries no power and its wires are topics anyway; give --controller",
}


class Port(NamedTuple):
    """The plant's side at one sample, SI: everything that the device needs; a value that a device does not have is 0."""

    tick: float  # time for which each side holds the values of the other one [s]
    speed: float = 0.0  # of its body
    pressure: float = 0.0  # valve: of the port, gauge
    supply: float = 0.0  # valve: of its supply, gauge
    current: float = 0.0  # valve: in the coil's wires
    setpoint: float = 0.0  # motor: speed; valve: duty 0 to 1; load pump: relief setting
    enable: bool = False
    safe: bool = False


class Answer(NamedTuple):
    """The device's side, SI; it acts from the next tick on; a value that a device does not have is 0."""

    torque: float = 0.0  # motor: on the shaft; load pump: torque that it can hold, >= 0
    flow: float = 0.0  # valve: into the clutch's line while its port has ``pressure``
    flow_slope: float = 0.0  # valve: change of flow by port pressure, <= 0
    pressure: float = 0.0  # valve: port pressure to which the flow belongs; load pump: in its pressure line
    position: float = 0.0  # valve: of the spool
    setpoint: float = 0.0  # motor: speed setpoint after its ramp
    work: float = 0.0  # by the device's own integration; motor: delivered; load pump: absorbed; valve: delivered to the port


NOTHING = Answer()


def cuttable(device: Device) -> bool:
    """Return whether a device (rig.structure.Device) can stand outside."""
    return device.part in (MOTOR, LOAD, VALVE)


def why_not(structure: Devices, name: str) -> str | None:
    """Return the sentence on why a device of a rig cannot be cut out.

    Parameters
    ----------
    structure : Devices
        The structure of the rig.
    name : str
        Name of the device.

    Returns
    -------
    str or None
        The sentence, None for a device that can be cut out.

    Raises
    ------
    RigError
        When there is no such device.
    """
    if name in NOT_DEVICES:
        return f"{name} cannot be cut out of the plant: {NOT_DEVICES[name]}"
    known = [device.name for device in structure.devices if cuttable(device)]
    device = next((one for one in structure.devices if one.name == name), None)
    if device is None:
        raise RigError(unknown("device", name, known))
    return None if cuttable(device) else f"{name} cannot be cut out of the plant: {NOT_CUT.get(device.role, NO_PORT)}"


def check_device(structure: Devices, name: str) -> None:
    """Raise a RigError unless this is a device of the rig that can be cut out."""
    if why := why_not(structure, name):
        raise RigError(why)


MOTOR_SIDE = np.dtype([("torque", "f8"), ("integral", "f8"), ("setpoint", "f8"), ("mean", "f8"), ("work", "f8")])
LOAD_SIDE = np.dtype([("pressure", "f8"), ("mean", "f8"), ("work", "f8")])
VALVE_SIDE = np.dtype([("magnet", "f8"), ("spool", "f8"), ("share", "f8"), ("mean", "f8"), ("slope", "f8"), ("work", "f8")])


@njit(cache=True)
def motor_tick(side: Record, speed: float, target: float, drive: bool, steps: int, h: float, motor: Record) -> None:
    """Move a motor over ``steps`` of h [s] on a shaft of held speed [rad/s], and set its mean torque."""
    side.mean = 0.0
    for _ in range(steps):
        side.setpoint = motor_model.next_setpoint(side.setpoint, target, speed, drive, h, motor)
        before = side.torque if drive else 0.0
        side.torque, side.integral = motor_model.drive_torque(side.torque, side.integral, side.setpoint, speed, drive, h, motor)
        side.mean += 0.5 * (before + side.torque) / steps
    side.work += side.mean * speed * steps * h


@njit(cache=True)
def load_tick(side: Record, speed: float, setting: float, enabled: bool, steps: int, h: float, load: Record) -> None:
    """Move a load pump over ``steps`` of h [s] on a shaft of held speed [rad/s], and set its mean capacity."""
    side.mean = 0.0
    for _ in range(steps):
        side.pressure = load_model.line_pressure(side.pressure, setting, enabled, speed, h, load)
        side.mean += load_model.torque_capacity(side.pressure, load) / steps
    side.work += side.mean * abs(speed) * steps * h


class ValvePort(NamedTuple):
    """What a valve meets over a tick: current at both ends [A], pressures of port and supply [Pa], friction of the spool [Pa]."""

    old_current: float
    new_current: float
    pressure: float
    supply: float
    friction: float


@njit(cache=True)
def valve_tick(side: Record, port: ValvePort, oil: tuple[float, float, float], steps: int, h: float, valve: Record) -> None:
    """Move a valve over ``steps`` of h [s] at a held port pressure while its current changes evenly.

    It sets the mean flow and the mean slope of the orifice's flow by port pressure. ``oil`` has the values of orifice_speed,
    laminar_force and the oil's viscosity over that at its reference temperature.
    """
    side.mean = side.slope = 0.0
    for i in range(steps):
        current = port.old_current + (port.new_current - port.old_current) * (i + 1) / steps
        side.magnet = valve_model.magnet_pressure(side.magnet, current, valve)
        side.spool = valve_model.spool_position(side.spool, side.magnet, port.pressure, h, oil[2], port.friction, valve)
        side.share = valve_model.opening(side.spool, valve)
        flow, slope = valve_model.port_flow(side.share, port.pressure, port.supply, oil[0], oil[1], valve)
        side.mean += flow / steps
        side.slope += slope / steps
    side.work += port.pressure * side.mean * steps * h


def _record(*instances: object) -> np.void:
    out = np.zeros(1, record_dtype(*map(type, instances)))
    fill(out, *instances)
    return out[0]


def _oil_of(config: CutRig, valve: Device) -> tuple[float, float, float]:
    """Return what a valve needs of its oil, at the temperature at which the rig starts; see :func:`valve_tick`."""
    oil = getattr(config, config.structure.oil_of(valve, "supply"))
    # not compiled: numba would take the record of the configuration for a part of the plant's and warn
    viscosity = float(viscosity_at.py_func(oil.temperature, oil)[0])
    return (
        float(valve_model.orifice_speed(oil.density)),
        float(valve_model.laminar_force(viscosity, oil.density)),
        viscosity / oil.viscosity,
    )


class OtherSide:
    """The device of a cut, with the rig's own physics.

    The state of the device advances over each tick with the mean of the port's values at its two ends. Its answer is a prediction
    with the newest port values held: the mean over the tick in which the answer will act, which begins one tick after those values.
    So the only remaining error of the delay is the change of the port's values meanwhile; the slope of a valve compensates much of
    that.

    Parameters
    ----------
    device : str
        Name of a device that can be cut out.
    config : CutRig
        Configuration of the rig, with the values of the device.

    Raises
    ------
    RigError
        For a motor whose speed loop is too fast for the tick of the cut.
    """

    def __init__(self, device: str, config: CutRig) -> None:
        """Make the device of this name; raise RigError for a motor whose speed loop is too fast for the cut's tick."""
        entry = config.structure.device(device)
        self.device, values = entry.part, getattr(config, device)
        # crossover frequency of the speed loop [1/s]
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
            self._oil = _oil_of(config, entry)
            self._pulses = config.effects.pwm_frequency or config.alfa46.values.pwm_frequency
        kind = {MOTOR: MOTOR_SIDE, LOAD: LOAD_SIDE, VALVE: VALVE_SIDE}[entry.part]
        self._side, self._ahead = np.zeros(1, kind)[0], np.zeros(1, kind)
        self._last: Port | None = None

    def snapshot(self) -> tuple:
        """Return the present state, for :meth:`restore`."""
        return self._side.copy(), self._last

    def restore(self, snapshot: tuple) -> None:
        """Return to a state that :meth:`snapshot` gave."""
        side, self._last = snapshot
        for name in self._side.dtype.names:
            self._side[name] = side[name]

    def step(self, port: Port, ticks: int = 1) -> Answer:
        """Return the answer to a port.

        Parameters
        ----------
        port : Port
            The plant's side.
        ticks : int
            Number of ticks since the last port.

        Returns
        -------
        Answer
            The device's side.
        """
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
        if self.device == MOTOR:  # held like the speed; if the setpoint rose alone, the torque would be too large
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
        """Return the coil current of a valve one tick later with its duty held; 0 for other devices."""
        if self.device != VALVE:
            return 0.0
        duty = 0.0 if port.safe else port.setpoint
        return float(valve_model.coil_current(port.current, duty, port.tick, self._values))

    def _move(self, side: np.void, port: Port, current: float) -> None:
        """Move a state over a tick with the port held, except for the coil current, which goes to ``current``."""
        steps = round(port.tick / self._h)
        if self.device == MOTOR:
            drive = port.enable and not port.safe
            motor_tick(side, port.speed, port.setpoint, drive, steps, self._h, self._values)
        elif self.device == LOAD:
            load_tick(side, port.speed, port.setpoint, port.enable and not port.safe, steps, self._h, self._values)
        else:
            meets = ValvePort(port.current, current, port.pressure, port.supply, self._friction(port))
            valve_tick(side, meets, self._oil, steps, self._h, self._values)

    def _friction(self, port: Port) -> float:
        """Return the friction [Pa] of a valve's spool that remains under the pulses of its coil."""
        return float(valve_model.friction_left(0.0 if port.safe else port.setpoint, self._pulses, self._values))

    def _slope(self, side: np.void, port: Port) -> float:
        """Return the change of a valve's answer by port pressure: the steeper of the orifice's slope and the slope to zero flow.

        The second slope leads to zero flow at the port pressure which, if held from the sample on, would close the valve in the
        middle of the tick in which the answer acts. In a stiff line the pressure reaches that value within the tick; with the slope
        of the orifice alone it would oscillate.
        """
        closed = valve_model.closing_pressure(
            float(self._side["spool"]),
            side["mean"] > 0.0,
            float(side["magnet"]),
            1.5 * port.tick,
            self._oil[2],
            self._friction(port),
            self._values,
        )
        slope = float(side["slope"])
        if side["mean"] != 0.0 and closed != port.pressure:
            slope = min(slope, -abs(float(side["mean"]) / (closed - port.pressure)))
        return min(0.0, slope)


def drained(pressure: float, config: CutRig, device: str) -> Answer:
    """Return the answer of a valve without current whose spool has come to rest, which replaces the answer of a silent valve.

    Parameters
    ----------
    pressure : float
        Port pressure [Pa, gauge].
    config : CutRig
        Configuration of the rig.
    device : str
        Name of the valve.

    Returns
    -------
    Answer
        Flow to the tank and its slope.
    """
    values = _record(getattr(config, device))
    speed, laminar, _ = _oil_of(config, config.structure.device(device))
    flow, slope = valve_model.port_flow(-1.0, pressure, 0.0, speed, laminar, values)
    return Answer(flow=flow, flow_slope=slope, pressure=pressure)
