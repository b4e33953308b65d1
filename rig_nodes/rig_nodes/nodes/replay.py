# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The node `rig_replay`: publishes a recorded bag again, byte by byte, with /clock, and serves what rosbag2's player serves.

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
from typing import Any

import rclpy
from rclpy.duration import Duration
from rclpy.exceptions import InvalidTopicNameException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from rclpy.validate_topic_name import validate_topic_name
from rosbag2_interfaces.srv import Burst, GetRate, IsPaused, Pause, Play, PlayNext, Resume, Seek, SetRate, Stop, TogglePaused
from rosgraph_msgs.msg import Clock

from ..bags import CLOCK, OpenedBags, Player, installed, offered_by, parse
from ..base import RigError
from ..rig import installed_topics
from .answering import answering
from .executor import events_executor
from .message_class import message_class
from .qos import publisher_profile
from .ros_arguments import set_parameters

NAME = "rig_replay"
CLOCK_TOPIC = "/clock"
HISTORY = 10_000  # messages of a latched topic that late receivers get
# Messages of a topic that may be unconfirmed. DDS tells only whether all are confirmed, so that this many have to be taken within
# PATIENCE before progress is seen; and the 100 ms between two heartbeats of the fastest topic are to fit.
WINDOW = 128
OPEN_BYTES = 64_000_000  # bytes of a topic that may be unconfirmed, for large messages
PATIENCE, GRACE = 5.0, 0.5  # s without progress after which a receiver is given up; s for which it is waited for after Ctrl-C
HELD = 1.0  # s without progress after which nothing more is sent of the topic, so that the next progress is seen
GLANCE = 0.1  # s between two checks for signals during that wait
_NOW, _GLANCE = Duration(), Duration(seconds=GLANCE)
LISTEN = 0.02  # s between two checks of services and keys
REPEAT = 0.1  # s between two /clock messages while paused, for subscribers that come in the meantime
# s that discovery takes at least; s without a new receiver after which all are connected; s after which none is waited for
FIND, QUIET, SETTLE = 1.0, 0.4, 3.0
RATES = 0.01, 100.0  # recorded seconds per second; beside these inf, as fast as it goes
FASTER, SLOWER = 1.1, 0.9  # factors of the keys for the rate, those of rosbag2
_CLOCK = struct.Struct("<4siI")
_BIN = 1e-4  # s, resolution of the lateness


@dataclass
class Outcome:
    """Result of a replay: messages by topic, seconds of playing, lateness in steps of 0.1 ms, and the signal that ended it.

    ``given_up`` is True when a receiver was no longer waited for, which may have lost messages.
    """

    counts: dict[str, int]
    seconds: float = 0.0  # without pauses
    lateness: Counter = field(default_factory=Counter)
    ended_by: int = 0  # signal, or 0
    given_up: bool = False

    def late(self, share: float) -> float:
        """Return the lateness [s] that a share (0 to 1) of the messages did not exceed."""
        left = share * sum(self.lateness.values())
        for step, count in sorted(self.lateness.items()):
            left -= count
            if left <= 0:
                return step * _BIN
        return 0.0


def offered(bag: OpenedBags, topic: str, fields: Mapping[str, Any] | None = None) -> QoSProfile:
    """Return the profile with which a topic is offered: the one of the catalogue, else the recorded one.

    A latched topic keeps as many messages as the bag holds of it, so that late receivers get all of them once.

    Parameters
    ----------
    bag : OpenedBags
        The bag.
    topic : str
        Name of a topic in it.
    fields : mapping of str to Any, optional
        Attributes of the profile that are to have other values.

    Returns
    -------
    QoSProfile
        Quality of service of the publisher.
    """
    known = installed_topics().get(topic)
    if known is not None:
        profile = publisher_profile(known.qos)
    else:
        recorded = offered_by(bag.channel(topic)[2].get("offered_qos_profiles", ""))
        profile = publisher_profile("latched" if recorded.latched else "measurement")
        if not recorded.reliable:
            profile.reliability = ReliabilityPolicy.BEST_EFFORT
        if recorded.deadline_ns:
            profile.deadline = Duration(nanoseconds=recorded.deadline_ns)
    for name, value in (fields or {}).items():
        setattr(profile, name, value)
    if fields and fields.get("depth"):
        return profile
    # a full history asks at once for receipts, which come with the next heartbeat otherwise
    profile.depth = min(HISTORY, max(1, bag.counts[topic])) if latched(profile) else WINDOW
    return profile


