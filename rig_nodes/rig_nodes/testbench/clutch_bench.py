# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The clutch bench as a rig: one object that owns plant and instruments, moved sample by sample.

The counterpart of testbench.rig for thesis chapter 8; used by ``simulate``, the rig container and the tests.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..catalogue import catalogue
from ..config.schema import fill, record_dtype
from ..errors import RigError
from ..plant import clutch, driveline_algebra
from ..plant import clutch_bench as kernel
from ..plant.hydraulic_motor import FRICTION, PACK, build_driveline
from ..plant.outcome import WHOLE
from .clutch_bench_configuration import KIND, ClutchBenchConfig
from .gauges import Gauges
from .timed import RigStatus, Timed, check_range

# what each channel is measured with: the first word of the fields of BenchInstruments
KINDS = {"M_e": "torque", "n": "speed", "p_z": "pressure", "s": "travel", "p_sh": "pressure", "T_emp": "temperature",
         "F_ps": "force"}
# device of a sequence's step -> setting and the signal whose range it keeps to
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

    def __init__(self, config: ClutchBenchConfig, seed: int = 1):
        self.config, self.seed, self.channels = config, int(seed), kernel.CHANNELS
        self.count_steps(config.kernel.step, catalogue(KIND))
        self.cuts = NoCuts()
        self._build()

    def _build(self) -> None:
        c, effects = self.config, self.config.effects
        system = build_driveline(c.hydraulic_motor, c.shaft)
        self._minv, self._w, self._sh, self._kc, self.mass = system.minv, system.w, system.sh, system.kc, system.mass
        start = system.state()
        self.mode, self._events, self._count, self._work = start.mode, start.events, start.count, start.work
        self._q, self._cap, self._loss = np.zeros((2, len(start.v))), np.zeros((7, len(self.mode))), start.loss

        def record(*instances, **extra):
            names = [(name, "f8") for name in extra]
            out = np.zeros(1, np.dtype(record_dtype(*map(type, instances)).descr + names))
            fill(out, *instances)
            for name, value in extra.items():
                out[name] = value
            return out

        cylinder, plates = c.cylinder, c.plate_pack
        if not effects.seal_friction:
            cylinder = replace(cylinder, seal_friction=0.0, seal_friction_back=0.0)
        if not effects.plate_heat:
            plates = replace(plates, friction_per_kelvin=0.0)
        model, k_kor = c.pack.friction_model, c.pack.friction_correction
        per_force = {kind: k_kor * clutch.torque_per_force(plates, mu, False, model)
                     for kind, mu in (("kinetic", plates.friction_kinetic), ("static", plates.friction_static))}
        self._motor, self._cylinder, self._oil = record(c.hydraulic_motor), record(cylinder), record(c.oil_supply)
        self._pack = record(plates, c.pack, clearance=cylinder.contact_travel,
                            drag_factor=clutch.drag_factor(plates, c.pack.drag_model),
                            kinetic_per_force=per_force["kinetic"], static_per_force=per_force["static"])
        self.settings = np.zeros(1, kernel.BENCH_SETTINGS)
        # all that must be finite lies in one array
        parts = {"state": np.zeros(len(kernel.BENCH_STATE)), "speed": start.v, "twist": start.twist, "friction": start.el,
                 "shaft": start.shaft, "work": start.e_in}
        self._moved = np.concatenate([part.ravel() for part in parts.values()])
        self._kept = np.zeros((2, self._moved.size))
        self._places = [*kernel.BENCH_STATE.names, *(
            f"{name} {k + 1} of the shaft line" for name, part in parts.items() if name != "state"
            for k in range(part.size))]
        begin = np.cumsum([0, *(part.size for part in parts.values())])
        state, self.v, self._twist, self._el, self._shaft, self._e_in = (
            self._moved[a:b].reshape(part.shape) for a, b, part in zip(begin, begin[1:], parts.values()))
        self.state = state.view(kernel.BENCH_STATE)
        self.state["temperature"] = c.oil_supply.temperature
        # a transducer that is not fitted leaves an open input, which shows nothing
        kinds = {name: kind for name, kind in KINDS.items() if kind != "force" or c.instruments.force_fitted}
        self.gauges = Gauges(c.instruments, self.seed, c.kernel.step, effects.transducers, kernel.CHANNELS, kinds)
        self._fitted = [name in kinds for name in kernel.CHANNELS]
        self.gauges.table[:, np.logical_not(self._fitted)] = 0.0
        kernel.measure(self.ring()[0], 0, self.state[0], self.v, self._oil[0], *self.gauges.arrays)

    # ---- time

    def advance_samples(self, samples: int = 1) -> None:
        """Move plant and instruments by samples of 1 ms; releases the GIL inside."""
        end = self.sample + samples
        while self.sample < end:
            self.sample, how = kernel.advance(
                end - self.sample, self.sample, self._steps_per_sample, self.step, self.settings, self.state, self.v,
                self._twist, self.mode, self._el, self._shaft, self._e_in, self._events, self._count, self._work, self._q,
                self._cap, self._loss, self._minv, self._w, self._sh, self._kc, self._motor, self._cylinder, self._oil,
                self._pack, *self.gauges.arrays, self._log, self._moved, self._kept)
            if how != WHOLE and self.status != RigStatus.TRIPPED:
                self.trip_for(how, self._places, self._kept[1])
                return

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
        self.settings[SETPOINTS[device][0]] = value
        self.settings[f"{device}_on"] = float(enable)

    # ---- safe state

    @property
    def status(self) -> RigStatus:
        """What the bench is doing."""
        if self.settings["safe"][0] > 0.0:
            return RigStatus.TRIPPED
        return RigStatus.RUNNING if self.settings["motor_on"][0] > 0.0 else RigStatus.READY

    def reset(self) -> None:
        """Leave the safe state; motor and cylinder stay off. RigError when the rig is in none."""
        self.check_tripped()
        for name in ("safe", "motor_on", "relief_on", "cylinder_on", "press_on"):
            self.settings[name] = 0.0
        self.reason, self.stopped_by_person = "", False

    # ---- what can be read

    def clutch_mode(self) -> int:
        """0 open, 1 slipping, 2 locked, as in rig_msgs/ClutchState."""
        if self.state["static"][0] <= 0.0:
            return 0
        return 2 if abs(self.mode[PACK]) >= 2 else 1

    def clutch_torque(self) -> float:
        """Friction torque of the pack [Nm], positive when it brakes the shaft."""
        return float(self._el[driveline_algebra.LAM, PACK])

    def energy(self) -> dict[str, float]:
        """Energies since time 0 [J]: each from its own torque and slip, none by difference."""
        fric, visc = self._el[driveline_algebra.E_FRIC], self._el[driveline_algebra.E_VISC]
        stored = 0.5 * float(self.v @ self.mass @ self.v) + 0.5 * float(self._kc[0] @ self._twist**2)
        out = {"motor": float(self._e_in.sum()), "heat": float(fric[PACK] + visc[PACK]),
               "friction": float(fric[FRICTION]), "meter": float(self._shaft[driveline_algebra.E_SHAFT].sum()),
               "stored": stored}
        out["residual"] = out["motor"] - out["heat"] - out["friction"] - out["meter"] - out["stored"]
        return out
