# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The rig's devices as nodes: publishers from the catalogue, and what their parts take as topics and as parameters.

The rig container uses them; no node contains physics, and callbacks only enqueue.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy

from ..bags import Fields
from ..base import RigError
from ..plant import part as parts
from ..rig import Catalogue, Setpoint, Topic
from .message_class import message_class
from .qos import publisher_profile, receiver_profile
from .settings import DeviceSettings

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    import numpy as np
    from rclpy.event_handler import QoSRequestedIncompatibleQoSInfo
    from rclpy.publisher import Publisher
    from rclpy.qos import QoSProfile
    from rclpy.subscription import Subscription

    from ..rig import RigConfig
    from ..runs import Rig
    from .commands import Commands

OF_THE_WHOLE = ("rig", "instruments", "alfa46", "sequencer")  # nodes that are not devices


def publishers_of(node: Node, known: Catalogue, in_lockstep: bool = False, more: Iterable[Topic] = ()) -> dict:
    """Return publishers, which take encoded messages, of all topics that the catalogue gives to a node.

    Parameters
    ----------
    node : Node
        The node.
    known : Catalogue
        The catalogue of the rig.
    in_lockstep : bool
        True for a run in lockstep, whose topics have no deadline.
    more : iterable of Topic
        Further topics.

    Returns
    -------
    dict of str to Publisher
        Publishers by topic.
    """
    own = (topic for topic in known.topics.values() if topic.node == node.get_name())
    return {
        topic.name: node.create_publisher(message_class(topic.ros_type), topic.name, publisher_profile(topic.qos, in_lockstep))
        for topic in (*own, *more)
    }


def sender(publisher: Publisher) -> Callable[[bytes], None]:
    """Return the function that sends an encoded message to the receivers of a topic, or keeps it for those that come later.

    ``Publisher.publish`` takes twice as long as the ``publish_raw`` that it calls, and this takes four times as long as asking
    whether there are receivers. In lockstep most topics have none, because the recorder has its own way.
    """
    publish, receivers = publisher.handle.publish_raw, publisher.handle.get_subscription_count
    if publisher.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL:
        return publish

    def send(data: bytes) -> None:
        if receivers():
            publish(data)

    return send


def receive(
    node: Node,
    topic: Topic,
    callback: Callable[[np.void], None],
    profile: QoSProfile | None = None,
    refuse: Callable[[str, str], None] | None = None,
) -> Subscription:
    """Subscribe a device to its topic.

    Parameters
    ----------
    node : Node
        The node that subscribes.
    topic : Topic
        The topic.
    callback : callable
        It gets the fields of a message as a numpy record.
    profile : QoSProfile, optional
        By default that of the device for which the topic is meant.
    refuse : callable, optional
        It gets the topic and a sentence for bytes that are no such message.

    Returns
    -------
    Subscription
        The subscription.
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

    def on_unfit(unfit: QoSRequestedIncompatibleQoSInfo) -> None:
        if refuse is None:
            return
        # the recorder receives such a publisher, so the bag must tell why its orders have no effect
        policy = unfit.last_policy_kind.name.rpartition("_")[2].lower()
        refuse(
            topic.name,
            f"a publisher offers a weaker quality of service ({policy}) than the device needs; its messages have no effect",
        )

    return node.create_subscription(
        message_class(topic.ros_type),
        topic.name,
        on_bytes,
        profile or receiver_profile(topic.qos),
        raw=True,
        event_callbacks=SubscriptionEventCallbacks(incompatible_qos=on_unfit),
    )


def setpoints_taken(config: RigConfig) -> list[Setpoint]:
    """Return the setpoints that have an effect on this rig, without those of what its configuration leaves out."""
    return [one.setpoint for one in config.settings.steps.values() if one.setpoint is not None and not one.lacking]


def device_names(config: RigConfig) -> list[str]:
    """Return the nodes of a rig's devices in the order of its topics; those that only receive come last."""
    publish = [topic.node for topic in config.catalogue.topics.values() if topic.node not in OF_THE_WHOLE]
    return list(dict.fromkeys([*publish, *(one.node for one in setpoints_taken(config))]))


def own_nodes(config: RigConfig) -> set[str]:
    """Return the names of all nodes of a run of this rig; others are users' nodes."""
    devices = device_names(config)
    return {"recorder", *OF_THE_WHOLE, *devices, *(f"{name}_device" for name in devices)}


def pace_of(config: RigConfig) -> Topic:
    """Return the topic whose messages bring simulated time to the other processes."""
    drive = config.structure.of_role(parts.SOURCE)[0].name
    return config.catalogue.topics["/instruments/controller" if config.structure.shifts else f"/{drive}/state"]


class Device(Node):
    """A node of the rig container that publishes what the catalogue gives it; ``inputs`` are its subscriptions by topic."""

    def __init__(self, name: str, rig: Rig, commands: Commands) -> None:
        """Open the publishers; ``commands`` is the rig's queue, which is applied at the next sample boundary."""
        super().__init__(name)
        self.commands, self.catalogue = commands, rig.config.catalogue
        self.outputs = publishers_of(self, self.catalogue)
        self.inputs = {}


class DeviceNode(Device):
    """A device of the laboratory, made from its part, or the instruments.

    It publishes what the catalogue gives it. It takes its settings as parameters, and its setpoints also by topic.
    """

    def __init__(self, name: str, rig: Rig, commands: Commands) -> None:
        super().__init__(name, rig, commands)
        for setpoint in setpoints_taken(rig.config):
            if setpoint.node == name:
                self._take(rig, setpoint)
        if rig.settings.at(name):
            self.settings = DeviceSettings(self, rig, commands)

    def _take(self, rig: Rig, setpoint: Setpoint) -> None:
        """Subscribe to a setpoint; in the safe state the device that drives the rig can only be switched off."""
        topic = self.catalogue.topics[setpoint.topic]

        def order(value: float, enable: bool) -> None:
            if enable and rig.refuses_drive(setpoint):
                raise RigError(f"refused: the rig is in its safe state ({rig.reason}); call /rig/reset first")
            rig.set(setpoint.step, value, enable)

        def enqueue(message: np.void) -> None:
            self.commands.put(topic.name, order, float(message["value"]), bool(message["enable"]))

        self.inputs[topic.name] = receive(self, topic, enqueue, refuse=self.commands.refuse)
