# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The rig's devices as nodes: publishers from the catalogue, what their parts take as topics and as parameters.

Used by the rig container; no node holds physics, and callbacks only enqueue.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rclpy.node import Node

from ..bags.cdr import Fields
from ..catalogue import Catalogue, Topic
from ..description.commands import Setpoint
from ..errors import RigError
from ..parts import part as parts
from .message_class import message_class
from .qos import publisher_profile, receiver_profile
from .settings import DeviceSettings

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    import numpy as np
    from rclpy.qos import QoSProfile
    from rclpy.subscription import Subscription

    from ..testbench.configuration import RigConfig
    from ..testbench.rig import Rig
    from .commands import Commands

OF_THE_WHOLE = ("rig", "instruments", "alfa46", "sequencer")  # nodes that are no device


def publishers_of(node: Node, known: Catalogue, in_lockstep: bool = False, more: Iterable[Topic] = ()) -> dict:
    """Publishers of all topics that the catalogue of a rig gives to this node, and of the topics ``more``, by name; they
    take encoded messages.
    """
    own = (topic for topic in known.topics.values() if topic.node == node.get_name())
    return {
        topic.name: node.create_publisher(message_class(topic.ros_type), topic.name, publisher_profile(topic.qos, in_lockstep))
        for topic in (*own, *more)
    }


def receive(
    node: Node,
    topic: Topic,
    callback: Callable[[np.void], None],
    profile: QoSProfile | None = None,
    refuse: Callable[[str, str], None] | None = None,
) -> Subscription:
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

    return node.create_subscription(
        message_class(topic.ros_type), topic.name, on_bytes, profile or receiver_profile(topic.qos), raw=True
    )


def setpoints_taken(config: RigConfig) -> list[Setpoint]:
    """The setpoints that somebody takes on this rig: not those of what its configuration leaves out."""
    return [one.setpoint for one in config.settings.steps.values() if not one.lacking]


def device_names(config: RigConfig) -> list[str]:
    """The nodes of a rig's devices, in the order of its topics; those that only take something come last."""
    publish = [topic.node for topic in config.catalogue.topics.values() if topic.node not in OF_THE_WHOLE]
    return list(dict.fromkeys([*publish, *(one.node for one in setpoints_taken(config))]))


def pace_of(config: RigConfig) -> Topic:
    """The topic whose messages bring simulated time to the other processes."""
    drive = config.structure.of_role(parts.SOURCE)[0].name
    return config.catalogue.topics["/instruments/controller" if config.structure.shifts else f"/{drive}/state"]


class Device(Node):
    """A node of the rig container: what the catalogue gives it goes out. ``inputs``: subscriptions by topic."""

    def __init__(self, name: str, rig: Rig, commands: Commands) -> None:
        """commands: the rig's queue; ``put(topic, function, *arguments)`` is applied at the next sample boundary."""
        super().__init__(name)
        self.commands, self.catalogue = commands, rig.config.catalogue
        self.outputs = publishers_of(self, self.catalogue)
        self.inputs = {}


class DeviceNode(Device):
    """A device of the laboratory, made of its part, or the instruments: what the catalogue gives it out; its settings in, as
    parameters, and its setpoints by topic too.
    """

    def __init__(self, name: str, rig: Rig, commands: Commands) -> None:
        super().__init__(name, rig, commands)
        for setpoint in setpoints_taken(rig.config):
            if setpoint.node == name:
                self._take(rig, setpoint)
        if rig.settings.at(name):
            self.settings = DeviceSettings(self, rig, commands)

    def _take(self, rig: Rig, setpoint: Setpoint) -> None:
        """Subscribe to a setpoint. In the safe state what drives the rig can be switched off only."""
        topic = self.catalogue.topics[setpoint.topic]

        def order(value: float, enable: bool) -> None:
            if enable and rig.refuses_drive(setpoint):
                raise RigError(f"refused: the rig is in its safe state ({rig.reason}); call /rig/reset first")
            rig.set(setpoint.step, value, enable)

        def enqueue(message: np.void) -> None:
            self.commands.put(topic.name, order, float(message["value"]), bool(message["enable"]))

        self.inputs[topic.name] = receive(self, topic, enqueue, refuse=self.commands.refuse)
