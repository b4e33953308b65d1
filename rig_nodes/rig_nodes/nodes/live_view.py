# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The node of the live view: it receives what a running rig publishes and gives it to a bounded sender.

`rig view --live` uses it as a separate process beside the rig. It subscribes best effort and runs below the rig's priority, so
that neither the rig's publishers nor its clock ever wait for it.
"""

from __future__ import annotations

import json
import os
import signal
import time
from collections.abc import Callable, Mapping

import rclpy
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from rig_msgs.msg import RunInfo

from ..bags import UNREADABLE, rig_record
from ..base import RigError
from ..rig import QOS
from ..view import Pages, Sender, Server, live_topics
from .executor import events_executor
from .message_class import message_class

NICE = 10
RUN_INFO, STATE = "/rig/run_info", "/rig/state"
RECORD_PATIENCE = 3.0  # s after which a rig without a record of its structure is identified by its topics
LISTEN = 0.05  # s between two checks for other events
SILENT = 5.0  # s after which a message states that nothing is published
LAST_SEND = 0.8  # s for what is queued when the end is requested
LONGEST_END = 1.8  # s from the signal to the end by force


class LiveView(Node):
    """Finds out which rig runs, then subscribes to every topic that is shown; callbacks only enqueue.

    ``found`` is the record of what the rig is made of. It comes from the rig's run or, when no record arrives for a while, from the
    installed rig whose topics are most similar.
    """

    def __init__(self) -> None:
        super().__init__("live_view", enable_rosout=False, start_parameter_services=False)
        self.found: Mapping | None = None
        self.by_topics = False  # whether the rig was found without a record of it
        self.lack = "nothing is published"
        self._seen_at: float | None = None
        self._inputs: list = []
        kept = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._info = self.create_subscription(RunInfo, RUN_INFO, self._on_info, kept)

    def _on_info(self, message: RunInfo) -> None:
        try:
            content = json.loads(message.json)
            record = rig_record(content.get("configuration", content))
        except UNREADABLE:
            return  # not a record of this project's runs; its topics may still be of such a run
        if self.found is None or record["structure"] != self.found["structure"]:
            self.found, self.by_topics = record, False

    def look(self) -> None:
        """Find the rig by its topics when no record has arrived for RECORD_PATIENCE s."""
        if self.found is not None:
            return
        topics = {name for name, _ in self.get_topic_names_and_types()}
        if STATE not in topics:
            self._seen_at = None
        elif self._seen_at is None:
            self._seen_at = time.monotonic()
        elif time.monotonic() - self._seen_at > RECORD_PATIENCE:
            try:
                self.found = rig_record(None, topics)
                self.by_topics = True
            except UNREADABLE as error:
                self.lack = f"no record of the rig is published ({error})"
                self._seen_at = time.monotonic()  # more topics may come, or the record itself

    def show(self, sender: Sender, pages: Pages) -> None:
        """Subscribe to what is shown of a rig, in place of the earlier subscriptions."""
        # the others are latched, and a reliable reader of these could make a publisher send again
        profile = QoSProfile(depth=QOS["measurement"].depth, reliability=ReliabilityPolicy.BEST_EFFORT)
        for one in self._inputs:
            self.destroy_subscription(one)
        self._inputs = [
            self.create_subscription(
                message_class(topic.ros_type), topic.name, self._enqueue(sender, topic.name), profile, raw=True
            )
            for topic in live_topics(pages)
        ]

    @staticmethod
    def _enqueue(sender: Sender, topic: str) -> Callable[[bytes], None]:
        return lambda data: sender.put(topic, data)


class LiveSession:
    """One live view from the start of its server to its last message; SIGINT or SIGTERM ends it within two seconds."""

    def __init__(self, domain: int, say: Callable[[str], None]) -> None:
        self._domain, self._say, self._over = domain, say, False

    def run(self, port: int | None, window: float, greet: Callable[[str], None]) -> None:
        """Serve until the end.

        Parameters
        ----------
        port : int or None
            Port of the server.
        window : float
            Time that the view shows [s].
        greet : callable
            It gets the address for viewers, once.

        Raises
        ------
        RigError
            When the server or the sender fails.
        """
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._on_signal)
        os.nice(NICE)
        server = Server(port)
        try:
            greet(server.url)
            sender = self._receive(server, window)
            self._close(sender)
            if server.ended():
                raise RigError(f"the server of the live view ended ({server.last_words()}); start it again")
            if sender is not None and sender.failure:
                raise RigError(f"the live view failed: {sender.failure}; start it again")
        finally:
            server.close()

    def _on_signal(self, _number: int, _frame: object) -> None:
        if not self._over:
            self._over = True
            signal.setitimer(signal.ITIMER_REAL, LONGEST_END)  # SIGALRM without a handler ends the process

    def _close(self, sender: Sender | None) -> None:
        if sender is not None and not sender.close(LAST_SEND):
            self._say("what was queued at the end was not sent: the server did not take it")
        self._say(f"the live view ended: {'no rig was seen' if sender is None else sender.summary()}")

    def _receive(self, server: Server, window: float) -> Sender | None:
        """Send what arrives until the end; return the sender of the last rig that was seen."""
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        executor = events_executor()
        node, sender, shown = LiveView(), None, None
        executor.add_node(node)
        silent_at = time.monotonic() + SILENT
        try:
            while not self._over and not server.ended() and not (sender and sender.failure):
                executor.spin_until_future_complete(Future(), LISTEN)
                node.look()
                if node.found is not shown:
                    if sender is not None:
                        self._close(sender)
                    shown, pages = node.found, Pages(node.found)
                    if node.by_topics:
                        like = f"the installed rig '{shown['name']}', whose topics are most like its own"
                        self._say(f"no record of the rig is published, and it is shown as {like}")
                    sender = Sender(server.url, f"ROS domain {self._domain}", pages, window)
                    node.show(sender, pages)
                    silent_at = time.monotonic() + SILENT
                if sender is not None and sender.received:
                    silent_at = float("inf")
                elif time.monotonic() > silent_at:
                    self._say(f"{node.lack} in ROS domain {self._domain} so far; waiting")
                    silent_at = float("inf")
        finally:
            executor.remove_node(node)
            node.destroy_node()
            rclpy.shutdown()
        return sender
