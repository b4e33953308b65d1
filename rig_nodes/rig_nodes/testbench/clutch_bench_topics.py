# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the clutch bench's topics say, as fields of their messages; the counterpart of testbench.topics.States."""

from __future__ import annotations

from ..clocks import TICK_SAMPLES
from .clutch_bench import ClutchBench
from .topics import measured_columns

COMMANDS = {  # device of a sequence's step -> topic of its setpoint
    "motor": "/hydraulic_motor/command", "relief": "/valve_zp2/command", "cylinder": "/cylinder/command",
    "press": "/testing_machine/command",
}


class BenchStates:
    """Fields of the state topics, from the bench as it is; :meth:`refresh` before each tick's."""

    def __init__(self, rig: ClutchBench):
        self.rig, self.overruns = rig, 0  # overruns: set by whoever keeps time
        self.measured = measured_columns(rig)
        self._energy: dict[str, float] = {}  # of this tick
        self.topics = {"/hydraulic_motor/state": self._motor, "/cylinder/state": self._cylinder,
                       "/clutch_pack/state": self._pack, "/rig/state": self._rig_state}

    def refresh(self) -> None:
        """Take the energies of this tick."""
        self._energy = self.rig.energy()

    def turn(self, rows) -> None:
        """No message says the angle of a shaft."""

    def once(self) -> list[tuple]:
        """No controller, no record of one."""
        return []

    def each_sample(self) -> list[tuple]:
        """(topic, its fields) of what goes out with every sample: nothing, there is no controller to tell."""
        return []

    def mirrors(self) -> list[tuple]:
        """No messages in standard types."""
        return []

    def _motor(self):
        rig, motor = self.rig, self.rig.motor
        torque = rig.config.hydraulic_motor.displacement * float(motor["pressure"])
        return (rig.true("motor.speed"), float(motor["target"]), torque, self._energy["motor"],
                bool(motor["enabled"] > 0.0))

    def _cylinder(self):
        press = self.rig.press
        return (float(press["pressure"]), float(press["setting"]), 0.0, self.rig.config.oil_supply.temperature,
                bool(press["enabled"] > 0.0))

    def _pack(self):
        rig, pack, press = self.rig, self.rig.pack, self.rig.press
        slip = rig.true("shaft.speed")
        return (rig.clutch_mode(), rig.clutch_torque(), float(pack["drag"]) * slip, float(pack["kinetic"]),
                float(pack["static"]), slip, float(pack["clamp"]), float(press["pressure"]), float(press["travel"]),
                self._energy["heat"])

    def _rig_state(self):
        rig = self.rig
        return (int(rig.status), rig.reason, rig.stopped_by_person, rig.sample // TICK_SAMPLES, self.overruns,
                self._energy["residual"])
