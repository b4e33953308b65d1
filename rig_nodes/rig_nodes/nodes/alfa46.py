# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The node `alfa46`: the Alfa46 box as a process of its own, with samples in, valve commands out and gears ordered by an action.

Started by nodes.processes.supervisor. Each sample in gives one command out: in executor callbacks in real time, in the main
thread in lockstep, where another thread serves ROS. The controller itself is a plug (controllers.load).
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import TYPE_CHECKING

from rclpy.node import Node
from rig_msgs.msg import ControllerSample, Measurement, RigState

from ..bags import Fields, encoder
from ..base import (
    ANSWERED,
    COMMAND_TIMEOUT,
    DISCARDED,
    FAILED,
    READY,
    SAMPLE_NS,
    STATUS,
    Frames,
    Link,
    LinkClosed,
    RigError,
    printable,
)
from ..controllers import LEVELS, ControllerFailed, level_line, load_controller, own_signals
from ..rig import CONTROLLER_COMMAND, CONTROLLER_EVENTS, CONTROLLER_FAILED, CONTROLLER_SILENT, check_gearbox
from .alfa46_settings import BoxSettings
from .device import own_nodes, publishers_of, sender
from .diagnostics import ERROR, OK, STALE, WARN, Diagnostics, Growing, Health
from .matching import meet, silent
from .process import RIG_OPTIONS, Process, ordered, run
from .qos import stream_profile
from .realtime import MESSAGES, prefer, prefer_process, take_core
from .settings import CHANGED
from .shift_orders import ShiftOrders

if TYPE_CHECKING:
    from ..controllers import Answer, Plug
    from ..rig import RigConfig

ANSWER_LIMIT = 0.9 * COMMAND_TIMEOUT  # s for an answer in real time, so that the rig learns why there is none before it trips
TELL_AFTER = 0.5 * COMMAND_TIMEOUT  # s without an answer in real time until the rig learns what the plug knows of it
OPTIONS = [
    *RIG_OPTIONS,
    ("--controller", {"metavar": "SPEC", "help": "a controller in place of the built-in one"}),
    ("--step-timeout", {"type": float, "help": "s that the controller may take for one sample in lockstep"}),
    ("--come-timeout", {"type": float, "help": "s that a program outside the rig may take to connect, in lockstep"}),
]
SAMPLES = "/instruments/controller"
STATE = "/rig/state"


