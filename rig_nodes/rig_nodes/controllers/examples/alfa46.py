# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The Alfa46 law as a user's controller in plain Python: profiles P1-P6, delays t12 to t32, current loop.

Run it with ``./rig simulate demo --controller python:rig_nodes.controllers.examples.alfa46:Alfa46``; it gives the same
bits as the built-in controller, at both levels.
"""

from collections.abc import Mapping

from rig_nodes.controllers.seam import ControllerInfo, ControllerInputs, ControllerOutputs

OFF, ON, FALLING = range(3)


class Output:
    """One valve output: its six profile points, its phase and its current loop."""

    def __init__(self, parameters: Mapping[str, float], name: str) -> None:
        self.points = [(parameters[f"{name}.P{n}.time"], parameters[f"{name}.P{n}.current"]) for n in range(1, 7)]
        self.phase, self.start, self.from_current = OFF, 0, 0.0
        self.pending, self.pending_at = OFF, 0
        self.setpoint = self.integral = self.filtered = self.duty = 0.0

    def switch(self, phase: int, sample: int) -> None:
        """Begin to rise or fall at a sample."""
        self.pending, self.pending_at = phase, sample

    def follow_profile(self, sample: int, period: float) -> None:
        """Set the setpoint [A]: straight lines from switch-on over P1-P3, from switch-off over P4-P6."""
        if self.pending != OFF and sample >= self.pending_at:
            self.phase, self.start, self.from_current = self.pending, self.pending_at, self.setpoint
            self.pending = OFF
        if self.phase == OFF:
            self.setpoint = 0.0
            return
        elapsed = (sample - self.start) * period
        t0, i0 = (0.0, 0.0) if self.phase == ON else (0.0, self.from_current)
        for t1, i1 in self.points[:3] if self.phase == ON else self.points[3:]:
            if elapsed < t1:
                i0 = i0 + (i1 - i0) * (elapsed - t0) / (t1 - t0)
                break
            t0, i0 = t1, i1
        self.setpoint = i0
        if self.phase == FALLING and elapsed > self.points[5][0] and self.setpoint <= 0.0:
            self.phase, self.setpoint = OFF, 0.0

    def close_loop(self, current: float, period: float, p: Mapping[str, float]) -> None:
        """Set the duty: PID in volts, with a filtered derivative and an integral limited to the supply voltage."""
        if self.phase == OFF:
            self.duty, self.integral, self.filtered = 0.0, 0.0, -current
            return
        error = self.setpoint - current
        slope = (error - self.filtered) / p["derivative_time"]
        self.filtered += slope * period
        self.integral = min(max(self.integral + p["gain_i"] * error * period, 0.0), p["supply_voltage"])
        voltage = p["gain_p"] * error + self.integral + p["gain_d"] * slope
        self.duty = min(max(voltage / p["supply_voltage"], 0.0), 1.0)


class Alfa46:
    """The controller: initialize is called once, step for each sample, terminate once."""

    levels = ("duty", "current")

    def initialize(self, info: ControllerInfo) -> None:
        """Keep the settings and begin in neutral."""
        self.period, self.level, self.parameters = info.period, info.level, info.parameters
        self.outputs = [Output(info.parameters, f"output_{n}") for n in (1, 2, 3)]
        self.gear, self.shift_end = 0, 0

    def order(self, gear: int, sample: int) -> None:
        """Switch the valves of the old and the new gear; the delay of this gear change makes one of them wait."""
        delay = self.parameters.get(f"t{self.gear}{gear}", 0.0)  # t12, t21, t23, t32
        wait = round(delay / self.period)
        self.shift_end = sample
        for number, phase, begin, last in ((gear, ON, max(0, wait), 2), (self.gear, FALLING, max(0, -wait), 5)):
            if number:
                output = self.outputs[number - 1]
                output.switch(phase, sample + begin)
                duration = round(output.points[last][0] / self.period)
                self.shift_end = max(self.shift_end, output.pending_at + duration)
        self.gear = gear

    def step(self, inputs: ControllerInputs) -> ControllerOutputs:
        """Return the answer to one sample."""
        if inputs.gear_request != self.gear and inputs.sample >= self.shift_end:
            self.order(inputs.gear_request, inputs.sample)
        for output, current in zip(self.outputs, inputs.current, strict=True):
            output.follow_profile(inputs.sample, self.period)
            output.close_loop(current, self.period, self.parameters)
        setpoint = [output.setpoint for output in self.outputs]
        command = setpoint if self.level == "current" else [output.duty for output in self.outputs]
        on = sum(1 << k for k, output in enumerate(self.outputs) if output.phase != OFF)
        return ControllerOutputs(command, setpoint, self.gear, inputs.sample < self.shift_end, on)

    def terminate(self) -> None:
        """Release nothing; this controller holds no resources."""
