# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The recorder's subscriptions to one topic: one for each quality of service in which it is offered, without doubling messages.

A subscription that asks for no more than the weakest offer would lose what only the stronger ones give: confirmed
messages, and those from before it came. The recorder uses it for the rig's own topics and for users' topics.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, NamedTuple

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from .message_class import message_class
from .qos import recorder_profile

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from rclpy.node import Node
    from rclpy.subscription import Subscription

TOGETHER = 2.0  # s within which the copies of one message come by several subscriptions
REMEMBERED = 5000  # messages of one topic from which on those that are older than that are forgotten
ENDS = 4096  # bytes of a message's begin and end that tell it from others of its length


class Quality(NamedTuple):
    """What decides whether publisher and subscription are connected; neither asks for deadlines or manual liveliness here."""

    reliable: bool
    latched: bool

    @classmethod
    def of(cls, profile: QoSProfile) -> Quality:
        """Return the quality of a profile; what is no known policy counts as the weaker one."""
        return cls(profile.reliability == ReliabilityPolicy.RELIABLE, profile.durability == DurabilityPolicy.TRANSIENT_LOCAL)

    def connects(self, offered: Quality) -> bool:
        """Return whether a subscription that asks for this receives what is offered so."""
        return self.reliable <= offered.reliable and self.latched <= offered.latched


class Receivers:
    """The subscriptions to one topic.

    Parameters
    ----------
    node : Node
        The node that subscribes.
    topic : str
        Name of the topic.
    ros_type : str
        Its type.
    take : callable
        Receives each message once, as bytes.
    unfit : callable
        Called when a publisher appears that none of the subscriptions receives.
    first : QoSProfile, optional
        Profile of a first subscription. Later ones then only ask for less, never for messages from before they came.
    """

    def __init__(
        self,
        node: Node,
        topic: str,
        ros_type: str,
        take: Callable[[bytes], None],
        unfit: Callable[[], None],
        first: QoSProfile | None = None,
    ) -> None:
        self._node, self._topic, self._class, self._take, self._unfit = node, topic, message_class(ros_type), take, unfit
        self._fixed = first is not None
        self._of: dict[Quality, Subscription] = {}
        # message -> times that it came, by subscription; the first is how often it was taken, the last one when it came [s]
        self._seen: dict[tuple[int, int, int], list[float]] = {}
        self._most = REMEMBERED  # number of them at which old ones are forgotten
        if first is not None:
            self._add(Quality.of(first), first)

    def follow(self, offers: Iterable[QoSProfile]) -> None:
        """Subscribe to what present publishers offer and no subscription brings in full."""
        for offered in {Quality.of(offer) for offer in offers}:
            if offered in self._of or (self._fixed and any(there.connects(offered) for there in self._of)):
                continue
            profile = recorder_profile("latched" if offered.latched else "measurement")
            if not offered.reliable:
                profile.reliability = ReliabilityPolicy.BEST_EFFORT
            self._add(offered, profile)

    def publishers(self) -> int:
        """Return how many publishers are connected; one that several subscriptions receive counts for each of them."""
        return sum(subscription.get_publisher_count() for subscription in self._of.values())

    def _add(self, quality: Quality, profile: QoSProfile) -> None:
        place = 1 + len(self._of)

        def on_message(data: bytes) -> None:
            if (self._fixed and len(self._of) == 1) or self._is_new(place, data):
                self._take(data)

        self._of[quality] = self._node.create_subscription(
            self._class,
            self._topic,
            on_message,
            profile,
            raw=True,
            event_callbacks=SubscriptionEventCallbacks(incompatible_qos=lambda _: self._unfit()),
        )

    def _is_new(self, place: int, data: bytes) -> bool:
        """Return whether a message has come by this subscription more often than it was taken so far."""
        key, now = (len(data), hash(data[:ENDS]), hash(data[-ENDS:])), time.monotonic()
        if len(self._seen) >= self._most:
            self._seen = {known: times for known, times in self._seen.items() if now - times[-1] < TOGETHER}
            self._most = max(REMEMBERED, 2 * len(self._seen))
        times = self._seen.pop(key, None)
        if times is None or now - times[-1] >= TOGETHER:
            times = [0.0, now]
        times[-1:] = [0.0] * (place + 1 - len(times[:-1])) + [now]
        times[place] += 1
        self._seen[key] = times
        if times[place] <= times[0]:
            return False
        times[0] = times[place]
        return True
