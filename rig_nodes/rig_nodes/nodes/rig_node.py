# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The node of the rig as a whole; the rig container runs it.

It publishes state and events; it takes valve commands, emergency stop and reset.
"""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any

from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rig_msgs.msg import Event
from std_srvs.srv import Trigger

from ..base import RigError
from ..rig import CONTROLLER_COMMAND, CONTROLLER_EVENTS, CONTROLLER_FAILED, CONTROLLER_SILENT
from .device import Device, receive
from .qos import COMMANDS, recorder_profile

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from rclpy.parameter import Parameter

    from ..runs import Rig
    from .commands import Commands


RIG, FAULT = "rig", "fault"  # name of the node, and its parameter that takes orders of faults


class RigNode(Device):
    """Publishes /rig/*, takes /controller/command where there are valves, and serves /rig/e_stop and /rig/reset."""

    def __init__(self, rig: Rig, commands: Commands, valve_commands: bool) -> None:
        """Open topics and services; ``valve_commands`` is True when valve commands arrive on their topic.

        In lockstep they arrive through the controller's link, and the topic only shows them. A rig without a shift controller
        has none.
        """
        super().__init__(RIG, rig, commands)
        self.rig = rig
        if valve_commands:
            self.inputs[CONTROLLER_COMMAND] = receive(
                self, self.catalogue.topics[CONTROLLER_COMMAND], self.on_valve_command, refuse=commands.refuse
            )
            profile = recorder_profile(self.catalogue.topics[CONTROLLER_EVENTS].qos)
            self.create_subscription(Event, CONTROLLER_EVENTS, self.on_controller_event, profile)
        self._seq: int | None = None  # of the newest valve command
        self.create_service(Trigger, "~/e_stop", self.on_e_stop)
        self.create_service(Trigger, "~/reset", self.on_reset)
        if rig.faults is not None:
            text = "Order of a fault or its end, as --fault of ./rig run takes it"
            self.declare_parameter(FAULT, "", ParameterDescriptor(name=FAULT, description=text), ignore_override=True)
            self.add_on_set_parameters_callback(self.on_fault)
            self.create_service(Trigger, "~/faults", self.on_faults)

    def on_valve_command(self, message: np.void) -> None:
        """Enqueue the answer to one controller sample, and record the commands before it that did not arrive."""
        seq, before = int(message["seq"]), self._seq
        self._seq = seq
        if before is not None and 1 < seq - before <= COMMANDS and self.count_publishers(CONTROLLER_COMMAND) == 1:
            self.commands.refuse(CONTROLLER_COMMAND, f"{seq - before - 1} commands were sent that did not reach the rig")
        self.commands.put(
            CONTROLLER_COMMAND,
            self.take,
            int(message["level"]),
            int(message["sample"]),
            message["duty"].tolist(),
            message["setpoint"].tolist(),
            int(message["gear"]),
            bool(message["shifting"]),
            int(message["flags"]),
        )

    def on_controller_event(self, message: Event) -> None:
        """Trip at once for a controller that has failed, or keep why it does not answer, for a trip that follows from that."""
        act = {CONTROLLER_FAILED: self.rig.fail_controller, CONTROLLER_SILENT: self.rig.explain_silence}.get(message.name)
        if act is not None:
            self.commands.put_first(CONTROLLER_EVENTS, lambda: self.learn(act, message.text))

    def learn(self, act: Callable[[str], bool], text: str) -> None:
        """Give the rig what the controller's plug knows; a reason that came after the trip becomes an event of its own."""
        if act(text):
            self.commands.event("rig_tripped", self.rig.reason, float(self.rig.status))

    def take(self, *command: Any) -> None:
        """Give the rig one valve command; RigError when it is refused, or is taken without acting."""
        try:
            self.rig.set_command(*command)
            if self.rig.idle_command:
                raise RigError(f"valve command for sample {command[1]} does not act: {self.rig.idle_command}")
        except RigError as error:
            senders = self.count_publishers(CONTROLLER_COMMAND)
            if senders < 2:
                raise
            raise RigError(f"{error}; {senders} nodes send it, and the first answer to a sample counts") from None

    def on_fault(self, parameters: list[Parameter]) -> SetParametersResult:
        """Answer an order of a fault when the rig has checked it, and enqueue it."""
        try:
            for one in parameters:
                if one.name == FAULT and one.value:
                    self.rig.faults.check(str(one.value))
                    self.commands.put(f"/{RIG}/set_parameters", self.rig.order_fault, str(one.value))
        except RigError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def on_faults(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Say which faults are there: ``NAME on`` or ``NAME waiting``, with commas between them."""
        there = [f"{one.order.of.name} {'on' if one.began >= 0 else 'waiting'}" for one in self.rig.faults.acting]
        response.success, response.message = True, ", ".join(there)
        return response

    def on_e_stop(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Do the emergency stop before all other commands; it holds until the reset."""
        return self.at_once(self.rig.e_stop, "/rig/e_stop", "emergency stop", response)

    def on_reset(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Leave the safe state; refused when the rig is not in it."""
        return self.at_once(self.rig.reset, "/rig/reset", "safe state left", response)

    def at_once(self, function: Callable[[], None], source: str, text: str, response: Trigger.Response) -> Trigger.Response:
        """Answer when the rig has done or refused the call, which takes at most a sample unless its loop is not running."""
        done, refusal = threading.Event(), []

        def act() -> None:
            try:
                function()
                self.commands.event(source.rpartition("/")[2], text)
            except RigError as error:
                refusal.append(str(error))
            done.set()

        self.commands.put_first(source, act)
        if not done.wait(0.1):
            response.message = "the rig does not run; it will be done when it does"
        else:
            response.success = not refusal
            response.message = refusal[0] if refusal else text
        return response
