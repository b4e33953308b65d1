# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Who listens already: the gate that lets no first message go out before its receivers are there.

Used by every process of the graph before it publishes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rclpy.node import Node


def silent(node: Node, publishers: dict, wanted: dict[str, set[str]]) -> list[str]:
    """Sentences on receivers that are missing. publishers: by topic; wanted: names of receiving nodes by topic."""
    missing = []
    for topic, publisher in publishers.items():
        names = wanted.get(topic, set())
        if not names:
            continue
        there = {info.node_name for info in node.get_subscriptions_info_by_topic(topic)}
        if names - there:
            missing.append(f"{', '.join(sorted(names - there))} does not listen to {topic}")
        elif publisher.get_subscription_count() < len(names):
            missing.append(f"{topic} is not connected yet")
    return missing