def latched(profile: QoSProfile) -> bool:
    """Return True when late receivers get what was sent before."""
    return profile.durability == DurabilityPolicy.TRANSIENT_LOCAL


def obstacle(bag: OpenedBags, topic: str) -> str:
    """Return why a topic of a bag cannot be published, empty when it can."""
    ros_type = bag.types[topic]
    encoding, text, _ = bag.channel(topic)
    if bag.topic_of(topic) != topic:
        return "the topic has another type beside this one"
    if topic == CLOCK_TOPIC:
        return "the replay has a clock of its own"
    if not encoding.startswith("cdr/"):
        return f"it is encoded as {encoding.partition('/')[0] or 'nothing'}, not as ROS 2 messages are"
    if not ros_type:
        return "the bag names no type of its messages"
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

    def __init__(self, node: Node, message_type: type, topic: str, profile: QoSProfile, session: ReplaySession) -> None:
        if profile.history == HistoryPolicy.KEEP_ALL:  # which would let a receiver that is given up stop the replay
            profile.history, profile.depth = HistoryPolicy.KEEP_LAST, WINDOW
        self.publisher = node.create_publisher(message_type, topic, profile)
        self.topic, self.session = topic, session
        self.count = 0
        self._window = min(WINDOW, profile.depth)
        self._open = self._open_bytes = 0  # messages and bytes sent since everything was confirmed
        self._since = 0.0  # time of the monotonic clock at which the first of them was sent [s]
        self._given_up = False

    def send(self, data: bytes) -> None:
        """Publish the stored bytes of a message."""
        if self._open and self.publisher.wait_for_all_acked(_NOW):
            self._confirmed()
        if not self._open:
            self._since = time.monotonic()
        self.publisher.publish(data)
        self.count += 1
        self._open += 1
        self._open_bytes += len(data)
        if self._open >= self._window or self._open_bytes >= OPEN_BYTES or time.monotonic() - self._since >= HELD:
            self.confirm()

    def confirm(self) -> None:
        """Wait until all receivers have what was sent; give up one that has made no progress for PATIENCE seconds, and report it.

        A topic with a receiver that is given up is not waited for until everything is confirmed again.
        """
        if not self._open or self._given_up or time.monotonic() >= self.session.out_of_time:
            return
        while not self.publisher.wait_for_all_acked(_GLANCE):
            now = time.monotonic()
            if now >= self.session.out_of_time:
                return
            if now >= self._since + PATIENCE:
                self._given_up = self.session.given_up = True
                self.session.say(f"a receiver of {self.topic} took too little in {PATIENCE:g} s: it is given up and may lose some")
                return
        self._confirmed()

    def _confirmed(self) -> None:
        self._open = self._open_bytes = 0
        self._given_up = False


