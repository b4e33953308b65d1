# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Topics of the ROS domain beyond the catalogue, as the recorder finds them: of users' nodes, /rosout, /diagnostics.

Used by the recorder. Types are those whose Python package can be imported here; any other topic is named once.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy

from ..bags.definitions import installed
from ..errors import RigError
from ..graph.topic_choice import TopicChoice
from .message_class import message_class
from .qos import recorder_profile

LOOK = 0.2  # s between two looks for topics that have appeared


class OtherTopics:
    """Subscribes to topics as they appear. ``unrecorded``: topics that nobody can record here, with the reason."""

    def __init__(self, node: Node, known: set[str], choice: TopicChoice, take: Callable) -> None:
        """known: topics that are recorded already; take(topic, type, class): gives the callback of a topic."""
        self.unrecorded: dict[str, str] = {}
        self._node, self._known, self._choice, self._take = node, set(known), choice, take
        self._look_at = 0.0
        self._subscriptions = []

    def look(self) -> None:
        """Take what has appeared since the last look; does nothing when that was just now."""
        if time.monotonic() < self._look_at:
            return
        self._look_at = time.monotonic() + LOOK
        for name, types in self._node.get_topic_names_and_types():
            if name in self._known or not self._choice.takes(name):
                continue
            offers = self._node.get_publishers_info_by_topic(name)
            if not offers:
                continue  # only somebody who listens
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
        """As the publishers that are there offer it: what one of them does not offer must not be asked for."""
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
