# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The health of the devices of the rig container, for /diagnostics.

Used by the rig container; reads the rig while its loop goes on, which for single numbers needs no lock.
"""

from __future__ import annotations

from functools import partial

from ..clocks import COMMAND_TIMEOUT
from ..testbench.rig import Rig
from ..testbench.timed import RigStatus
from ..transmission import transmission_of
from .diagnostics import ERROR, OK, STALE, WARN, Growing, Health

OLD = 0.5 * COMMAND_TIMEOUT  # s of a valve command that is a warning
TOO_LOW = 0.9  # share of the relief setting below which the oil supply is a warning
NEWEST = 200  # ticks of which the lateness is told, one second
MODES = ("open", "slipping", "locked")
LOCKED = MODES.index("locked")


class ContainerHealth:
    """What the rigs of all kinds have: their state, and whether time is kept."""

    def __init__(self, rig, clock, commands):
        """clock: RealTime or Lockstep; commands: the rig's queue."""
        self.rig, self.clock, self.commands = rig, clock, commands
        self._overruns = Growing()

    def whole(self) -> Health:
        """State with its reason, and whether time is kept."""
        status, late = self.rig.status, self._overruns(self.clock.overruns)
        if status == RigStatus.TRIPPED:
            return Health("rig", ERROR, f"tripped: {self.rig.reason}; /rig/reset leaves the safe state", self._clock)
        if status == RigStatus.STARTING:
            what = ("no valve command has come yet" if self.rig.newest_command < 0
                    else "after the reset the shift controller has not been in neutral yet")
            return Health("rig", WARN, f"starting: {what}", self._clock)
        text = "running: the motor is on" if status == RigStatus.RUNNING else "ready: the motor is off"
        if late:
            return Health("rig", WARN, f"{text}, but ticks start more than 5 ms late: the machine is too busy", self._clock)
        return Health("rig", OK, text, self._clock)

    def _clock(self) -> dict:
        values = {"state": self.rig.status.name, "reason": self.rig.reason, "time_s": self.rig.time,
                  "overruns": self.clock.overruns, "refused_commands": sum(tuple(self.commands.refused.values()))}
        late = sorted(getattr(self.clock, "lateness_ns", [])[-NEWEST:])  # none in lockstep
        if late:
            values |= {"lateness_ms_p50": late[len(late) // 2] * 1e-6, "lateness_ms_max": late[-1] * 1e-6}
        return values

    def instruments(self) -> Health:
        """Whether the transducers have their noise."""
        gauges = self.rig.gauges
        says = "measures" if gauges.on else "measures without noise" if gauges.present else "shows true values"
        return Health("instruments", OK, says)


class RigHealth(ContainerHealth):
    """Called: the health of rig, motor, gearbox, clutches, valves, oil supply, load pump, instruments."""

    def __init__(self, rig: Rig, clock, commands):
        super().__init__(rig, clock, commands)
        self.transmission = transmission_of(rig.config)

    def __call__(self) -> list[Health]:
        each = range(len(self.transmission.clutches))
        return [self.whole(), self.motor(), self.gearbox(), *map(self.clutch, each), *map(self.valve, each),
                self.oil_supply(), self.load_pump(), self.instruments()]

    def motor(self) -> Health:
        """On, off or held without torque."""
        motor = self.rig.motor

        def values() -> dict:
            return {"speed_rad_s": float(self.rig.v[0]), "setpoint_rad_s": float(motor["target"]),
                    "torque_nm": float(motor["torque"])}

        if self.rig.status == RigStatus.TRIPPED:
            return Health("motor", WARN, "without torque: the rig is in its safe state", values)
        return Health("motor", OK, "on" if motor["enabled"] > 0.0 else "off", values)

    def gearbox(self) -> Health:
        """Which gear is engaged."""
        box = self.transmission
        locked = tuple(clutch for k, clutch in enumerate(box.clutches) if self.rig.clutch_mode(k) == LOCKED)
        gear = next((gear.name for gear in box.gears if gear.clutches and box.engaged(gear.number) == locked), None)
        text = (f"gear {gear} is engaged" if gear else "no gear is engaged" if not locked else
                f"{' and '.join(clutch.name for clutch in locked)} locked, which is no gear")
        return Health("gearbox", OK, text, lambda: {
            "w_wej_rad_s": float(self.rig.v[0]), "w_wyj_rad_s": float(self.rig.v[1])})

    def clutch(self, k: int) -> Health:
        """Open, slipping or locked."""
        clutch = self.transmission.clutches[k]
        return Health(clutch.instance, OK, MODES[self.rig.clutch_mode(k)], lambda: {
            "torque_nm": self.rig.clutch_torque(k), "slip_rad_s": self.rig.slip(k),
            "heat_j": self.rig.energy()[clutch.heat]})

    def valve(self, k: int) -> Health:
        """Whether somebody drives it."""
        rig, valve = self.rig, self.rig.valves[k]

        def values(age: float) -> dict:
            return {"command_age_ms": age * 1e3, "duty": float(valve["duty"]), "current_a": float(valve["current"]),
                    "pressure_pa": rig.line_pressure(k)}

        age = rig.command_age
        tell = partial(Health, self.transmission.clutches[k].valve, values=partial(values, age))
        if rig.newest_command < 0:
            return tell(STALE, "no valve command has come yet")
        if age > COMMAND_TIMEOUT:
            return tell(STALE, f"no valve command for more than {COMMAND_TIMEOUT * 1e3:.0f} ms: the coil has no current")
        if rig.status == RigStatus.TRIPPED:
            return tell(WARN, "the coil has no current: the rig is in its safe state")
        if rig.status == RigStatus.STARTING:
            return tell(WARN, "the coil has no current: the shift controller has not been in neutral yet")
        if age > OLD:
            return tell(WARN, f"the valve command is more than {OLD * 1e3:.0f} ms old; at {COMMAND_TIMEOUT * 1e3:.0f} ms "
                              "the rig trips")
        return tell(OK, "follows the shift controller")

    def oil_supply(self) -> Health:
        """Whether it has the pressure it is set to."""
        oil = self.rig.oil
        pressure, setting = float(oil["pressure"]), float(oil["setting"])
        tell = partial(Health, "oil_supply", values=lambda: {
            "pressure_pa": pressure, "setting_pa": setting, "temperature_degc": self.rig.config.oil_supply.temperature})
        if oil["enabled"] <= 0.0:
            return tell(OK, "off")
        if pressure < TOO_LOW * setting:
            return tell(WARN, "on, but the pressure is more than 10 % below its setting")
        return tell(OK, "on, at its pressure")

    def load_pump(self) -> Health:
        """Whether it loads the output shaft."""
        load = self.rig.load
        return Health("load_pump", OK, "on" if load["enabled"] > 0.0 else "off", lambda: {
            "torque_nm": self.rig.load_torque(), "pressure_pa": float(load["pressure"]),
            "setting_pa": float(load["setting"])})


class BenchHealth(ContainerHealth):
    """Called: the health of the clutch bench's rig, motor, cylinder, pack and instruments."""

    def __call__(self) -> list[Health]:
        return [self.whole(), self.motor(), self.cylinder(), self.pack(), self.instruments()]

    def motor(self) -> Health:
        """On, off or held without oil."""
        motor = self.rig.motor

        def values() -> dict:
            return {"speed_rad_s": float(self.rig.v[0]), "setpoint_rad_s": float(motor["target"]),
                    "pressure_pa": float(motor["pressure"]), "zp2_pa": float(motor["relief"])}

        if self.rig.status == RigStatus.TRIPPED:
            return Health("hydraulic_motor", WARN, "without oil: the rig is in its safe state", values)
        return Health("hydraulic_motor", OK, "on" if motor["enabled"] > 0.0 else "off", values)

    def cylinder(self) -> Health:
        """Whether it clamps."""
        press = self.rig.press
        text = "presses" if press["force"] > 0.0 else "is back"
        return Health("cylinder", OK, text, lambda: {
            "pressure_pa": float(press["pressure"]), "travel_m": float(press["travel"]), "force_n": float(press["force"])})

    def pack(self) -> Health:
        """Open, slipping or locked."""
        return Health("clutch_pack", OK, MODES[self.rig.clutch_mode()], lambda: {
            "torque_nm": self.rig.clutch_torque(), "heat_j": self.rig.energy()["heat"]})
