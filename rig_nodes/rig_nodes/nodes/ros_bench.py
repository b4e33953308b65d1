# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The bench of a test sequence over ROS: it sends setpoints and shift orders, and receives readings and states.

The sequencer node uses it; its interface is that of the in-process bench of `simulate`.
"""

from __future__ import annotations

import re
from functools import partial
from typing import TYPE_CHECKING, Any

from rcl_interfaces.srv import SetParameters
from rclpy.action import ActionClient
from rclpy.parameter import Parameter
from rig_msgs.action import Shift
from rig_msgs.msg import RigState

from ..bags import encoder
from ..base import SWITCH
from ..rig import Signal
from ..runs import Sequence, SequenceFailed
from .device import publishers_of
from .message_class import message_class
from .qos import recorder_profile
from .rig_node import FAULT, RIG

if TYPE_CHECKING:
    from collections.abc import Callable

    from rclpy.client import Client
    from rclpy.task import Future

    from ..rig import RigConfig
    from .sequencer import Sequencer

ANSWER_TIMEOUT = 10.0  # s that the controller may take to accept an order in lockstep
STATE, EVENTS = "/rig/state", "/sequencer/events"


def reader(signal: Signal) -> Callable[[Any], float]:
    """Return the function that reads a signal from a message of its topic; the signal's field may be like ``setpoint[0]``."""
    name, index = re.fullmatch(r"(\w+)(?:\[(\d+)\])?", signal.field).groups()
    if index is None:
        return lambda message: float(getattr(message, name))
    return lambda message: float(getattr(message, name)[int(index)])


