# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The gate that holds back the first messages until their receivers are connected.

Every process of the graph uses it before it publishes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rclpy.node import Node


def silent(node: Node, publishers: dict, wanted: dict[str, set[str]]) -> list[str]:
    """Return sentences on receivers that are missing.

    Parameters
    ----------
    node : Node
        The node that publishes.
    publishers : dict of str to Publisher
        Its publishers by topic.
    wanted : dict of str to set of str
        Names of the receiving nodes by topic.

    Returns
    -------
    list of str
        One sentence for each topic that lacks a receiver.
    """
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
