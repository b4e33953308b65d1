# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The gate that holds back the first messages until their receivers are connected: the rig's own, and users' listeners.

Every process of the graph uses it before it publishes.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from .qos import beyond

if TYPE_CHECKING:
    from collections.abc import Collection

    from rclpy.node import Node

    from .process import Process

# s from the begin of ROS in which other programs on this host have announced themselves, as they do every 3 s; the same where
# their number is not known; s without a new listener after which all are found; s after which none is waited for
FIND, FIND_UNKNOWN, QUIET, SETTLE = 3.2, 1.0, 0.3, 3.0


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


def meet(process: Process, node: Node, publishers: dict, own: Collection[str]) -> list[str]:
    """Wait, within bounds, until the publishers are connected with every subscription of users' nodes that is there.

    People are told how many are connected and which were not waited for. Where no other program was in the domain before the
    run, it takes no time.

    Parameters
    ----------
    process : Process
        The process that publishes.
    node : Node
        One of its nodes.
    publishers : dict of str to Publisher
        Its publishers by topic.
    own : collection of str
        Names of the rig's nodes.

    Returns
    -------
    list of str
        Topics to which users' nodes listen.
    """
    began = changed = time.monotonic()
    before, awaited = None, process.arguments.others
    while True:
        there = {topic: node.get_subscriptions_info_by_topic(topic) for topic in publishers}
        others = [(topic, info) for topic, infos in there.items() for info in infos if info.node_name not in own]
        programs = {name for name in node.get_node_names() if name not in own}
        now = time.monotonic()
        if before != (len(others), programs):
            before, changed = (len(others), programs), now
        unfit, missing = [], []
        for topic in {topic: None for topic, _ in others}:
            asked = [(info.node_name, beyond(publishers[topic].qos_profile, info.qos_profile)) for info in there[topic]]
            unfit += [f"{name} on {topic}, which asks for {why}" for name, why in asked if why]
            if publishers[topic].get_subscription_count() < sum(not why for _, why in asked):
                missing.append(topic)
        known = now - process.ros_began >= (FIND_UNKNOWN if awaited is None else FIND)
        known = known or (awaited is not None and len(programs) >= awaited)
        if process.stopping or (known and not others and awaited == 0) or now - began >= FIND + SETTLE:
            break
        if known and now - changed >= QUIET and (not missing or now - changed >= SETTLE):
            break
        process.spin(0.02)
    if connected := len(others) - len(unfit):
        process.tell(
            f"{connected} subscriptions of other nodes to topics of {process.name}, {len(missing)} topics of them not connected"
        )
    for text in (*unfit, *(f"a listener to {topic}, which is not connected after {SETTLE:g} s" for topic in missing)):
        process.tell(f"not waited for, and receives nothing: {text}")
    return list({topic: None for topic, _ in others})
