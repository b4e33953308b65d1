# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Topics of the ROS domain that are not in the catalogue: those of users' nodes, /rosout, /diagnostics.

The recorder uses it. It takes the types whose Python package can be imported here; it names any other topic once.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy

from ..bags.definitions import installed
from ..errors import RigError
from ..graph.recording_options import TopicChoice
from .message_class import message_class
from .qos import recorder_profile

LOOK = 0.2  # s between two looks for topics that have appeared


class OtherTopics:
    """Subscribes to topics as they appear; ``unrecorded`` has the topics that cannot be recorded here, with the reason."""

    def __init__(self, node: Node, known: set[str], choice: TopicChoice, take: Callable) -> None:
        """Leave out the ``known`` topics, which are recorded already; ``take`` (topic, type, class) makes a topic's callback."""
        self.unrecorded: dict[str, str] = {}
        self._node, self._known, self._choice, self._take = node, set(known), choice, take
        self._look_at = 0.0
        self._subscriptions = []

    def look(self) -> None:
        """Subscribe to what has appeared since the last look; do nothing if that was less than LOOK s ago."""
        if time.monotonic() < self._look_at:
            return
        self._look_at = time.monotonic() + LOOK
        for name, types in self._node.get_topic_names_and_types():
            if name in self._known or not self._choice.takes(name):
                continue
            offers = self._node.get_publishers_info_by_topic(name)
            if not offers:
                continue  # the topic has subscribers only
            self._known.add(name)
            try:
                if len(types) > 1:
                    raise RigError(f"is sent with several types: {', '.join(types)}")
                self._subscribe(name, types[0], [offer.qos_profile for offer in offers])
            except (RigError, ImportError, AttributeError, ValueError) as error:
                why = str(error) if isinstance(error, RigError) else f"its type {types[0]} cannot be loaded here ({error})"
                self.unrecorded[name] = why
                self._node.get_logger().warning(f"{name} is not recorded: {why}")

    def _subscribe(self, name: str, ros_type: str, offers: list) -> None:
        """Subscribe as the existing publishers offer the topic: what one of them does not offer must not be requested."""
        qos = "measurement"
        if any(offer.reliability == ReliabilityPolicy.BEST_EFFORT for offer in offers):
            qos = "best_effort"
        elif all(offer.durability == DurabilityPolicy.TRANSIENT_LOCAL for offer in offers):
            qos = "latched"
        installed(ros_type)
        self._subscriptions.append(
            self._node.create_subscription(
                message_class(ros_type), name, self._take(name, ros_type, qos), recorder_profile(qos), raw=True
            )
        )
