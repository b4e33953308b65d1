# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The recorder: it writes every topic of a run's domain into an MCAP bag, unchanged, with simulated time as log time.

Started by nodes.processes.supervisor. Callbacks only enqueue; a thread writes and flushes. In lockstep, the messages of rig
container and alfa46 come through taps (nodes/processes/tap.py) and only the others through DDS. Topics that the catalogue does
not list are found while the run continues (nodes/other_topics.py), and their messages are stored at the simulated
time at which they arrived.
"""

from __future__ import annotations

import math
import selectors
import sys
import threading
import time
from collections import Counter, deque
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rclpy.node import Node
from rosbag2_interfaces.srv import IsPaused, Pause, Resume, Snapshot, SplitBagfile

from ..bags import LIBRARY_OF_RUN, STOPPED, BagRecording, BagWriter, cdr, installed
from ..base import RigError
from ..rig import Topic, installed_topics
from .answering import answering
from .diagnostics import ERROR, OK, WARN, Diagnostics, Growing, Health
from .other_topics import OtherTopics
from .process import RUN_OPTION, Process, ordered, run
from .processes.recording_options import OPTIONS as RECORDING_OPTIONS
from .processes.recording_options import TopicChoice, layout
from .processes.tap import TapReader
from .qos import recorder_profile
from .realtime import RECORDING, prefer_process, stand_back
from .receivers import Receivers

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable

FLUSH_PERIOD = 0.1  # s of messages that a killed recorder may lose
WAITING = 200_000  # messages between callbacks and writer, about 40 s of the rig
WAITING_BYTES = 256_000_000  # of messages there, and of those that come before the rig's time is known
AHEAD_NS = 1_000_000_000  # ns that a stamp may be ahead of the rig's own time
IDLE, IDLE_WITH_PUBLISHERS = 0.05, 1.0  # s without a message after which everything has arrived
ORDER = 0.5  # s in which the supervisor's word on the end has come with its signal
LONGEST_DRAIN = 5.0  # s that a user's node, which goes on sending, can put off the end
OPTIONS = [
    ("--out", {"type": Path, "required": True, "help": "folder of the bag"}),
    ("--name", {"required": True, "help": "name of the bag; its file is NAME_0.mcap"}),
    (
        "--piece",
        {
            "type": int,
            "default": 0,
            "metavar": "N",
            "help": "number of this piece of the bag, where another recorder began it (default: 0)",
        },
    ),
    RUN_OPTION,
    (
        "--rig",
        {
            "metavar": "NAME",
            "help": "record the topics of this rig only, by its name or file (default: those of every installed rig)",
        },
    ),
    (
        "--set",
        {
            "action": "append",
            "default": [],
            "dest": "settings",
            "metavar": "KEY=VALUE",
            "help": "settings of the rig: a device that is cut out has topics of its own",
        },
    ),
    ("--controller", {"metavar": "SPEC", "help": "the rig's controller, which may have signals of its own"}),
    *RECORDING_OPTIONS,
]


class Recorder(Node):
    """The node that subscribes to every topic of the run that no tap brings.

    Parameters
    ----------
    recording : Recording
        The way into the bag.
    taps : list of TapReader
        The taps, which have already sent the names of their topics.
    early : list of (str, bytes)
        Topics and messages that came together with those names.
    topics : dict of str to Topic
        The topics of the rig by name.
    wanted : set of str
        Names of the topics to subscribe to.
    choice : TopicChoice
        Which other topics are recorded as well.
    """

    def __init__(
        self,
        recording: BagRecording,
        taps: list[TapReader],
        early: list[tuple[str, bytes]],
        topics: dict[str, Topic],
        wanted: set[str],
        choice: TopicChoice,
    ) -> None:
        """Subscribe to the topics and start the thread that writes."""
        super().__init__("recorder")
        self.recording, self._taps = recording, taps
        self.received = 0  # messages on the rig's own topics
        self.overflow: Counter[str] = Counter()  # messages by topic that did not fit into the queue
        self.unreadable = recording.refused  # messages that could not be stored, as they are not of their topic's type
        self.ahead: Counter[str] = Counter()  # messages whose stamps are not the rig's time
        self.failure: RigError | None = None
        self.longest_queue = 0
        self._bytes_in, self._bytes_out = 0, 0  # of the queue's messages; each is counted by one thread only
        self._early_bytes = 0
        self._queue: deque = deque()  # topic, type and bytes of messages; None, function and arguments of orders
        self._asked_paused = recording.paused
        self._closing = threading.Event()
        self._give_up_at = math.inf  # time.monotonic() from which on a tap that is still open is no longer waited for
        # simulated time of the rig's newest own message; None before the first one, as the rig may already run
        self._newest: int | None = 0 if taps else None
        self._early: list[tuple[str, str, bytes, int]] = []  # messages that came before that time was known
        self._thread = threading.Thread(target=self._write_tapped if taps else self._write, name="writer", daemon=True)
        # Definitions are read before the first message; later the callbacks would have to wait for that.
        self._definitions = {topic.ros_type: installed(topic.ros_type) for topic in topics.values()}
        self._types = {name: topic.ros_type for name, topic in topics.items()}
        self._qos = {name: topic.qos for name, topic in topics.items()}
        self._others: dict[str, str] = {}  # topic beyond the catalogue -> class of its quality of service
        self._timing = {name for name, topic in topics.items() if carries_time(topic)}
        tapped = {name for tap in taps for name in tap.topics or ()}
        self._own = {
            topic.name: Receivers(
                self, topic.name, topic.ros_type, self._enqueue(topic), self._look_soon, recorder_profile(topic.qos)
            )
            for topic in topics.values()
            if topic.name in wanted and topic.name not in tapped
        }
        for name, data in early:
            self._wait(name, self._types[name], data)
        self.received += len(early)
        self._thread.start()
        self.others = OtherTopics(self, self._own | dict.fromkeys(tapped), choice, self._enqueue_other)
        self.others.look()
        for kind, name, answer in (
            (Pause, "pause", lambda _: self._order(self._pause, True)),
            (Resume, "resume", lambda _: self._order(self._pause, False)),
            (IsPaused, "is_paused", lambda _: {"paused": self._asked_paused}),
            (SplitBagfile, "split_bagfile", lambda _: self._order(self.recording.writer.split)),
            (Snapshot, "snapshot", lambda _: {"success": self._take_snapshot()}),
        ):
            self.create_service(kind, f"~/{name}", answering(answer))
        self._losing, self._misdating = Growing(), Growing()
        self.diagnostics = Diagnostics(self, self.health, lambda: self._newest or 0)

    def _look_soon(self) -> None:
        self.others.look_soon()

    def _order(self, action: Callable[..., None], *arguments: object) -> None:
        """Have the writer's thread do something between the messages that came before and those that come after."""
        if action == self._pause:
            (self._asked_paused,) = arguments
        self._queue.append((None, action, arguments))

    def _pause(self, paused: bool) -> None:
        self.recording.paused = paused

    def _take_snapshot(self) -> bool:
        """Have what is kept in memory written; False when nothing is kept or the bag takes no more."""
        if not self.recording.keep or self.failure is not None:
            return False
        self._order(self.recording.snapshot)
        return True

    def health(self) -> list[Health]:
        """Return the health of the recorder, for /diagnostics."""
        overflow, unreadable, ahead = (sum(tuple(counts.values())) for counts in (self.overflow, self.unreadable, self.ahead))

        def values() -> dict:
            return {
                "received": self.received,
                "paused": self._asked_paused,
                "queue": len(self._queue),
                "queue_longest": self.longest_queue,
                "overflow": overflow,
                "unreadable": unreadable,
                "ahead": ahead,
            }

        if self.failure is not None:
            return [Health("recorder", ERROR, f"writes no more: {self.failure}", values)]
        if overflow:
            return [Health("recorder", ERROR, "messages are missing in the bag: the disk did not keep up", values)]
        if self._losing(unreadable):
            return [Health("recorder", WARN, "messages that are not of their topic's type come in", values)]
        if self._misdating(ahead):
            return [
                Health(
                    "recorder",
                    WARN,
                    f"stamps that are not the rig's time come in on {', '.join(tuple(self.ahead))}; "
                    "set use_sim_time or leave the stamp 0",
                    values,
                )
            ]
        if len(self._queue) > WAITING // 2:
            return [Health("recorder", WARN, "more than half of the queue is full: the disk does not keep up", values)]
        says = "is paused" if self._asked_paused else "records" if self.received else "waits for the first message"
        return [Health("recorder", OK, says, values)]

    def _enqueue(self, topic: Topic) -> Callable[[bytes], None]:
        """Return the callback of one topic."""
        name, ros_type = topic.name, topic.ros_type

        def on_message(data: bytes) -> None:
            self.received += 1
            self._wait(name, ros_type, data)

        return on_message

    def _wait(self, name: str, ros_type: str, data: bytes) -> None:
        """Have a message wait for the writer, or count it as lost where there is no room."""
        if len(self._queue) < WAITING and self._bytes_in - self._bytes_out < WAITING_BYTES:
            self._bytes_in += len(data)
            self._queue.append((name, ros_type, data))
        else:
            self.overflow[name] += 1

    def _enqueue_other(self, name: str, ros_type: str, qos: str) -> Callable[[bytes], None]:
        """Return the callback of one topic that does not belong to the rig."""
        self._others[name] = qos
        return lambda data: self._wait(name, ros_type, data)

    def _write(self) -> None:
        """Write the queued messages into the bag, in the writer's thread, until the recorder is closed and the queue is empty."""
        try:
            while True:
                closing = self._closing.wait(FLUSH_PERIOD)
                self.longest_queue = max(self.longest_queue, len(self._queue))
                while self._queue:
                    self._store(*self._queue.popleft())
                if closing:
                    self._store_early()
                    return
                self.recording.writer.flush()
        except RigError as error:
            self.failure = error

    def _write_tapped(self) -> None:
        """Write in lockstep what the taps bring and what is queued, until the recorder is closed and nothing more comes."""
        stand_back()
        types, write = self._types, self._put
        flush_at = time.monotonic() + FLUSH_PERIOD
        try:
            with selectors.DefaultSelector() as selector:
                for tap in self._taps:
                    selector.register(tap, selectors.EVENT_READ)
                while True:
                    closing = self._closing.is_set()
                    ready = selector.select(FLUSH_PERIOD)
                    for key, _ in ready:
                        messages = key.fileobj.read()
                        if messages is None:
                            selector.unregister(key.fileobj)
                            continue
                        stamp = self._newest or 0
                        for topic, data in messages:
                            self.received += 1
                            stamp = cdr.stamp(data)
                            write(topic, types[topic], data, stamp)
                        self._newest = max(self._newest or 0, stamp)
                    while self._queue:
                        self._store(*self._queue.popleft())
                    if closing and not ready and (not selector.get_map() or time.monotonic() > self._give_up_at):
                        return
                    if time.monotonic() > flush_at:
                        self.recording.writer.flush()
                        flush_at = time.monotonic() + FLUSH_PERIOD
        except RigError as error:
            self.failure = error

    def _store(self, topic: str | None, ros_type: Any, data: Any) -> None:
        if topic is None:
            ros_type(*data)
            return
        self._bytes_out += len(data)
        if topic in self._others:
            self._store_at_its_coming(topic, ros_type, data, 0)
            return
        definition = self._definitions[ros_type]
        try:
            data = cdr.exact(definition, data)
            if definition.tree.ends_aligned and not definition.fixed and not definition.lists:  # only decoding checks its lengths
                cdr.decode_as(definition, data)
            stamp = cdr.stamp(data)
        except ValueError:
            self.unreadable[topic] += 1
            return
        if topic in self._timing and 0 <= stamp <= (self._newest or stamp) + AHEAD_NS:
            first, self._newest = self._newest is None, max(self._newest or 0, stamp)
            self._put(topic, ros_type, data, stamp)
            if first:
                self._store_early()
        else:
            self._store_at_its_coming(topic, ros_type, data, stamp)

    def _store_at_its_coming(self, topic: str, ros_type: str, data: bytes, stamp: int) -> None:
        """Store a message without a stamp, or with one of another clock, as users may send it, at the time of its arrival."""
        now = self._newest
        if now is None:
            self._early_bytes += len(data)
            if self._early_bytes < WAITING_BYTES:
                self._early.append((topic, ros_type, data, stamp))
            else:
                self.overflow[topic] += 1
            return
        if not 0 <= stamp <= now + AHEAD_NS:
            self.ahead[topic] += 1
            stamp = 0
        self._put(topic, ros_type, data, stamp or now)

    def _put(self, topic: str, ros_type: str, data: bytes, stamp: int) -> None:
        self.recording.take(topic, ros_type, data, stamp, self._others.get(topic) or self._qos[topic])

    def _store_early(self) -> None:
        """Store the messages that came before the rig's time was known."""
        early, self._early = self._early, []
        self._newest = self._newest or 0
        for message in early:
            self._store_at_its_coming(*message)

    def connected_publishers(self) -> int:
        """Return how many publishers of the rig's own topics are still connected."""
        return sum(receivers.publishers() for receivers in self._own.values())

    def close(self) -> None:
        """Write the queued messages and the end of the bag; in lockstep, when the other processes have closed their taps."""
        self._give_up_at = time.monotonic() + LONGEST_DRAIN
        self._closing.set()
        self._thread.join()
        self.recording.close()