class Alfa46Node(Node):
    """The node that publishes /controller/* and serves the parameters that can be set; its ``orders`` serve /controller/shift.

    Parameters
    ----------
    config : RigConfig
        The rig's configuration.
    controller : str or None
        Specification of a plug, with @level where the level must be given; None for the Alfa46.
    process : Process
        The process that the node runs in.
    """

    def __init__(self, config: RigConfig, controller: str | None, process: Process) -> None:
        """Load the controller and create publishers, action server and parameters."""
        super().__init__("alfa46")
        self.config, self.transmission = config, config.transmission
        self.gears = self.transmission.names
        self.box = load_controller(controller, config)
        self.pressures = [self.box.rig_record.reader(clutch.pressure) for clutch in self.transmission.clutches]
        self.box.say = reporter(process, self.box)
        self._nothing = (0.0,) * len(self.box.rig_record.outputs)
        self.frames: Frames | None = None  # in lockstep, as soon as it is known what the controller wants
        self.box.failing = self.fail
        self.box.stopped = lambda: process.stopping
        if not process.descriptors():
            self.box.pace(ANSWER_LIMIT, real_time=True)
        else:  # a controller that computes in this process is watched by the container, which can go on without it
            self.box.pace(None if self.box.in_process else process.arguments.step_timeout)
        own = config.catalogue.controller_topics.values() if self.box.signals or self.box.named_later else ()
        self.outputs = publishers_of(self, config.catalogue, in_lockstep=bool(process.descriptors()), more=own)
        self._send = {topic: sender(publisher) for topic, publisher in self.outputs.items()}
        self._blocks = None  # of the controller's own signals, from the first message on
        self.counts = dict.fromkeys(self.outputs, 0)
        self.first_seq = process.first_seq
        self.tap = process.tap(self.outputs)
        self.missed = 0  # samples that never arrived
        self._encode_command = encoder("rig_msgs/msg/ValveCommand").encode
        self._encode_event = encoder("rig_msgs/msg/Event").encode
        self._fields = Fields("rig_msgs/msg/ControllerSample")
        self.last_sample = None
        self._other_values: dict[str, float] = {}
        self.stamp = 0
        self._newest_sample_at: float | None = None  # when the newest sample came [s]
        self._silent, self._failed = False, ""
        self._answered_at, self._told = 0.0, ""  # time of the newest answer [s]; what the rig was told since
        self._asked: tuple[int, Callable[[bytes], None]] | None = None  # in lockstep: the sample that is to be answered, and how
        self.real_time = False  # True when samples come over their topic
        self.orders = ShiftOrders(self)
        self.settings = BoxSettings(self, self.box, config)
        self.box.named = self.on_named
        self._watch = self.create_timer(COMMAND_TIMEOUT / 2, self.on_watch)
        self._missing = Growing()
        self.diagnostics = Diagnostics(self, self.health, lambda: self.stamp)

    def listen(self) -> None:
        """Subscribe to the samples and the state of the rig; called when the receivers of the commands are connected."""
        self.create_subscription(
            RigState,
            STATE,
            lambda message: self.orders.receive_status(message.state, message.reason),
            stream_profile(self.config.catalogue.topics[STATE].qos),
        )
        profile = stream_profile(self.config.catalogue.topics[SAMPLES].qos)
        self.create_subscription(ControllerSample, SAMPLES, self.on_sample, profile, raw=True)
        self.real_time = True
        self.listen_to_wants()

    def listen_to_wants(self) -> None:
        """Subscribe to the transducers that the controller wants."""
        for name in self.box.wants:
            known = self.config.catalogue
            topic = known.topics[known.signals[name].topic]
            self.create_subscription(Measurement, topic.name, partial(self.on_value, name), stream_profile(topic.qos))

    def on_named(self) -> None:
        """Declare the settings of a controller program that has come, and subscribe to the transducers that it wants."""
        try:
            self.settings.declare_own()
        except RigError as error:
            self.get_logger().error(str(error))
        if self.real_time:
            self.listen_to_wants()

    def on_value(self, name: str, message: Measurement) -> None:
        """Keep the newest value of a transducer that the controller wants, in real time."""
        self._other_values[name] = message.value

    # ---- samples

    def on_sample(self, data: bytes) -> None:
        """Answer one sample with one command, in real time."""
        record = self._fields.of(data)
        measured = record["measured"].tolist()
        sample = int(record["sample"])
        try:
            # in real time these are the newest values from the transducers' own topics
            others = [self._other_values.get(name) for name in self.box.wants]
            if None in others:
                return
            answer = self.ask(sample, record["current"], measured, others)
            self.publish_command(sample, answer, measured)
            self.tell_trouble(answer is not None)
        except ControllerFailed as failure:
            self.fail(failure)

    def tell_trouble(self, answered: bool) -> None:
        """Tell the rig, once for each reason, what the plug knows of why no answer comes; it counts when the rig trips for that."""
        if answered:
            self._answered_at, self._told = time.monotonic(), ""
        elif self._told != self.box.trouble and time.monotonic() - self._answered_at > TELL_AFTER:
            self._told = self.box.trouble
            self.event(CONTROLLER_SILENT, self._told, 0.0)

    def on_frame(self, frame: bytes, reply: Callable[[bytes], None]) -> None:
        """Answer one sample in lockstep; the rig continues while the rest of this process handles the answer.

        Parameters
        ----------
        frame : bytes
            A sample, or STATUS with the rig's state and the reason for it.
        reply : callable
            Sends the answer, as bytes, to the container.
        """
        if frame.startswith(STATUS):
            status, reason = frame[len(STATUS)], frame[len(STATUS) + 1 :]
            self.orders.receive_status(status, reason.decode())
            return
        frames = self.frames
        sample, *values = frames.sample.unpack_from(frame)
        measured = values[frames.outputs : frames.measured]
        self._asked = sample, reply
        try:
            answer = self.ask(sample, values[: frames.outputs], measured, values[frames.measured :])
        except ControllerFailed as failure:
            self.fail(failure)
            return
        self._asked = None
        if answer is None:
            reply(frames.none(sample, DISCARDED) + self.box.trouble.encode("utf-8", "replace"))
        else:
            reply(
                frames.answer.pack(
                    sample, ANSWERED, *answer.command, *answer.setpoint, self.box.gear, self.box.shifting, self.box.flags
                )
            )
        self.publish_command(sample, answer, measured)

    def ask(self, sample: int, *wires: Iterable[float]) -> Answer | None:
        """Give the controller one sample.

        Parameters
        ----------
        sample : int
            Number of the sample.
        *wires : iterable of float
            Currents [A], measured values and the other transducers that the controller wants.

        Returns
        -------
        Answer or None
            The controller's answer; None when it discards the sample.

        Raises
        ------
        ControllerFailed
            When the controller gives no usable answer.
        """
        if self.last_sample is not None and sample > self.last_sample + 1:
            self.missed += sample - self.last_sample - 1
        self.last_sample, self._newest_sample_at = sample, time.monotonic()
        self.stamp = sample * SAMPLE_NS
        news = [self.settings.news.popleft() for _ in range(len(self.settings.news))]
        with self.orders.lock:
            answer = self.box.step(sample, *wires)
        if answer is not None:
            self._failed = ""  # a controller that is a program of its own may come again
        for text, value in news:
            self.event(CHANGED, text, value)
        return answer

    def publish_command(self, sample: int, answer: Answer | None, measured: Sequence[float]) -> None:
        """Publish an answer, and events, feedback and result of a running shift.

        Parameters
        ----------
        sample : int
            Number of the sample.
        answer : Answer or None
            The controller's answer; None when it discarded the sample.
        measured : sequence of float
            The measured values of the sample.
        """
        box = self.box
        if answer is not None:
            self.orders.setpoint = answer.setpoint
            duty, flags = (self._nothing, box.flags) if box.level == "current" else (answer.command, 0)
            self.publish(
                CONTROLLER_COMMAND,
                self._encode_command(
                    self.stamp,
                    self.first_seq + self.counts[CONTROLLER_COMMAND],
                    sample,
                    box.gear,
                    box.shifting,
                    LEVELS.index(box.level),
                    flags,
                    duty,
                    answer.setpoint,
                ),
            )
            if box.signals:
                self.publish_own_signals(sample)
        self.orders.follow(sample, measured)

    def publish_own_signals(self, sample: int) -> None:
        """Publish the controller's own signals in blocks, after one message with their names."""
        if not self.counts[own_signals.CHANNELS]:
            signals = self.box.signals
            self._blocks = own_signals.Blocks(len(signals))
            self.publish(
                own_signals.CHANNELS,
                encoder("rig_msgs/msg/ChannelList").encode(
                    0, self.first_seq, list(signals), list(signals.values()), SAMPLE_NS * 1e-9
                ),
            )
        for first, rows in self._blocks.add(sample, self.box.signal_values):
            self.publish(
                own_signals.BLOCK,
                encoder("rig_msgs/msg/SampleBlock").encode(
                    first * SAMPLE_NS,
                    self.first_seq + self.counts[own_signals.BLOCK],
                    first,
                    SAMPLE_NS * 1e-9,
                    *rows.shape,
                    rows.ravel(),
                ),
            )

    def fail(self, failure: ControllerFailed) -> None:
        """Report once that the controller cannot continue; the rig trips by this event, in lockstep by the answer."""
        if self._asked is not None:
            (sample, reply), self._asked = self._asked, None
            reply(self.frames.none(sample, FAILED) + str(failure).encode("utf-8", "replace"))
        if not self._failed:
            self._failed = str(failure)
            self.get_logger().error(printable(failure))
            self.event(CONTROLLER_FAILED, str(failure), float(failure.status))

    def on_watch(self) -> None:
        """Log once when the samples stop, for then there is nothing to answer, and once when they come again."""
        if self._newest_sample_at is None:
            return
        quiet = time.monotonic() - self._newest_sample_at > COMMAND_TIMEOUT
        if quiet and not self._silent:
            self.get_logger().warning(f"no sample for {COMMAND_TIMEOUT * 1e3:.0f} ms: no output until they come again")
        elif self._silent and not quiet:
            self.get_logger().info("samples come again")
        self._silent = quiet

    def health(self) -> list[Health]:
        """Return the health of the box, for /diagnostics."""

        def values() -> dict:
            return {
                "controller": self.box.name,
                "level": self.box.level,
                "answered": self.counts[CONTROLLER_COMMAND],
                "missed": self.missed,
                "shifts_refused": self.orders.refused,
                "gear": self.gears[self.box.gear],
                "shifting": self.box.shifting,
            }

        missing = self._missing(self.missed)
        if self._failed:
            return [Health("alfa46", ERROR, f"failed: {self._failed}", values)]
        if self._newest_sample_at is None or self._silent:
            text = "no sample has come yet" if self._newest_sample_at is None else f"no sample for {COMMAND_TIMEOUT * 1e3:.0f} ms"
            return [Health("alfa46", STALE, text, values)]
        if missing:
            return [Health("alfa46", WARN, "samples of the rig did not arrive", values)]
        return [Health("alfa46", OK, "answers the samples", values)]

    def event(self, name: str, text: str, value: float) -> None:
        """Publish an event at the time of the newest sample; in lockstep both threads call this.

        Parameters
        ----------
        name : str
            Name of the event.
        text : str
            Sentence for people.
        value : float
            Value of the event, for instance the gear.
        """
        with self.orders.lock:
            self.publish(
                CONTROLLER_EVENTS,
                self._encode_event(self.stamp, self.first_seq + self.counts[CONTROLLER_EVENTS], name, text, value),
            )

    def publish(self, topic: str, data: bytes) -> None:
        """Send the next message of a topic, in lockstep also to the recorder's tap."""
        self.counts[topic] += 1
        self._send[topic](data)
        if self.tap is not None:
            self.tap.put([(topic, data)])


