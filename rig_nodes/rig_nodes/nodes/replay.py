# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The node `rig_replay`: publishes a recorded bag again, byte by byte, with /clock.

Used by `rig replay`. Order and pace come from bags.player; one thread publishes, serves the services and
listens to keys, so that nothing overtakes a pause.
"""

from __future__ import annotations

import math
import signal
import struct
import sys
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import rclpy
from rclpy.duration import Duration
from rclpy.exceptions import InvalidTopicNameException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from rclpy.validate_topic_name import validate_topic_name
from rosgraph_msgs.msg import Clock
from std_srvs.srv import Trigger

from ..bags.definitions import installed, parse
from ..bags.metadata import read_profile
from ..bags.opened import OpenedBags
from ..bags.player import CLOCK, Player
from ..catalogue import installed_topics
from ..errors import RigError
from .executor import events_executor
from .message_class import message_class
from .qos import publisher_profile
from .ros_arguments import set_parameters

NAME = "rig_replay"
CLOCK_TOPIC = "/clock"
HISTORY = 10_000  # messages of a topic that may be unconfirmed: one second of the fastest topic at ten times real time
OPEN_BYTES = 64_000_000  # bytes of a topic that may be unconfirmed, for large messages
PATIENCE, GRACE = 5.0, 0.5  # s that receivers may take to confirm; the same after Ctrl-C
LEASE = 20.0  # s for which DDS keeps a receiver that was killed
GLANCE = 0.1  # s between two checks for signals during that wait
LISTEN = 0.02  # s between two checks of services and keys
REPEAT = 0.1  # s between two /clock messages while paused, for subscribers that come in the meantime
# s that discovery takes at least; s without a new receiver after which all are connected; s after which none is waited for
FIND, QUIET, SETTLE = 1.0, 0.4, 3.0
_CLOCK = struct.Struct("<4siI")
_BIN = 1e-4  # s, resolution of the lateness


@dataclass
class Outcome:
    """Result of a replay: messages by topic, seconds of playing, lateness in steps of 0.1 ms, and the signal that ended it."""

    counts: dict[str, int]
    seconds: float = 0.0  # without pauses
    lateness: Counter = field(default_factory=Counter)
    ended_by: int = 0  # signal, or 0

    def late(self, share: float) -> float:
        """Return the lateness [s] that a share (0 to 1) of the messages did not exceed."""
        left = share * sum(self.lateness.values())
        for step, count in sorted(self.lateness.items()):
            left -= count
            if left <= 0:
                return step * _BIN
        return 0.0


def offered(bag: OpenedBags, topic: str) -> QoSProfile:
    """Return the profile with which a topic is offered: the one of the catalogue, else the recorded one.

    A latched topic keeps as many messages as the bag holds of it, so that late receivers get all of them once.

    Parameters
    ----------
    bag : OpenedBags
        The bag.
    topic : str
        Name of a topic in it.

    Returns
    -------
    QoSProfile
        Quality of service of the publisher.
    """
    known = installed_topics().get(topic)
    if known is not None:
        profile = publisher_profile(known.qos)
    else:
        recorded = read_profile(bag.channel(topic)[2].get("offered_qos_profiles", ""))
        profile = publisher_profile("latched" if recorded.latched else "measurement")
        if not recorded.reliable:
            profile.reliability = ReliabilityPolicy.BEST_EFFORT
        if recorded.deadline_ns:
            profile.deadline = Duration(nanoseconds=recorded.deadline_ns)
    profile.depth = min(HISTORY, max(1, bag.counts[topic])) if latched(profile) else HISTORY
    return profile


def latched(profile: QoSProfile) -> bool:
    """Return True when late receivers get what was sent before."""
    return profile.durability == DurabilityPolicy.TRANSIENT_LOCAL


def obstacle(bag: OpenedBags, topic: str) -> str:
    """Return why a topic of a bag cannot be published, empty when it can."""
    ros_type = bag.types[topic]
    encoding, text, _ = bag.channel(topic)
    if topic == CLOCK_TOPIC:
        return "the replay has a clock of its own"
    if not encoding.startswith("cdr/"):
        return f"it is encoded as {encoding.partition('/')[0] or 'nothing'}, not as ROS 2 messages are"
    try:
        validate_topic_name(topic)
        message_class(ros_type)
    except InvalidTopicNameException:
        return "ROS 2 takes no such name"
    except (ImportError, AttributeError, ValueError):
        return f"the message type {ros_type} is not installed here"
    if encoding == "cdr/ros2msg" and _another_version(ros_type, text):
        return f"the bag holds another version of {ros_type} than is installed here"
    return ""


def _another_version(ros_type: str, text: str) -> bool:
    """Return True when the fields of a type differ from the installed ones, and False for types that cannot be compared."""
    try:
        return parse(ros_type, text).tree != installed(ros_type).tree
    except (RigError, KeyError):
        return False


class Output:
    """The publisher of one topic, which waits for receipts before the history could overflow.

    Parameters
    ----------
    node : Node
        The node that publishes.
    message_type : type
        Class of the messages.
    topic : str
        Name of the topic.
    profile : QoSProfile
        Quality of service.
    session : Session
        The replay, which limits how long receipts are waited for.
    """

    def __init__(self, node: Node, message_type: type, topic: str, profile: QoSProfile, session: Session) -> None:
        self.publisher = node.create_publisher(message_type, topic, profile)
        self.topic, self.session = topic, session
        self.count = 0
        self._window = max(1, 3 * profile.depth // 4)
        self._open = self._open_bytes = 0  # messages and bytes sent since everything was confirmed
        self._silent = False

    def send(self, data: bytes) -> None:
        """Publish the stored bytes of a message."""
        self.publisher.publish(data)
        self.count += 1
        self._open += 1
        self._open_bytes += len(data)
        if self._open >= self._window or self._open_bytes >= OPEN_BYTES:
            self.confirm(time.monotonic() + PATIENCE)

    def confirm(self, deadline: float) -> None:
        """Wait until all receivers have what was sent, at most until a time of the monotonic clock [s].

        A topic with a receiver that does not confirm is reported, and is waited for only once.
        """
        if not self._open:
            return
        self._open = self._open_bytes = 0
        if self._silent or time.monotonic() < self.session.hurry_until:
            deadline = 0.0
        glance = Duration(seconds=GLANCE if deadline else 0.0)
        while not (confirmed := self.publisher.wait_for_all_acked(glance)):
            if time.monotonic() >= min(deadline, self.session.out_of_time):
                break
        if confirmed:
            self._silent = False
        elif deadline and not self.session.ended_by:
            self._silent = True
            self.session.hurry_until = time.monotonic() + LEASE
            self.session.say(f"a receiver of {self.topic} does not confirm what it gets and may lose some")


class Replay(Node):
    """The node that publishes the messages that a player gives as due, and serves ~/pause, ~/resume and ~/step.

    Parameters
    ----------
    bag : OpenedBags
        The bag.
    topics : sequence of str
        Names of the topics that are published.
    player : Player
        Gives order and pace.
    session : Session
        The replay that this node belongs to.
    """

    def __init__(self, bag: OpenedBags, topics: Sequence[str], player: Player, session: Session) -> None:
        super().__init__(NAME, enable_rosout=False)
        self.player, self.say, self._session = player, session.say, session
        self.outputs = {}
        for topic in topics:
            kind, profile = message_class(bag.types[topic]), offered(bag, topic)
            self.outputs[topic] = Output(self, kind, session.names.get(topic, topic), profile, session)
        self.clock = Output(self, Clock, CLOCK_TOPIC, publisher_profile("measurement"), session)
        self._repeat_at = 0.0
        for name, action in (
            ("pause", self.pause),
            ("resume", self.resume),
            ("step", self.step),
            ("toggle_paused", self.toggle),
            ("is_paused", self.told_paused),
            ("stop", self.stop),
        ):
            self.create_service(Trigger, f"~/{name}", self._serve(action))

    def _serve(self, action: Callable[[], str]) -> Callable[[Trigger.Request, Trigger.Response], Trigger.Response]:
        def answer(_request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            response.message = action()
            response.success = not response.message.startswith("not ")
            return response

        return answer

    def pause(self) -> str:
        """Pause the replay where it is; return a sentence about it."""
        self.player.pause()
        return self._told("paused")

    def resume(self) -> str:
        """Continue the replay; return a sentence about it."""
        self.player.resume(time.monotonic())
        return self._told("going on")

    def step(self) -> str:
        """Publish all messages of the next recorded time; return a sentence about it."""
        return "one step" if self.player.step() else "not paused: pause before stepping"

    def toggle(self) -> str:
        """Pause, or continue after a pause; return a sentence about it."""
        return self.resume() if self.player.paused else self.pause()

    def told_paused(self) -> str:
        """Return whether the replay is paused, in a sentence that begins with "not" when it is not."""
        return "paused" if self.player.paused else "not paused"

    def stop(self) -> str:
        """End the replay; return a sentence about it."""
        self._session.stop()
        return self._told("stopped")

    def _told(self, what: str) -> str:
        text = f"{what} at {self.player.clock / 1e9:.3f} s"
        self.say(text)
        return text

    def play_due(self, outcome: Outcome) -> None:
        """Publish what is due now."""
        player, outputs = self.player, self.outputs
        for message, recorded in player.take(time.monotonic()):
            if message is CLOCK:
                self.publish_time(recorded)
                continue
            outcome.lateness[int(player.lateness(recorded, time.monotonic()) / _BIN)] += 1
            topic, data = message
            outputs[topic].send(data)

    def publish_time(self, recorded: int) -> None:
        """Publish a recorded time [ns] on /clock."""
        self.clock.send(_CLOCK.pack(b"\x00\x01\x00\x00", recorded // 1_000_000_000, recorded % 1_000_000_000))
        self._repeat_at = time.monotonic() + REPEAT

    def stand(self) -> None:
        """Repeat the clock every REPEAT seconds while the replay is paused."""
        if self.player.paused and time.monotonic() >= self._repeat_at:
            self.publish_time(self.player.clock)

    def refuse_second_clock(self) -> None:
        """Raise RigError when another node publishes /clock in this domain."""
        if self.count_publishers(CLOCK_TOPIC) > 1:
            raise RigError(
                "another node publishes /clock in this ROS domain, and there may be one only; "
                "end it, or replay without ROS_DOMAIN_ID in a domain of its own"
            )

    def confirm(self) -> None:
        """Wait until every receiver has everything, for PATIENCE seconds in all."""
        deadline = time.monotonic() + PATIENCE
        for output in (*self.outputs.values(), self.clock):
            output.confirm(deadline)

    def receivers(self) -> int:
        """Return how many subscriptions of the bag's topics are connected."""
        return sum(output.publisher.get_subscription_count() for output in self.outputs.values())

    def unconnected(self) -> list[str]:
        """Return the topics with a receiver that is seen but not connected, because it asks for another quality of service."""
        return [
            output.topic
            for output in self.outputs.values()
            if self.count_subscribers(output.topic) > output.publisher.get_subscription_count()
        ]


