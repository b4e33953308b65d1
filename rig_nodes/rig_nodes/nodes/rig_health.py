# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The health of the devices of the rig container, for /diagnostics.

The rig container uses it. It reads the rig while the rig's loop goes on, which needs no lock for single numbers.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from ..bags import installed
from ..base import COMMAND_TIMEOUT
from ..plant import part as parts
from ..rig import Device
from ..runs import Present, Rig, RigStatus
from .device import device_names
from .diagnostics import ERROR, OK, STALE, WARN, Growing, Health

if TYPE_CHECKING:
    from .commands import Commands
    from .lockstep import Lockstep
    from .realtime import RealTime

OLD = 0.5 * COMMAND_TIMEOUT  # s; an older valve command is a warning
TOO_LOW = 0.9  # share of the relief setting below which the oil supply is a warning
NEWEST = 200  # ticks whose lateness is reported, which are one second
MODES = ("open", "slipping", "locked")
LOCKED = MODES.index("locked")


class RigHealth:
    """Called, it returns the health of the rig, of each of its devices by its role, and of its instruments."""

    def __init__(self, rig: Rig, clock: RealTime | Lockstep, commands: Commands, other_clocks: list[str]) -> None:
        """Choose the devices.

        ``clock`` is the RealTime or Lockstep of the run, ``commands`` the rig's queue, and ``other_clocks`` a list that grows with
        the names of other nodes that have sent /clock.
        """
        self.rig, self.clock, self.commands, self.other_clocks = rig, clock, commands, other_clocks
        self._present, self._overruns = Present(rig), Growing()
        structure, of_role = (
            rig.config.structure,
            {
                parts.SOURCE: self.source,
                parts.LOAD: self.switched,
                parts.CLUTCH: self.clutch,
                parts.VALVE: self.valve,
                parts.OIL: self.oil,
                parts.PRESS: self.press,
            },
        )
        there, devices = set(device_names(rig.config)), [one for one in structure.devices if one.role in of_role]
        self._each = [partial(of_role[one.role], one) for one in devices if one.name in there]
        self._fields = {
            one.name: [name for name, _ in installed(rig.config.catalogue.topics[f"/{one.name}/state"].ros_type).tree.fields[2:]]
            for one in devices
            if parts.part(one.part).message
        }
        if structure.gears:
            self._each.append(self.gearbox)

    def __call__(self) -> list[Health]:
        """Return the present health of all of them."""
        self._present.read()
        return [self.whole(), *(health() for health in self._each), self.instruments()]

    def state(self, device: Device) -> dict:
        """Return the fields of the device's state message [SI]; nothing where it has none."""
        if device.name not in self._fields:
            return {}
        return dict(zip(self._fields[device.name], parts.part(device.part).shown_values(self._present, device.name), strict=True))

    def whole(self) -> Health:
        """Return the health of the rig: its state with the reason, and whether it keeps time."""
        status, late = self.rig.status, self._overruns(self.clock.overruns)
        if status == RigStatus.TRIPPED:
            return Health("rig", ERROR, f"tripped: {self.rig.reason}; /rig/reset leaves the safe state", self._clock)
        if status == RigStatus.STARTING:
            what = (
                "no valve command has come yet"
                if self.rig.newest_command < 0
                else "after the reset the shift controller has not been in neutral yet"
            )
            return Health("rig", WARN, f"starting: {what}", self._clock)
        text = "running: the motor is on" if status == RigStatus.RUNNING else "ready: the motor is off"
        if not self.rig.config.trips_watched:
            return Health("rig", WARN, f"{text}, but its trips are off: nothing keeps it within its limits", self._clock)
        if near := [trip.quantity.text for trip in self.rig.watched.near()]:
            return Health("rig", WARN, f"{text}, but near the limit: {', '.join(near)}", self._clock)
        if self.other_clocks:
            return Health("rig", WARN, f"{text}, but /clock was sent by {', '.join(self.other_clocks)} too", self._clock)
        if late:
            return Health("rig", WARN, f"{text}, but ticks start more than 5 ms late: the machine is too busy", self._clock)
        return Health("rig", OK, text, self._clock)

    def _clock(self) -> dict:
        values = {
            "state": self.rig.status.name,
            "reason": self.rig.reason,
            "trip": self.rig.tripped_by,
            "time_s": self.rig.time,
            "overruns": self.clock.overruns,
            "refused_commands": sum(tuple(self.commands.refused.values())),
            "other_clocks": ", ".join(self.other_clocks),
        }
        late = sorted(getattr(self.clock, "lateness_ns", [])[-NEWEST:])  # none in lockstep
        if late:
            values |= {"lateness_ms_p50": late[len(late) // 2] * 1e-6, "lateness_ms_max": late[-1] * 1e-6}
        return values

    def instruments(self) -> Health:
        """Return the health of the instruments: whether the transducers have their noise."""
        gauges = self.rig.gauges
        says = "measures" if gauges.on else "measures without noise" if gauges.present else "shows true values"
        return Health("instruments", OK, says)

    def is_on(self, device: Device) -> bool:
        """Return whether a device is switched on."""
        return bool(self.rig.device(device.name)[parts.part(device.part).takes[0].enabled] > 0.0)

    def source(self, device: Device) -> Health:
        """Return the health of what drives the rig: on, off, or held without torque."""
        if self.rig.status == RigStatus.TRIPPED:
            return Health(device.name, WARN, "without torque: the rig is in its safe state", partial(self.state, device))
        return self.switched(device)

    def switched(self, device: Device) -> Health:
        """Return the health of a device that is on or off."""
        return Health(device.name, OK, "on" if self.is_on(device) else "off", partial(self.state, device))

    def gearbox(self) -> Health:
        """Return the health of the gearbox: which gear is engaged."""
        rig, structure = self.rig, self.rig.config.structure
        locked = [name for name in rig.clutch_names if rig.clutch_mode(name) == LOCKED]
        number = rig.locked_gear()
        text = (
            "no gear is engaged"
            if not number
            else f"gear {structure.gears[number - 1].name} is engaged"
            if number <= len(structure.gears)
            else f"{' and '.join(structure.device(name).called for name in locked)} locked, which is no gear"
        )
        return Health(
            "gearbox",
            OK,
            text,
            lambda: {f"{end.speed}": rig.true(f"{end.body}.speed") for end in (structure.input, structure.output)},
        )

    def clutch(self, device: Device) -> Health:
        """Return the health of a clutch: open, slipping or locked."""
        return Health(device.name, OK, MODES[self.rig.clutch_mode(device.name)], partial(self.state, device))

    def valve(self, device: Device) -> Health:
        """Return the health of a valve: whether a controller drives it."""
        rig = self.rig
        age = rig.command_age
        tell = partial(Health, device.name, values=lambda: {"command_age_ms": age * 1e3, **self.state(device)})
        if rig.newest_command < 0:
            return tell(STALE, "no valve command has come yet")
        if age > COMMAND_TIMEOUT:
            return tell(STALE, f"no valve command for more than {COMMAND_TIMEOUT * 1e3:.0f} ms: the coil has no current")
        if rig.status == RigStatus.TRIPPED:
            return tell(WARN, "the coil has no current: the rig is in its safe state")
        if rig.status == RigStatus.STARTING:
            return tell(WARN, "the coil has no current: the shift controller has not been in neutral yet")
        if age > OLD:
            return tell(
                WARN, f"the valve command is more than {OLD * 1e3:.0f} ms old; at {COMMAND_TIMEOUT * 1e3:.0f} ms the rig trips"
            )
        return tell(OK, "follows the shift controller")

    def oil(self, device: Device) -> Health:
        """Return the health of an oil supply: whether it has the pressure that is set."""
        oil = self.rig.device(device.name)
        tell = partial(Health, device.name, values=partial(self.state, device))
        if oil["enabled"] <= 0.0:
            return tell(OK, "off")
        if float(oil["pressure"]) < TOO_LOW * float(oil["setting"]):
            return tell(WARN, "on, but the pressure is more than 10 % below its setting")
        return tell(OK, "on, at its pressure")

    def press(self, device: Device) -> Health:
        """Return the health of a press: whether it clamps."""
        text = "presses" if self.rig.device(device.name)["force"] > 0.0 else "is back"
        return Health(device.name, OK, text, partial(self.state, device))