class RosBench:
    """Implements runs.sequence_runner.Bench on a node; stamps come from ``stamp_ns``, that of the newest sample."""

    def __init__(self, node: Sequencer, config: RigConfig, in_lockstep: bool) -> None:
        """Open the topics; with ``in_lockstep``, readings and state come with the ticks of the container's link, not by topic."""
        self.node, self.config = node, config
        self.stamp_ns = 0
        self.rig_state = None  # newest RigState
        self.outputs = publishers_of(node, config.catalogue)
        self.counts = dict.fromkeys(self.outputs, 0)
        self._encode_setpoint = encoder("rig_msgs/msg/Setpoint").encode
        self._encode_event = encoder("rig_msgs/msg/Event").encode
        self.in_lockstep = in_lockstep
        self._values: dict[str, float] = {}
        self.needed: set[str] = set()  # signals that the sequence reads
        self._ordered = None
        self._topics: set[str] = set()
        self._done, self._newest = False, None
        self._refusal: str | None = None
        self._shift = ActionClient(node, Shift, "/controller/shift") if config.structure.shifts else None
        self._setters: dict[str, Client] = {}  # by node whose settings the sequence changes
        self._setting = None  # answer to the newest setting, when it is there
        if not in_lockstep:
            node.create_subscription(RigState, STATE, self._on_state, recorder_profile("measurement"))

    def need(self, sequence: Sequence) -> None:
        """Subscribe to the signals that a sequence reads; ``ready`` waits for them."""
        names = {step.condition.signal for step in sequence.steps if step.condition is not None}
        steps = self.config.settings.steps
        names |= {
            self.config.structure.speed_of_load(steps[step.kind].setpoint.device) for step in sequence.steps if step.by_torque
        }
        self.needed = names
        owners = {step.setting.partition(".")[0] for step in sequence.steps if step.setting}
        owners |= {RIG for step in sequence.steps if step.fault}
        for owner in owners - self._setters.keys():
            self._setters[owner] = self.node.create_client(SetParameters, f"/{owner}/set_parameters")
        if self.in_lockstep:
            return
        known = self.config.catalogue
        for topic_name in sorted({known.signals[name].topic for name in names} - self._topics):
            self._topics.add(topic_name)
            topic = known.topics[topic_name]
            readers = [(signal.name, reader(signal)) for signal in known.on_topic(topic_name)]

            def on_message(message: Any, readers: list[tuple[str, Callable[[Any], float]]] = readers) -> None:
                for name, read in readers:
                    self._values[name] = read(message)

            self.node.create_subscription(message_class(topic.ros_type), topic_name, on_message, recorder_profile(topic.qos))

    def connected(self) -> bool:
        """Return whether orders can be sent to all nodes that take them."""
        shifts = self._shift is None or self._shift.server_is_ready()
        return shifts and all(setter.service_is_ready() for setter in self._setters.values())

    def take(self, frame: dict) -> None:
        """Take readings and state of a tick in lockstep, where nothing may depend on the time at which a message arrives."""
        self._values.update(frame["readings"])
        self.rig_state = RigState(state=frame["status"], reason=frame["reason"])
        self._gear, self._shifting = frame["gear"], frame["shifting"]

    def sent(self) -> dict[str, int]:
        """Return the number of setpoints that were sent, by topic."""
        return {topic: count for topic, count in self.counts.items() if topic != EVENTS}

    def _on_state(self, message: RigState) -> None:
        self.rig_state = message

    def trip_reason(self) -> str | None:
        """Return why the rig is in its safe state; None when it is not."""
        state = self.rig_state
        return state.reason if state is not None and state.state == RigState.TRIPPED else None

    # ---- runs.sequence_runner.Bench

    def ready(self) -> bool:
        """Return whether the rig runs, the controller takes orders and every needed signal has a reading."""
        state = self.rig_state
        return (
            state is not None
            and state.state in (RigState.READY, RigState.RUNNING)
            and self.connected()
            and self.needed <= self._values.keys()
        )

    def set(self, step: str, value: float, enable: bool) -> None:
        """Send a setpoint [SI] of a device, by its key in sequences; RigError when it is out of range."""
        setting = self.config.settings.steps[step]
        setting.check(value)  # here, because a topic returns no answer
        topic = setting.setpoint.topic
        self.outputs[topic].publish(self._encode_setpoint(self.stamp_ns, self._next(topic), float(value), bool(enable)))

    def order_gear(self, gear: int) -> None:
        """Send a shift as a goal; ``shift_done`` reports its result."""
        self._done, self._refusal, self._ordered = False, None, gear
        future = self._newest = self._shift.send_goal_async(Shift.Goal(gear=gear))
        future.add_done_callback(self._on_answer)
        if self.in_lockstep:
            # an accepted order stands: the controller takes it with the sample that waits for this tick
            self.node.process.wait(future, ANSWER_TIMEOUT)
            if not future.done():
                raise SequenceFailed(f"the shift controller did not take the order within {ANSWER_TIMEOUT:g} s")

    def _on_answer(self, future: Future) -> None:
        handle = future.result()
        if handle.accepted:
            handle.get_result_async().add_done_callback(partial(self._on_result, future))
        elif future is self._newest:
            self._refusal = "the shift controller rejected the order"
            self.node.wake()

    def _on_result(self, order: Future, future: Future) -> None:
        if order is not self._newest:
            return  # the order belongs to a sequence that was cancelled
        result = future.result().result
        self._done = result.success
        self._refusal = None if result.success else result.message
        self.node.wake()

    def shift_done(self) -> bool:
        """Return whether the ordered shift is done; SequenceFailed with the controller's reason when it was refused."""
        if self.in_lockstep and self._refusal is None and self._gear != self._ordered:
            # the order was refused, whose reason is still to come, or the controller has not taken the gear yet
            self.node.process.spin(0.02)
        if self._refusal is not None:
            raise SequenceFailed(self._refusal)
        if self.in_lockstep:
            return not self._shifting and self._gear == self._ordered
        return self._done

    def controller_gear(self) -> tuple[int, bool] | None:
        """Return gear and shifting of the newest answer of the controller; None in real time, which has no such answers here."""
        return (self._gear, self._shifting) if self.in_lockstep else None

    def change(self, name: str, value: float) -> None:
        """Send a setting [SI] as the parameter of its node; ``changed`` reports the result."""
        owner, _, key = name.partition(".")
        switch = name in self.config.settings and self.config.settings[name].dimension == SWITCH
        self._ask(owner, Parameter(key, value=value != 0.0 if switch else float(value)))

    def fault(self, order: str) -> None:
        """Send an order of a fault as the parameter of the rig's node; ``changed`` reports the result."""
        self._ask(RIG, Parameter(FAULT, value=order))

    def _ask(self, owner: str, parameter: Parameter) -> None:
        self._setting = self._setters[owner].call_async(SetParameters.Request(parameters=[parameter.to_parameter_msg()]))
        self._setting.add_done_callback(lambda future: self.node.wake())
        if self.in_lockstep:
            self.node.process.wait(self._setting, ANSWER_TIMEOUT)

    def changed(self) -> bool:
        """Return whether the newest setting, or order of a fault, was taken; SequenceFailed with the reason when it was refused."""
        if not self._setting.done():
            return False
        (result,) = self._setting.result().results
        if not result.successful:
            raise SequenceFailed(result.reason or "there is no such setting")
        return True

    def reading(self, signal: str) -> float:
        """Return the newest value of a signal that the sequence needs [SI]."""
        return self._values[signal]

    def event(self, name: str, text: str, value: float = 0.0) -> None:
        """Publish an event of the sequencer."""
        self.outputs[EVENTS].publish(self._encode_event(self.stamp_ns, self._next(EVENTS), name, text, value))

    def _next(self, topic: str) -> int:
        seq = self.counts[topic]
        self.counts[topic] = seq + 1
        return self.node.process.first_seq + seq
