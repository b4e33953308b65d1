# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Release check of a controller FMU that pythonfmu makes: the law of the templates in Python.

    pythonfmu build -f tests/release/pythonfmu_controller.py
    ./rig simulate demo --controller fmu:Shifter.fmu --level current

See README.md beside it.
"""

from pythonfmu import Boolean, Fmi2Causality, Fmi2Slave, Integer, Real

FILL, PLATEAU, SLOPE, HELD = 0.30, 0.22, 1.2, 0.74  # s, A, A/s, A
OVERLAP, RELEASE = 0.25, 0.13  # s during which both clutches are on; A of the old one while the new one takes the torque


class Shifter(Fmi2Slave):
    """Current setpoints of three outputs [A]."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.gear_request = self.gear = self.old = 0
        self.since, self.shifting = -10.0, False
        self.command_1 = self.command_2 = self.command_3 = 0.0
        self.register_variable(Integer("gear_request", causality=Fmi2Causality.input))
        self.register_variable(Integer("gear", causality=Fmi2Causality.output))
        self.register_variable(Boolean("shifting", causality=Fmi2Causality.output))
        for name in ("command_1", "command_2", "command_3"):
            self.register_variable(Real(name, causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        """Answer one sample."""
        if self.gear_request != self.gear:
            self.old, self.gear, self.since = self.gear, self.gear_request, current_time
        elapsed, command = current_time - self.since, [0.0, 0.0, 0.0]
        if self.old and elapsed < OVERLAP + 0.2:
            command[self.old - 1] = HELD if elapsed < OVERLAP else RELEASE
        if self.gear:
            command[self.gear - 1] = min(PLATEAU + SLOPE * max(0.0, elapsed - FILL), HELD)
        self.command_1, self.command_2, self.command_3 = command
        self.shifting = elapsed < 1.5
        return True