def reporter(process: Process, plug: Plug) -> Callable[[str], None]:
    """Return the function that reports a plug's sentences in the process's log and to the person at the terminal.

    The sentences reach the terminal through the supervisor. The supervisor also receives which controller has not come
    yet, for its last sentence.
    """

    def say(text: str) -> None:
        process.log.info("%s", text)
        process.status("waiting", text=text, awaited=plug.awaited())

    return say


def work(process: Process) -> None:
    """Run the process: wait for the receivers, answer samples, end in order."""
    config, *_, controller = ordered(process.arguments)
    check_gearbox(config, "alfa46")
    executor = process.start_ros()
    node = Alfa46Node(config, controller, process)
    process.log.info("%s", level_line(node.box))
    executor.add_node(node)
    process.take_parameters([node])
    recorder = {"recorder"} if process.arguments.recorded and node.tap is None else set()
    link = process.links().get("container")
    wanted = dict.fromkeys(node.outputs, recorder) | {CONTROLLER_COMMAND: recorder if link else {"rig"} | recorder}
    while not process.stopping and silent(node, node.outputs, wanted):
        process.spin(0.02)
    meet(process, node, node.outputs, own_nodes(config))
    if link is not None:
        node.box.wait(process.arguments.come_timeout)
        answer_in_lockstep(process, node, link)
    elif not process.stopping:
        prefer_process(MESSAGES)
        if node.box.process_id is not None:
            prefer(MESSAGES, node.box.process_id)
        node.listen()
    while not process.stopping:
        process.spin(0.05)
    node.box.close()
    if node.tap is not None:
        node.tap.close()
    process.leave(
        [node],
        node.outputs.values(),
        published=node.counts,
        samples_missed=node.missed,
        shifts_refused=node.orders.refused,
        controller=node.box.record(),
    )


def answer_in_lockstep(process: Process, node: Alfa46Node, link: Link) -> None:
    """Answer the container's samples in this thread while another one serves ROS, until one of the two processes ends."""
    over = threading.Event()

    def serve() -> None:
        while not over.is_set():
            process.spin(0.05)

    thread = threading.Thread(target=serve, name="ros", daemon=True)
    thread.start()
    take_core(1)
    record = node.box.rig_record
    node.frames = Frames(len(record.outputs), len(record.transducers), len(node.box.wants))
    try:
        link.send(READY + " ".join([node.box.level, *node.box.wants]).encode())
        while not process.stopping:
            frame = link.receive(0.1)
            if frame is not None:
                node.on_frame(frame, link.send)
            else:
                node.tap.flush()
    except LinkClosed:
        pass  # the supervisor notices it too and ends this process
    finally:
        over.set()
        thread.join()


def main() -> int:
    """Entry point."""
    return run(lambda start: work(start("alfa46", "The Alfa46 shift controller.", OPTIONS)))


if __name__ == "__main__":
    sys.exit(main())
