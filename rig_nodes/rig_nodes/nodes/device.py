# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The rig's devices as nodes: publishers from the catalogue, what their parts take as topics and as parameters.

Used by the rig container; no node holds physics, and callbacks only enqueue.
"""

from __future__ import annotations

from functools import partial

from rclpy.node import Node

from ..bags.cdr import Fields
from ..catalogue import Catalogue, Topic
from ..description.commands import Setpoint
from ..errors import RigError
from ..parts import part as parts
from ..testbench.timed import RigStatus
from .message_class import message_class
from .qos import publisher_profile, receiver_profile
from .settings import DeviceSettings, Knob, Setting, setpoint_knobs

OF_THE_WHOLE = ("rig", "instruments", "alfa46", "sequencer")  # nodes that are no device


def publishers_of(node: Node, known: Catalogue, in_lockstep: bool = False, more=()) -> dict:
    """Publishers of all topics that the catalogue of a rig gives to this node, and of the topics ``more``, by name; they
    take encoded messages.
    """
    own = (topic for topic in known.topics.values() if topic.node == node.get_name())
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


def setpoints_taken(config) -> list[Setpoint]:
    """The setpoints that somebody takes on this rig: not those of what its configuration leaves out."""
    return [one for one in config.setpoints.values() if config.takes(one)]


def device_names(config) -> list[str]:
    """The nodes of a rig's devices, in the order of its topics; those that only take something come last."""
    publish = [topic.node for topic in config.catalogue.topics.values() if topic.node not in OF_THE_WHOLE]
    return list(dict.fromkeys([*publish, *(one.node for one in setpoints_taken(config))]))


def pace_of(config) -> Topic:
    """The topic whose messages bring simulated time to the other processes."""
    drive = config.structure.of_role(parts.SOURCE)[0].name
    return config.catalogue.topics["/instruments/controller" if config.structure.shifts else f"/{drive}/state"]


class Device(Node):
    """A node of the rig container: what the catalogue gives it goes out. ``inputs``: subscriptions by topic."""

    def __init__(self, name: str, rig, commands):
        """commands: the rig's queue; ``put(topic, function, *arguments)`` is applied at the next sample boundary."""
        super().__init__(name)
        self.commands, self.catalogue = commands, rig.config.catalogue
        self.outputs = publishers_of(self, self.catalogue)
        self.inputs = {}


class DeviceNode(Device):
    """A device of the laboratory, made of its part: transducers and state out; setpoints in, by topic and by parameter."""

    def __init__(self, name: str, rig, commands):
        super().__init__(name, rig, commands)
        knobs = []
        for setpoint in setpoints_taken(rig.config):
            if setpoint.node == name:
                knobs += self._takes(rig, setpoint)
        if name in {device.name for device in rig.config.structure.of_role(parts.OIL)}:
            knobs.append(self._temperature(rig, name))
        if knobs:
            self.settings = DeviceSettings(self, commands, knobs)

    def _takes(self, rig, setpoint: Setpoint) -> list[Knob]:
        """Subscribe to a setpoint; its two parameters. In the safe state what drives the rig can be switched off only."""
        command, topic = setpoint.command, self.catalogue.topics[setpoint.topic]
        drives = rig.config.structure.device(setpoint.device).role == parts.SOURCE and not command.node

        def order(value: float, enable: bool) -> None:
            if drives and enable and rig.status == RigStatus.TRIPPED:
                raise RigError(f"refused: the rig is in its safe state ({rig.reason}); call /rig/reset first")
            rig.set(setpoint.step, value, enable)

        def enqueue(message) -> None:
            self.commands.put(topic.name, order, float(message["value"]), bool(message["enable"]))

        def why_not(enable: bool) -> str | None:
            if drives and enable and rig.status == RigStatus.TRIPPED:
                return f"enabled refused: the rig is tripped ({rig.reason}); call /rig/reset first"
            return None

        self.inputs[topic.name] = receive(self, topic, enqueue, refuse=self.commands.refuse)
        like = self.catalogue.signals[setpoint.like]
        text = command.text[0].upper() + command.text[1:] + (", gauge" if like.gauge else "")
        return setpoint_knobs(rig.device(setpoint.device), command.target, command.enabled, partial(rig.set, setpoint.step),
                              Setting(command.parameter or command.value, text, 0.0, like.unit, (like.low, like.high)), why_not)

    @staticmethod
    def _temperature(rig, name: str) -> Knob:
        """Of the oil of a supply, which is no setpoint."""
        def temperature() -> float:
            return getattr(rig.config, name).temperature

        meta = type(getattr(rig.config, name)).__dataclass_fields__["temperature"].metadata
        setting = Setting("temperature", meta["text"], temperature(), "degC", (meta["low"], meta["high"]))
        return Knob(setting, temperature, partial(rig.set_value, f"{name}.temperature"))
