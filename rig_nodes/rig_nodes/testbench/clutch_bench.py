# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The clutch bench as a rig: one object that owns plant and instruments, moved sample by sample.

The counterpart of testbench.rig for thesis chapter 8; used by ``simulate``, the rig container and the tests.
"""

from __future__ import annotations

from ..catalogue import catalogue
from ..errors import RigError
from ..plant import driveline_algebra
from .bench_plan import plan_of
from .clutch_bench_configuration import KIND, ClutchBenchConfig
from .gauges import Gauges
from .timed import RigStatus, Timed, check_range

# what each channel is measured with: the first word of the fields of BenchInstruments
KINDS = {"M_e": "torque", "n": "speed", "p_z": "pressure", "s": "travel", "p_sh": "pressure", "T_emp": "temperature",
         "F_ps": "force"}
# device of a sequence's step -> what people call its setpoint, and the signal whose range it keeps to
SETPOINTS = {"motor": ("motor_speed", "n"), "relief": ("relief_pressure", "p_sh"),
             "cylinder": ("cylinder_pressure", "p_z"), "press": ("press_travel", "s")}


def check_bench_setpoint(device: str, value: float) -> None:
    """RigError when the bench would refuse this value [SI] of one of SETPOINTS, whoever sends it."""
    name, signal = SETPOINTS[device]
    check_range(name, value, catalogue(KIND).signals[signal])


class NoCuts:
    """No device of this rig can stand outside."""

    devices: tuple[str, ...] = ()
    embedded = True


class ClutchBench(Timed):
    """A bench from its configuration; ``seed`` draws the errors and the noise of its transducers."""

    embedded, newest_command, level = False, -1, None  # there is no shift controller

    drive = "hydraulic_motor"

    def __init__(self, config: ClutchBenchConfig, seed: int = 1):
        self.config, self.seed = config, int(seed)
        self.count_steps(config.kernel.step, catalogue(KIND))
        self.cuts = NoCuts()
        self._build()

    def _build(self) -> None:
        c, plan = self.config, plan_of(self.config)
        # a transducer that is not fitted leaves an open input, which shows nothing
        kinds = {name: kind for name, kind in KINDS.items() if kind != "force" or c.instruments.force_fitted}
        gauges = Gauges(c.instruments, self.seed, c.kernel.step, c.effects.transducers, tuple(plan.channels), kinds)
        gauges.table[:, [name not in kinds for name in plan.channels]] = 0.0
        self.build(plan, gauges)
        self.motor, self.press, self.pack = (self.device(name) for name in ("hydraulic_motor", "cylinder", "clutch_pack"))
        line = self.world.line
        self._el, self._e_in, self._twist, self._shaft = (line[name] for name in ("el", "e_in", "twist", "shaft"))
        self._pack, self._friction = (plan.system.elements.index(name) for name in ("clutch_pack", "friction"))

    # ---- time

    def advance_samples(self, samples: int = 1) -> None:
        """Move plant and instruments by samples of 1 ms; releases the GIL inside."""
        self.move(samples)

    # ---- commands, applied at the next sample boundary

    def set_motor(self, speed: float, enable: bool) -> None:
        """Speed [rad/s] for which the flow regulator RP is set; disabled, the stop valve is shut."""
        self._set("motor", speed, enable)

    def set_relief(self, pressure: float, enable: bool) -> None:
        """Where the maximum valve ZP_2 is turned to [Pa, gauge]; disabled, it is open."""
        self._set("relief", pressure, enable)

    def set_cylinder(self, pressure: float, enable: bool) -> None:
        """Setting of the relief valve ZP_1 [Pa, gauge]; disabled, the lever valve lets the chamber off to the tank."""
        self._set("cylinder", pressure, enable)

    def set_press(self, travel: float, enable: bool) -> None:
        """Where the testing machine moves to [m]; disabled, back to 0. RigError on a bench without one."""
        if not self.config.cylinder.testing_machine:
            raise RigError(f"'{self.config.name}' has no testing machine; spring_bench has one")
        self._set("press", travel, enable)

    def _set(self, device: str, value: float, enable: bool) -> None:
        check_bench_setpoint(device, value)
        state, target, on = self._switches()[device]
        state[target], state[on] = value, enable

    def _switches(self) -> dict[str, tuple]:
        """Device of a sequence's step -> states in which its setpoint and its switch are, and their names."""
        return {"motor": (self.motor, "target", "enabled"), "relief": (self.motor, "relief_target", "relief_enabled"),
                "cylinder": (self.press, "setting", "enabled"),
                "press": (self.press, "machine_target", "machine_enabled")}

    # ---- safe state

    @property
    def status(self) -> RigStatus:
        """What the bench is doing."""
        if self.safe:
            return RigStatus.TRIPPED
        return RigStatus.RUNNING if self.motor["enabled"] > 0.0 else RigStatus.READY

    def reset(self) -> None:
        """Leave the safe state; motor and cylinder stay off. RigError when the rig is in none."""
        self.check_tripped()
        self._safe[0] = 0.0
        for state, _, on in self._switches().values():
            state[on] = 0.0
        self.reason, self.stopped_by_person = "", False

    # ---- what can be read

    def clutch_mode(self) -> int:
        """0 open, 1 slipping, 2 locked, as in rig_msgs/ClutchState."""
        if self.pack["static"] <= 0.0:
            return 0
        return 2 if abs(self.mode[self._pack]) >= 2 else 1

    def clutch_torque(self) -> float:
        """Friction torque of the pack [Nm], positive when it brakes the shaft."""
        return float(self._el[driveline_algebra.LAM, self._pack])

    def energy(self) -> dict[str, float]:
        """Energies since time 0 [J]: each from its own torque and slip, none by difference."""
        fric, visc = self._el[driveline_algebra.E_FRIC], self._el[driveline_algebra.E_VISC]
        system = self.world.plan.system
        stored = 0.5 * float(self.v @ system.mass @ self.v) + 0.5 * float(system.kc[0] @ self._twist**2)
        out = {"motor": float(self._e_in.sum()), "heat": float(fric[self._pack] + visc[self._pack]),
               "friction": float(fric[self._friction]), "meter": float(self._shaft[driveline_algebra.E_SHAFT].sum()),
               "stored": stored}
        out["residual"] = out["motor"] - out["heat"] - out["friction"] - out["meter"] - out["stored"]
        return out
