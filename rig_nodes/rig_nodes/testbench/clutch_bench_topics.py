# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the clutch bench's topics say, as fields of their messages; the counterpart of testbench.topics.States."""

from __future__ import annotations

from ..clocks import TICK_SAMPLES
from ..plant import clutch_bench as kernel
from .clutch_bench import ClutchBench

MEASURED = {  # topic of a transducer -> its logger column
    "/hydraulic_motor/m_e": kernel.M_E, "/hydraulic_motor/n": kernel.N, "/hydraulic_motor/p_sh": kernel.P_SH,
    "/cylinder/p_z": kernel.P_Z, "/cylinder/s": kernel.S, "/cylinder/f_ps": kernel.F_PS,
    "/clutch_pack/t_emp": kernel.T_EMP,
}
COMMANDS = {  # device of a sequence's step -> topic of its setpoint
    "motor": "/hydraulic_motor/command", "relief": "/valve_zp2/command", "cylinder": "/cylinder/command",
    "press": "/testing_machine/command",
}


class BenchStates:
    """Fields of the state topics, from the bench as it is; :meth:`refresh` before each tick's."""

    measured = MEASURED

    def __init__(self, rig: ClutchBench):
        self.rig, self.overruns = rig, 0  # overruns: set by whoever keeps time
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
        rig, settings = self.rig, self.rig.settings[0]
        torque = rig.config.hydraulic_motor.displacement * float(rig.state["motor_pressure"][0])
        return (float(rig.v[kernel.MOTOR]), float(settings["motor_speed"]), torque, self._energy["motor"],
                bool(settings["motor_on"] > 0.0))

    def _cylinder(self):
        rig, settings = self.rig, self.rig.settings[0]
        return (float(rig.state["p_z"][0]), float(settings["cylinder_pressure"]), 0.0,
                rig.config.oil_supply.temperature, bool(settings["cylinder_on"] > 0.0))

    def _pack(self):
        rig, state = self.rig, self.rig.state[0]
        slip = float(rig.v[kernel.SHAFT])
        return (rig.clutch_mode(), rig.clutch_torque(), float(state["drag"]) * slip, float(state["kinetic"]),
                float(state["static"]), slip, float(state["clamp"]), float(state["p_z"]), float(state["travel"]),
                self._energy["heat"])

    def _rig_state(self):
        rig = self.rig
        return (int(rig.status), rig.reason, rig.stopped_by_person, rig.sample // TICK_SAMPLES, self.overruns,
                self._energy["residual"])