class Session:
    """One replay from beginning to end: it meets the receivers, plays, and handles signals and keys.

    Parameters
    ----------
    say : callable
        Prints a sentence.
    keys : callable
        Returns what was pressed since the last call; a space pauses and resumes, s steps, q ends.
    names : mapping of str to str, optional
        Topics to publish under another name.
    delay : float
        Time between the connection of the receivers and the first message [s].
    """

    def __init__(
        self, say: Callable[[str], None], keys: Callable[[], str], names: Mapping[str, str] | None = None, delay: float = 0.0
    ) -> None:
        """Keep what is given."""
        self.say, self.keys, self.names, self.delay = say, keys, names or {}, delay
        self.ended_by = 0
        self.hurry_until = 0.0  # set when a receiver was waited for in vain: no receiver is waited for until then
        self.out_of_time = math.inf  # time after which not even receipts are waited for
        self._over = False
        self._executor = None

    def run(self, bag: OpenedBags, topics: Sequence[str], player: Player, wait: int = 0) -> Outcome:
        """Replay a bag.

        Parameters
        ----------
        bag : OpenedBags
            The bag.
        topics : sequence of str
            Names of the topics that are published.
        player : Player
            Gives order and pace.
        wait : int
            Number of subscriptions that are waited for before the first message.

        Returns
        -------
        Outcome
            How the replay went.

        Raises
        ------
        RigError
            When another node publishes /clock in this domain.
        """
        before = {n: signal.signal(n, self._on_signal) for n in (signal.SIGINT, signal.SIGTERM)}
        try:
            rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
            self._executor = events_executor()
            node = Replay(bag, topics, player, self)
            set_parameters(sys.argv, [node], self.say)
            self._executor.add_node(node)
            try:
                outcome = Outcome({})
                self._meet(node, wait)
                self._play(node, outcome)
                node.confirm()
            finally:
                self._executor.remove_node(node)
                node.destroy_node()
                rclpy.shutdown()
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)
        outcome.counts = {topic: output.count for topic, output in node.outputs.items()}
        outcome.ended_by = self.ended_by
        return outcome

    def stop(self) -> None:
        """End the replay after what is being sent."""
        self._over = True

    def _on_signal(self, number: int, _frame: object) -> None:
        self.ended_by, self._over = number, True
        self.out_of_time = min(self.out_of_time, time.monotonic() + GRACE)

    def _meet(self, node: Replay, wait: int) -> None:
        """Connect with all present subscriptions, and wait for ``wait`` of them however long that takes."""
        began = changed = time.monotonic()
        known = node.receivers()
        waiting_told = False
        while not self._over:
            self._listen(node, LISTEN)
            now, before = time.monotonic(), known
            known = node.receivers()
            if known != before:
                changed = now
            missing = node.unconnected()
            if known < wait:
                if not waiting_told and now - began > QUIET:
                    self.say(f"waiting for {wait} subscriptions")
                    waiting_told = True
            elif now - began >= FIND and now - changed >= QUIET and (not missing or now - began > SETTLE):
                for topic in missing:
                    self.say(f"a receiver of {topic} asks for another quality of service and gets nothing")
                break
        node.refuse_second_clock()
        self.say(f"{known} subscriptions are connected")
        begin = time.monotonic() + self.delay
        while not self._over and (left := begin - time.monotonic()) > 0.0:
            self._listen(node, min(left, LISTEN))

    def _play(self, node: Replay, outcome: Outcome) -> None:
        player = node.player
        if player.paused:
            node.pause()
        listened = last = time.monotonic()
        while not self._over and not player.finished:
            paused = player.paused
            node.play_due(outcome)
            node.stand()
            wait = min(player.wait(time.monotonic()), LISTEN)
            now = time.monotonic()
            if wait > 0.0 or now - listened >= LISTEN:
                self._listen(node, wait)
                now = listened = time.monotonic()
                node.refuse_second_clock()  # a publisher whose first announcements were lost is seen only now
            if not paused:
                outcome.seconds += now - last
            last = now

    def _listen(self, node: Replay, seconds: float) -> None:
        """Serve the services for some seconds, and do what the pressed keys ask for."""
        self._executor.spin_until_future_complete(Future(), seconds)
        for key in self.keys():
            if key == " ":
                node.resume() if node.player.paused else node.pause()
            elif key == "s":
                node.step()
            elif key == "q":
                self._over = True
