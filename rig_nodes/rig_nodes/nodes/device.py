# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The base of the rig's own nodes: publishers from the catalogue, commands into the queue of the rig.

Used by every node of the rig container; none of them holds physics, and callbacks only enqueue.
"""

from __future__ import annotations

from rclpy.node import Node

from ..bags.cdr import Fields
from ..catalogue import GEARBOX, Topic, catalogue
from ..errors import RigError
from ..testbench.timed import RigStatus
from .message_class import message_class
from .qos import publisher_profile, receiver_profile


def publishers_of(node: Node, in_lockstep: bool = False, more=(), kind: str = GEARBOX) -> dict:
    """Publishers of all topics that the catalogue of a kind of rig gives to this node, and of the topics ``more``, by
    name; they take encoded messages.
    """
    own = (topic for topic in catalogue(kind).topics.values() if topic.node == node.get_name())
    return {topic.name: node.create_publisher(message_class(topic.ros_type), topic.name,
                                              publisher_profile(topic.qos, in_lockstep))
            for topic in (*own, *more)}


def receive(node: Node, topic: Topic, callback, profile=None, refuse=None) -> object:
    """Subscribe a device to its topic; the callback gets the fields as a numpy record.

    profile: by default that of the receiver whom the topic is meant for; refuse: gets topic and sentence for bytes that
    are no such message.
    """
    fields = Fields(topic.ros_type)

    def on_bytes(data: bytes) -> None:
        try:
            message = fields.of(data)
        except ValueError:
            why = f"{len(data)} bytes are no {topic.type}"
            node.get_logger().warning(f"{topic.name}: {why}")
            if refuse is not None:
                refuse(topic.name, why)
            return
        callback(message)

    return node.create_subscription(message_class(topic.ros_type), topic.name, on_bytes,
                                    profile or receiver_profile(topic.qos), raw=True)


class Device(Node):
    """A device of the laboratory: its transducers and its state go out, its command comes in."""

    def __init__(self, name: str, commands, kind: str = GEARBOX):
        """commands: the rig's queue; ``put(topic, function, *arguments)`` is applied at the next sample boundary.

        kind: of the rig to which the device belongs.
        """
        super().__init__(name)
        self.commands = commands
        self.outputs = publishers_of(self, kind=kind)
        self.inputs = {}

    def on_setpoint(self, topic: str, function) -> None:
        """Pass a Setpoint's value and enable to a function of the rig."""
        def enqueue(message) -> None:
            self.commands.put(topic, function, float(message["value"]), bool(message["enable"]))

        self.inputs[topic] = receive(self, catalogue().all_topics[topic], enqueue, refuse=self.commands.refuse)

    def on_drive(self, topic: str, rig) -> None:
        """As :meth:`on_setpoint` for the rig's drive, which in the safe state can be switched off only."""
        def order(speed: float, enable: bool) -> None:
            if enable and rig.status == RigStatus.TRIPPED:
                raise RigError(f"refused: the rig is in its safe state ({rig.reason}); call /rig/reset first")
            rig.set_motor(speed, enable)

        self.on_setpoint(topic, order)