class Replay(Node):
    """The node that publishes the messages that a player gives as due, and serves what rosbag2's player serves.

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

    def __init__(self, bag: OpenedBags, topics: Sequence[str], player: Player, session: ReplaySession) -> None:
        super().__init__(NAME, enable_rosout=False)
        self.player, self.say, self._session = player, session.say, session
        self.outputs = {}
        for topic in topics:
            kind, profile = message_class(bag.types[topic]), offered(bag, topic, session.profiles.get(topic))
            self.outputs[topic] = Output(self, kind, session.names.get(topic, topic), profile, session)
        self.clock = Output(self, Clock, CLOCK_TOPIC, QoSProfile(depth=WINDOW), session)
        self._repeat_at = 0.0
        self.outcome = Outcome({})
        self._bag = bag

    def serve(self) -> None:
        """Offer the services, by the names and types of rosbag2_interfaces."""
        for kind, name, answer in (
            (Pause, "pause", lambda _: self.pause()),
            (Resume, "resume", lambda _: self.resume()),
            (TogglePaused, "toggle_paused", lambda _: self.toggle()),
            (IsPaused, "is_paused", lambda _: {"paused": self.player.paused}),
            (GetRate, "get_rate", lambda _: {"rate": float(self.player.rate)}),
            (SetRate, "set_rate", lambda asked: {"success": self.set_rate(asked.rate)}),
            (PlayNext, "play_next", lambda _: {"success": self.burst(1) == 1}),
            (Burst, "burst", lambda asked: {"actually_burst": self.burst(asked.num_messages or math.inf)}),
            (Seek, "seek", lambda asked: {"success": self.seek(_nanoseconds(asked.time))}),
            (Play, "play", lambda asked: {"success": self.play(asked)}),
            (Stop, "stop", lambda _: self.stop()),
        ):
            self.create_service(kind, f"~/{name}", answering(answer))

    def pause(self) -> None:
        """Pause the replay where it is."""
        self.player.pause()
        self._tell("paused")

    def resume(self) -> None:
        """Continue the replay."""
        self.player.resume(time.monotonic())
        self._tell("going on")

    def toggle(self) -> None:
        """Pause, or continue after a pause."""
        self.resume() if self.player.paused else self.pause()

    def set_rate(self, rate: float) -> bool:
        """Go on at another rate; return False, and change nothing, for one that the replay does not have."""
        if not (RATES[0] <= rate <= RATES[1] or rate == math.inf):
            self.say(f"rate {rate:g} is refused: give {RATES[0]:g} to {RATES[1]:g}, or infinity for as fast as it goes")
            return False
        self.player.rate = rate
        self.say(f"rate {'max' if math.isinf(rate) else f'{rate:.3g}'}")
        return True

    def change_rate(self, factor: float) -> None:
        """Multiply the rate, within the rates that the replay has."""
        if not math.isinf(self.player.rate):
            self.set_rate(min(max(self.player.rate * factor, RATES[0]), RATES[1]))

    def burst(self, count: float) -> int:
        """Publish the next messages of this pass at once, during a pause; return how many were published."""
        player = self.player
        if not player.paused:
            return 0
        self.play_due()  # what holds where a jump led to is no next message
        before = self.sent
        while self.sent - before < count and not self._session.over:
            if player.finished or (math.isinf(count) and player.pass_over):
                break
            player.play_next()
            self.play_due()
        return self.sent - before

    def seek(self, at: int) -> bool:
        """Go on at a recorded time [ns], or stay paused there; return False, and change nothing, when the bag does not have it."""
        if not self._bag.first <= at <= self._bag.last:
            self._refuse(at)
            return False
        self.player.seek(at)
        self._tell("jumped")
        return True

    def play(self, asked: Play.Request) -> bool:
        """Play a part of the bag after a pause; return False, and change nothing, when it plays or the bag has no such part."""
        first, end = self._bag.first + _nanoseconds(asked.start_offset), self._bag.last + 1
        if not self.player.paused:
            return False
        if not self._bag.first <= first <= self._bag.last:
            self._refuse(first)
            return False
        # of two ends the earlier one counts, as on the command line; what is 0 or negative is no end
        if (length := _nanoseconds(asked.playback_duration)) > 0:
            end = min(end, first + length)
        if (until := _nanoseconds(asked.playback_until_timestamp)) > 0:
            end = min(end, until)
        self.player.play(first, end, time.monotonic())
        self._tell("going on")
        return True

    def stop(self) -> None:
        """End the replay."""
        self._session.stop()
        self._tell("stopped")

    @property
    def sent(self) -> int:
        """Messages published so far."""
        return sum(output.count for output in self.outputs.values())

    def _tell(self, what: str) -> None:
        self.say(f"{what} at {self.player.clock / 1e9:.3f} s")

    def _refuse(self, at: int) -> None:
        self.say(f"{at / 1e9:.3f} s is refused: the bag goes from {self._bag.first / 1e9:.3f} s to {self._bag.last / 1e9:.3f} s")

    def play_due(self) -> None:
        """Publish what is due now."""
        player, outputs, lateness = self.player, self.outputs, self.outcome.lateness
        for message, recorded in player.take(time.monotonic()):
            if message is CLOCK:
                self.publish_time(recorded)
                continue
            lateness[int(player.lateness(recorded, time.monotonic()) / _BIN)] += 1
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
        """Wait until every receiver has everything, or has made no progress for PATIENCE seconds."""
        for output in (*self.outputs.values(), self.clock):
            output.confirm()

    def receivers(self) -> int:
        """Return how many subscriptions of the bag's topics are connected."""
        return sum(output.publisher.get_subscription_count() for output in self.outputs.values())

    def unconnected(self) -> list[str]:
        """Return the topics with a receiver that is seen but not connected, because it requires another quality of service."""
        return [
            output.topic
            for output in self.outputs.values()
            if self.count_subscribers(output.topic) > output.publisher.get_subscription_count()
        ]


