# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The node of the live view: receives what a running rig publishes and hands it to a bounded sender.

Used by `rig view --live`, as a process of its own beside the rig. It subscribes best effort and runs below
the rig's priority, so that neither the rig's publishers nor its clock ever wait for it.
"""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable

import rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from ..catalogue import QOS
from ..errors import RigError
from ..view.live import Sender, Server, live_topics
from .executor import events_executor
from .message_class import message_class

NICE = 10
LISTEN = 0.05     # s between two looks at what else happens
SILENT = 5.0      # s after which people are told that nobody publishes
LAST_SEND = 0.8   # s for what is queued when the end is asked for
LONGEST_END = 1.8  # s from the signal to the end by force


class LiveView(Node):
    """Subscribes to every topic that is shown; callbacks only enqueue."""

    def __init__(self, sender: Sender):
        super().__init__("live_view", enable_rosout=False, start_parameter_services=False)
        # latched topics are none of these, and a reliable reader could make a publisher send again
        profile = QoSProfile(depth=QOS["measurement"].depth, reliability=ReliabilityPolicy.BEST_EFFORT)
        self.inputs = [self.create_subscription(message_class(topic.ros_type), topic.name,
                                                self._enqueue(sender, topic.name), profile, raw=True)
                       for topic in live_topics()]

    @staticmethod
    def _enqueue(sender: Sender, topic: str):
        return lambda data: sender.put(topic, data)


class Session:
    """One live view from its server to its last sentence, ended by SIGINT or SIGTERM within two seconds."""

    def __init__(self, domain: int, say: Callable[[str], None]):
        self._domain, self._say, self._over = domain, say, False

    def run(self, port: int | None, window: float, greet: Callable[[str], None]) -> None:
        """Serve until ended. greet: gets the address for viewers, once. RigError when the server fails."""
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._on_signal)
        os.nice(NICE)
        server = Server(port)
        try:
            greet(server.url)
            sender = Sender(server.url, f"ROS domain {self._domain}", window)
            self._receive(sender, server)
            if not sender.close(LAST_SEND):
                self._say("what was queued at the end was not sent: the server did not take it")
            self._say(f"the live view ended: {sender.summary()}")
            if server.ended():
                raise RigError(f"the server of the live view ended ({server.last_words()}); start it again")
            if sender.failure:
                raise RigError(f"the live view failed: {sender.failure}; start it again")
        finally:
            server.close()

    def _on_signal(self, _number, _frame) -> None:
        if not self._over:
            self._over = True
            signal.setitimer(signal.ITIMER_REAL, LONGEST_END)  # SIGALRM without a handler ends the process

    def _receive(self, sender: Sender, server: Server) -> None:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        executor = events_executor()
        node = LiveView(sender)
        executor.add_node(node)
        silent_at = time.monotonic() + SILENT
        try:
            while not self._over and not server.ended() and not sender.failure:
                executor.spin_until_future_complete(Future(), LISTEN)
                if sender.received:
                    silent_at = float("inf")
                elif time.monotonic() > silent_at:
                    self._say(f"nothing is published in ROS domain {self._domain} so far; waiting")
                    silent_at = float("inf")
        finally:
            executor.remove_node(node)
            node.destroy_node()
            rclpy.shutdown()