def carries_time(topic: Topic) -> bool:
    """Return True for a topic that only the rig container publishes, stamped with its time.

    These are no orders and no answers, and nothing that is sent again.
    """
    return topic.qos != "latched" and topic.node not in ("alfa46", "sequencer") and not topic.node.endswith("_device")


def work(process: Process) -> None:
    """Record until the process is stopped, then take in the messages that are still on their way."""
    arguments = process.arguments
    (topics, wanted), choice = topics_of(arguments), TopicChoice(arguments.topics, arguments.exclude, arguments.own_topics)
    for name in wanted:
        installed(topics[name].ros_type)  # read now, because with the first messages it would keep a user's controller waiting
    name, piece = arguments.name, arguments.piece
    while piece and (arguments.out / f"{name}_{piece}.mcap").exists():
        piece += 1  # the recorder before this one had begun further files
    end = EndOfRun(process)
    with BagWriter(arguments.out, name, piece, topics, LIBRARY_OF_RUN, layout(arguments)) as writer:
        recording = BagRecording(writer, choice.takes_own, round(arguments.keep_last * 1e9), arguments.start_paused)
        process.status("recording")
        sys.setswitchinterval(0.0005)  # callbacks do not wait long for the writer
        executor = process.start_ros()
        taps = [TapReader(number) for number in process.descriptors().values()]
        node = Recorder(recording, taps, receive_first_messages(process, taps), topics, wanted, choice)
        executor.add_node(node)
        process.take_parameters([node])
        if not taps:  # in lockstep no process can be late
            prefer_process(RECORDING)
        try:
            while not process.stopping and node.failure is None:
                process.spin(0.05)
                node.others.look()
            drain(process, node)
            connected = node.connected_publishers()
        finally:
            end.store(writer)
            node.close()
    process.leave(
        [node],
        received=node.received,
        recorded=writer.counts,
        overflow=dict(node.overflow),
        unreadable=dict(node.unreadable),
        ahead=dict(node.ahead),
        left_out=dict(recording.left_out),
        unrecorded=node.others.unrecorded,
        longest_queue=node.longest_queue,
        publishers_at_end=connected,
    )
    if node.failure is not None:
        raise node.failure


