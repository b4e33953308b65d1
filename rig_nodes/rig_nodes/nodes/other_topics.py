# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Topics of the ROS domain that are not in the catalogue: those of users' nodes, /rosout, /diagnostics.

The recorder uses it. It takes the types whose Python package can be imported here; it names any other topic once.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from rclpy.node import Node
from rclpy.qos import QoSProfile

from ..bags import installed
from ..base import RigError
from .processes.recording_options import TopicChoice
from .receivers import Quality, Receivers

LOOK = 0.2  # s between two looks for topics that have appeared


class OtherTopics:
    """Subscribes to topics as they appear; ``unrecorded`` has what cannot be recorded here by topic, with the reason."""

    def __init__(self, node: Node, known: dict[str, Receivers | None], choice: TopicChoice, take: Callable) -> None:
        """Keep what is recorded already; ``take`` (topic, type, class) makes a topic's callback.

        ``known`` has the rig's own topics with their subscriptions, None for one that a tap brings.
        """
        self.unrecorded: dict[str, str] = {}
        self._node, self._choice, self._take = node, choice, take
        self._own, self._others = known, dict[str, Receivers]()
        self._types: dict[str, list[str]] = {}  # by topic, its types at the last look
        self._look_at = 0.0

    def look(self) -> None:
        """Subscribe to what has appeared since the last look; do nothing if that was less than LOOK s ago."""
        if time.monotonic() < self._look_at:
            return
        self._look_at = time.monotonic() + LOOK
        for name, types in self._node.get_topic_names_and_types():
            if not (name in self._own or self._choice.takes(name)):
                continue
            offers = self._node.get_publishers_info_by_topic(name)
            if not offers:
                continue  # the topic has subscribers only
            if name in self._own:
                self._follow_own(name, types, offers)
            elif name in self._others:
                self._others[name].follow([offer.qos_profile for offer in offers])
                self._look_at_types(name, types)
            elif name not in self.unrecorded:
                self._begin(name, types, offers)

    def look_soon(self) -> None:
        """Have the next look done at once."""
        self._look_at = 0.0

    def _begin(self, name: str, types: list[str], offers: list) -> None:
        try:
            if len(types) > 1:
                raise RigError(f"it is sent with several types: {', '.join(types)}")
            installed(types[0])
            profiles = [offer.qos_profile for offer in offers]
            take = self._take(name, types[0], _class_of(profiles))
            self._others[name] = Receivers(self._node, name, types[0], take, self.look_soon)
            self._others[name].follow(profiles)
            self._types[name] = types
        except (RigError, ImportError, AttributeError, ValueError) as error:
            why = str(error) if isinstance(error, RigError) else f"its type {types[0]} cannot be loaded here ({error})"
            self._leave_out(name, why)

    def _follow_own(self, name: str, types: list[str], offers: list) -> None:
        """Look whether users' nodes send a topic of the rig in a way that its recorder does not receive."""
        receivers = self._own[name]
        if receivers is not None:
            receivers.follow([offer.qos_profile for offer in offers])
            self._look_at_types(name, types)
        elif len(offers) > 1 and name not in self.unrecorded:
            nodes = ", ".join(sorted({offer.node_name for offer in offers}))
            self._leave_out(name, f"it is sent by {nodes}; in lockstep only the messages of the rig's own node are recorded")

    def _look_at_types(self, name: str, types: list[str]) -> None:
        """Name a topic that is sent with a second type too, which no subscription of the first one receives."""
        before = self._types.setdefault(name, types)
        if len(types) > len(before) and name not in self.unrecorded:
            other = ", ".join(one for one in types if one not in before)
            self._leave_out(name, f"it is sent with the type {other} too; only messages of type {before[0]} are recorded")

    def _leave_out(self, name: str, why: str) -> None:
        self.unrecorded[name] = why
        self._node.get_logger().warning(f"{name} is not recorded in full: {why}")


def _class_of(offers: list[QoSProfile]) -> str:
    """Return the class of catalogue.QOS that a topic has in the bag: what a replay may offer without promising too much."""
    qualities = [Quality.of(offer) for offer in offers]
    if not all(quality.reliable for quality in qualities):
        return "best_effort"
    return "latched" if all(quality.latched for quality in qualities) else "measurement"