def _nanoseconds(time: Any) -> int:
    """Return a builtin_interfaces Time or Duration in nanoseconds."""
    return time.sec * 1_000_000_000 + time.nanosec


class ReplaySession:
    """One replay from beginning to end: it meets the receivers, plays, and handles signals and keys.

    Parameters
    ----------
    say : callable
        Prints a sentence.
    keys : callable
        Returns what was pressed since the last call: a space pauses and resumes, a right arrow plays the next message, arrows
        up and down change the rate, q ends.
    names : mapping of str to str, optional
        Topics to publish under another name.
    delay : float
        Time between the connection of the receivers and the first message [s].
    profiles : mapping of str to mapping, optional
        By topic, attributes of its QoSProfile that are to have other values.
    """

    def __init__(
        self,
        say: Callable[[str], None],
        keys: Callable[[], str],
        names: Mapping[str, str] | None = None,
        delay: float = 0.0,
        profiles: Mapping[str, Mapping[str, Any]] | None = None,
    ) -> None:
        """Keep what is given."""
        self.say, self.keys, self.names, self.delay, self.profiles = say, keys, names or {}, delay, profiles or {}
        self.ended_by = 0
        self.given_up = False  # True when a receiver was waited for in vain
        self.out_of_time = math.inf  # time after which not even receipts are waited for
        self.over = False
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
                outcome = node.outcome
                self._meet(node, wait)
                self._play(node)
                node.confirm()
            finally:
                self._executor.remove_node(node)
                node.destroy_node()
                rclpy.shutdown()
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)
        outcome.counts = {topic: output.count for topic, output in node.outputs.items()}
        outcome.ended_by, outcome.given_up = self.ended_by, self.given_up
        return outcome

    def stop(self) -> None:
        """End the replay after what is being sent."""
        self.over = True

    def _on_signal(self, number: int, _frame: object) -> None:
        self.ended_by, self.over = number, True
        self.out_of_time = min(self.out_of_time, time.monotonic() + GRACE)

    def _meet(self, node: Replay, wait: int) -> None:
        """Connect with all present subscriptions, and wait for ``wait`` of them however long that takes."""
        began = changed = time.monotonic()
        known = node.receivers()
        wait_reported = False
        while not self.over:
            self._listen(node, LISTEN)
            now, before = time.monotonic(), known
            known = node.receivers()
            if known != before:
                changed = now
            missing = node.unconnected()
            if known < wait:
                if not wait_reported and now - began > QUIET:
                    self.say(f"waiting for {wait} subscriptions")
                    wait_reported = True
            elif now - began >= FIND and now - changed >= QUIET and (not missing or now - began > SETTLE):
                for topic in missing:
                    self.say(f"a receiver of {topic} requires another quality of service and receives nothing")
                break
        node.refuse_second_clock()
        self.say(f"{known} subscriptions are connected")
        begin = time.monotonic() + self.delay
        while not self.over and (left := begin - time.monotonic()) > 0.0:
            self._listen(node, min(left, LISTEN))

    def _play(self, node: Replay) -> None:
        player, outcome = node.player, node.outcome
        node.serve()
        if player.paused:
            node.pause()
        listened = last = time.monotonic()
        while not self.over and not player.finished:
            paused = player.paused
            node.play_due()
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
                node.toggle()
            elif key == "→":
                node.burst(1)
            elif key in "↑↓":
                node.change_rate(FASTER if key == "↑" else SLOWER)
            elif key == "q":
                self.over = True