class EndOfRun:
    """What the supervisor says about the end of the run, for the bag.

    A supervisor that was killed says nothing, and the bag then has no record of an end. A recorder without a supervisor is stopped
    by whoever started it.
    """

    def __init__(self, process: Process) -> None:
        """Listen to the supervisor of a process."""
        self._supervised = process.arguments.status_fd is not None
        self._said: dict[str, str] = {}
        self._come = threading.Event()
        process.follow_orders(self._take)

    def _take(self, order: dict) -> None:
        if "end" in order:
            self._said = order["end"]
            self._come.set()

    def store(self, writer: BagWriter) -> None:
        """Have the bag end with what was said."""
        if not self._supervised:
            writer.end(STOPPED, "the recorder was stopped")
        elif self._come.wait(ORDER):
            writer.end(**self._said)


def topics_of(arguments: argparse.Namespace) -> tuple[dict[str, Topic], set[str]]:
    """Return the topics that a run may have.

    Parameters
    ----------
    arguments : argparse.Namespace
        Arguments of the process.

    Returns
    -------
    topics : dict of str to Topic
        Topics of the rig of --run or --rig; without them, of all installed rigs.
    wanted : set of str
        Names of those that this run may have.
    """
    if arguments.rig is None and arguments.run is None:
        topics = installed_topics()
        return topics, set(topics)
    config, *_, controller = ordered(arguments)
    built_in = (controller or "alfa46").partition("@")[0] == "alfa46"
    return config.catalogue.all_topics, set(config.catalogue.of_run(config.cut_out, not built_in))


