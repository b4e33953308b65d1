# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A shift controller of your own, to change as you like. Every 1 ms it computes the current setpoints from the inputs that the real
controller's wires carry.

The old clutch is held until the new one is filled, and then released; the new one gets a plateau of current, then a ramp.
"""

from rig_nodes.controllers import ControllerInfo, ControllerInputs, ControllerOutputs, Status

OUTPUTS_OF = {0: (), 1: (0,), 2: (1,)}  # outputs that each gear needs, from the rig
FILL, PLATEAU, SLOPE, HELD = 0.30, 0.22, 1.2, 0.74  # s, A, A/s, A
OVERLAP, RELEASE = 0.35, 0.13  # s in which both clutches are on; A of the old one while the new one takes over


class MyController:
    """A small law with its present gear and shift."""

    levels = ("current",)  # what step returns: setpoints in A; "duty" would be 0 to 1

    def initialize(self, info: ControllerInfo) -> None:
        """A run begins."""
        self.gear, self.old, self.since = 0, 0, -10.0  # no shift is running
        self.outputs = len(info.outputs)
        self.parameters = info.parameters  # e.g. info.parameters["t12"], SI

    def step(self, inputs: ControllerInputs) -> ControllerOutputs:
        """The answer to one sample."""
        if inputs.gear_request and not OUTPUTS_OF.get(inputs.gear_request):
            why = f"gear {inputs.gear_request} has no output: OUTPUTS_OF names none"
            return ControllerOutputs(status=Status.ERROR, message=why)
        if inputs.gear_request != self.gear:
            self.old, self.gear, self.since = self.gear, inputs.gear_request, inputs.time
        elapsed = inputs.time - self.since
        command = [0.0] * self.outputs
        if elapsed < OVERLAP + 0.2:
            for k in OUTPUTS_OF[self.old]:
                command[k] = HELD if elapsed < OVERLAP else RELEASE
        for k in OUTPUTS_OF[self.gear]:
            kept = k in OUTPUTS_OF[self.old]  # a clutch of both gears
            command[k] = HELD if kept else min(PLATEAU + SLOPE * max(0.0, elapsed - FILL), HELD)
        return ControllerOutputs(command, gear=self.gear, shifting=elapsed < 1.5)

    def terminate(self) -> None:
        """The run is over."""
