# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Other nodes that send /clock beside the rig: users' nodes with simulated time then see two times.

The rig container uses it.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from typing import TYPE_CHECKING

from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock

from ..base import printable
from .other_topics import LOOK
from .processes.recording_options import CLOCK

if TYPE_CHECKING:
    from rclpy.node import Node

DEPTH = 10  # messages
UNKNOWN = "_UNKNOWN_"  # in a name that rclpy gives where it does not know a node, or not yet


class OtherClocks:
    """Names each other node that sends /clock once; from the first one on it reads the topic and says by how much time jumps back.

    Parameters
    ----------
    node : Node
        The node that sends the rig's own /clock.
    say : callable
        It receives the sentences.

    Attributes
    ----------
    names : list of str
        The nodes.
    said : list of str
        The sentences.
    """

    def __init__(self, node: Node, say: Callable[[str], None]) -> None:
        """Begin without any."""
        self.names: list[str] = []
        self.said: list[str] = []
        self._node, self._say_to, self._look_at = node, say, 0.0
        self._newest, self._back = 0, 0  # ns: the newest time read, and the most by which time went back
        self._told = False
        self._seen: set[str] = set()  # nodes that were there at the newest look

    def look(self) -> None:
        """Name those that have appeared since the last look; do nothing if that was less than LOOK s ago."""
        if time.monotonic() < self._look_at:
            return
        self._look_at = time.monotonic() + LOOK
        own = _path(self._node.get_namespace(), self._node.get_name())
        there = Counter(_path(one.node_namespace, one.node_name) for one in self._node.get_publishers_info_by_topic(CLOCK))
        there[own] -= 1  # what is left of this name are other nodes that have it too
        for path in +there:
            name = f"another {path}" if path == own else "a program that is no node" if UNKNOWN in path else path
            if name not in self.names and (UNKNOWN not in path or path in self._seen):
                if not self.names:
                    profile = QoSProfile(depth=DEPTH, reliability=ReliabilityPolicy.BEST_EFFORT)  # takes every sender's
                    self._node.create_subscription(Clock, CLOCK, self._hear, profile)
                self.names.append(name)
                self._say(f"{CLOCK} is sent by {printable(name)} too: nodes with use_sim_time see two times")
        self._seen = set(there)
        if self._back and not self._told:
            self._told = True
            self._say(f"{CLOCK} jumps back by up to {self._back * 1e-9:.2f} s from one message to the next")

    def _hear(self, message: Clock) -> None:
        now = message.clock.sec * 1_000_000_000 + message.clock.nanosec
        self._back, self._newest = max(self._back, self._newest - now), now

    def _say(self, text: str) -> None:
        self.said.append(text)
        self._say_to(text)


def _path(namespace: str, name: str) -> str:
    """Return a node's name with its namespace, without the slash that all have."""
    return f"{namespace}/{name}".lstrip("/")