def receive_first_messages(process: Process, taps: list[TapReader]) -> list[tuple[str, bytes]]:
    """Wait until every tap has sent the names of its topics, or the process is stopped.

    Parameters
    ----------
    process : Process
        The recorder's process.
    taps : list of TapReader
        The taps of the run.

    Returns
    -------
    list of (str, bytes)
        Topics and messages that came together with the names.
    """
    early = []
    with selectors.DefaultSelector() as selector:
        for tap in taps:
            selector.register(tap, selectors.EVENT_READ)
        while selector.get_map() and not process.stopping:
            for key, _ in selector.select(0.1):
                messages = key.fileobj.read()
                early += messages or ()
                if messages is None or key.fileobj.topics is not None:
                    selector.unregister(key.fileobj)
    return early


def drain(process: Process, node: Recorder) -> None:
    """Serve callbacks until every publisher has left, which happens after all of its messages have arrived.

    A killed publisher never leaves; so recording also ends after a while without a message.
    """
    before, quiet_since = -1, time.monotonic()
    until = quiet_since + LONGEST_DRAIN
    while node.failure is None and process.failure is None and time.monotonic() < until:
        process.spin(IDLE)
        if node.received != before:
            before, quiet_since = node.received, time.monotonic()
        elif time.monotonic() - quiet_since > IDLE_WITH_PUBLISHERS or not node.connected_publishers():
            return


def main() -> int:
    """Entry point."""
    return run(lambda start: work(start("recorder", "The recorder.", OPTIONS)))


if __name__ == "__main__":
    sys.exit(main())
