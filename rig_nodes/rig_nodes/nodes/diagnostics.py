# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The health of the rig's processes on /diagnostics: one status per device, at 1 Hz and on change.

Rig container, alfa46, sequencer and recorder use it. The topic is not in the catalogue, because it depends on the wall clock and
the output of `simulate` must not.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import NamedTuple

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node

OK, WARN, ERROR, STALE = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR, DiagnosticStatus.STALE
HARDWARE = "virtual_rig"
PERIOD, LOOK = 1.0, 0.05  # s of wall time between messages without a change, and between looks for one
RECENT = 5.0  # s for which a loss is a warning


class Health(NamedTuple):
    """The health of one device: level, one sentence without numbers that always change, and the numbers."""

    device: str
    level: bytes
    message: str
    values: Callable[[], dict] = dict


class Diagnostics:
    """Publishes the result of ``health()``; the status of a device is named ``rig/<device>``, that of the whole rig ``rig``."""

    def __init__(self, node: Node, health: Callable[[], list[Health]], now_ns: Callable[[], int]) -> None:
        """Open the topic; ``now_ns`` returns the simulated time [ns], the stamp of the messages."""
        self._health, self._now_ns = health, now_ns
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._published_at, self._published, self._listeners = float("-inf"), [], 0
        self._timer = node.create_timer(LOOK, self.look)

    def look(self) -> None:
        """Publish when something has changed, a period has passed, or a new subscriber has come since the last look."""
        statuses, now = self._health(), time.monotonic()
        says = [status[:3] for status in statuses]
        before, self._listeners = self._listeners, self._publisher.get_subscription_count()
        if self._listeners <= before and says == self._published and now - self._published_at < PERIOD - LOOK / 2:
            return
        self._published, self._published_at = says, now
        seconds, rest = divmod(self._now_ns(), 1_000_000_000)
        message = DiagnosticArray(status=[to_ros(status) for status in statuses])
        message.header.stamp = Time(sec=seconds, nanosec=rest)
        self._publisher.publish(message)


def to_ros(health: Health) -> DiagnosticStatus:
    """Return the message of one status, with numbers of six digits."""
    values = [
        KeyValue(key=key, value=f"{value:.6g}" if isinstance(value, float) else str(value))
        for key, value in health.values().items()
    ]
    name = "rig" if health.device == "rig" else f"rig/{health.device}"
    return DiagnosticStatus(level=health.level, name=name, message=health.message, hardware_id=HARDWARE, values=values)


class Growing:
    """Called with a count, it returns True for a while after the count has grown."""

    def __init__(self) -> None:
        self._count, self._since = 0, float("-inf")

    def __call__(self, count: int) -> bool:
        """Return whether the count has grown within the last RECENT s."""
        if count != self._count:
            self._count, self._since = count, time.monotonic()
        return time.monotonic() - self._since < RECENT
