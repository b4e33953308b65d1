# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The rig container: one process that owns the plant, moves it in real time and hosts one node per device.

nodes.processes.supervisor starts it. A separate thread moves the rig; the executor's callbacks only enqueue.
"""

from __future__ import annotations

import struct
import sys
import threading
import time
import traceback
from typing import TYPE_CHECKING

from rclpy.duration import Duration
from rosgraph_msgs.msg import Clock
from std_srvs.srv import Trigger

from ..base import SAMPLE_NS, TICK_SAMPLES, RigError, printable
from ..controllers import announce, from_environment
from ..rig import ENDED_EARLY, PROCESS_LOST, STOOD_STILL
from ..runs import BY_HAND, SCALAR_SAMPLES, Outputs, Rig, RigStatus, check_delay, run_record
from .commands import Commands
from .cut import CutEnds
from .device import DeviceNode, device_names, own_nodes, pace_of, sender
from .diagnostics import Diagnostics
from .lockstep import Lockstep
from .matching import meet, silent
from .other_clocks import OtherClocks
from .process import ORPHANED, RIG_OPTIONS, SEQUENCE_PARAMETERS, Process, ordered, run
from .processes.dropping import parse_drop
from .processes.recording_options import CLOCK, SECOND_CLOCK
from .realtime import MESSAGES, RealTime, prefer_process
from .rig_health import RigHealth
from .rig_node import RigNode

if TYPE_CHECKING:
    from rclpy.publisher import Publisher

    from ..rig import RigConfig

GATE_TIMEOUT = 30.0  # s in which the other processes must be connected
FIRST = 1.0  # s in which users' nodes must confirm the messages of time 0
LAST_TICKS = 4  # ticks recorded after an early end, so that the bag shows the safe state
CLOCK_BYTES = struct.Struct("<4siI")  # encapsulation, sec, nanosec
OPTIONS = [
    *RIG_OPTIONS,
    SEQUENCE_PARAMETERS,
    ("--sequence", {"metavar": "NAME", "help": "sequence that will be run, for the run's record"}),
    ("--seed", {"type": int, "default": 1, "help": "seed of the transducers' noise and errors"}),
    ("--speed", {"type": float, "help": "lockstep at so many times real time, inf for as fast as it goes"}),
    ("--step-timeout", {"type": float, "help": "s that the controller may take for one sample in lockstep"}),
    ("--delay", {"type": int, "default": 1, "help": "samples from a measurement to the effect of the answer to it"}),
    ("--drop", {"metavar": "TOPIC:N", "help": "do not send message N of a topic, to see that the loss is counted"}),
]


class Container:
    """Rig, outputs, nodes and loop of one container."""

    def __init__(self, process: Process) -> None:
        self.process = process
        arguments = process.arguments
        config, _, sequence, seed, delay, _ = ordered(arguments)
        self.by_sequence = sequence is not None
        sequence = sequence or BY_HAND
        self.dropped = parse_drop(arguments.drop, config.catalogue)
        sequence.check_rig(config)
        record = run_record(config, sequence, seed, delay)
        check_delay(delay, arguments.speed)
        if arguments.status_fd is None:  # otherwise the supervisor has done this
            self._domain = from_environment(keep=True).lead(look=False)
        # in real time a sample goes to everybody, by its topic
        controller = "external" if arguments.speed is None else "plugged"
        warm_up(config, record, controller)
        self.rig = rig_on_the_graph(config, seed, delay=delay, controller=controller)
        self.outputs = Outputs(self.rig, record)
        self.commands = Commands(self.outputs, process.tell)
        if arguments.speed is None:
            self.clock = RealTime(SAMPLE_NS, TICK_SAMPLES)
        else:
            self.clock = Lockstep(
                self.outputs,
                self.commands,
                process.links(),
                arguments.speed,
                arguments.step_timeout,
                lambda: process.stopping,
                lambda: ORPHANED if process.orphaned() else "",
            )
        self.nodes = self._nodes()
        self.cuts = CutEnds(self.rig, self.commands, self.nodes, process, arguments.step_timeout)
        self.publishers = {topic: publisher for node in self.nodes for topic, publisher in node.outputs.items()}
        self._send = {topic: sender(publisher) for topic, publisher in self.publishers.items()}
        self.tap = self.cuts.tap = process.tap([*self.publishers, *self.cuts.answers])
        # not in the catalogue and not recorded, because the replay of a bag publishes its own clock
        self._clock_out = self.nodes[0].create_publisher(Clock, CLOCK, 10)
        self.other_clocks = OtherClocks(self.nodes[0], self.on_other_clock)
        health = RigHealth(self.rig, self.clock, self.commands, self.other_clocks.names)
        self.diagnostics = Diagnostics(self.nodes[0], health, lambda: self.rig.time_ns)
        self._first_to: list[Publisher] = []  # publishers whose first message users' nodes must have before time goes on
        self._seen = None
        self._failure = None
        self._last_ticks = None

    def _nodes(self) -> list:
        rig, commands = self.rig, self.commands
        executor = self.process.start_ros()
        nodes = [
            RigNode(rig, commands, rig.shifts and self.process.arguments.speed is None),
            *(DeviceNode(name, rig, commands) for name in (*device_names(rig.config), "instruments")),
        ]
        for node in nodes:
            executor.add_node(node)
        self.process.take_parameters(nodes)
        return nodes

    def obey(self, order: dict) -> None:
        """Do an order of the supervisor, which is the first to detect that a process of the graph is gone or was started again."""
        if "trip" in order:
            self.commands.put_first("supervisor", lambda: self.rig.trip(order["trip"], order["name"]))
        if "event" in order:
            self.commands.put("supervisor", self.commands.event, order["event"], order["text"])

    # ---- before the first sample

    def wait_for_others(self) -> bool:
        """Wait until every receiver is connected and every command has a sender; False when the process is to stop first."""
        deadline = time.monotonic() + GATE_TIMEOUT
        while missing := self.missing():
            if self.process.stopping:
                return False
            if time.monotonic() > deadline:
                raise RigError(f"the rig did not start: after {GATE_TIMEOUT:.0f} s {'; '.join(missing[:3])}")
            self.process.spin(0.02)
        if self.nodes[0].count_publishers("/rig/state") > 1:
            raise RigError("another rig is in this ROS domain: end it, or give this one a domain of its own with ROS_DOMAIN_ID")
        # alfa46 and the sequencer do so for their own topics before they take part
        everything = {**self.publishers, CLOCK: self._clock_out}
        self._first_to = [everything[topic] for topic in meet(self.process, self.nodes[0], everything, own_nodes(self.rig.config))]
        return not self.process.stopping

    def missing(self) -> list[str]:
        """Return sentences on what is not connected yet."""
        recorder = {"recorder"} if self.process.arguments.recorded and self.tap is None else set()
        wanted = dict.fromkeys(self.publishers, recorder)
        others = {"alfa46", "sequencer"} if self.rig.shifts else {"sequencer"}  # nodes that wait for its samples
        wanted[pace_of(self.rig.config).name] = recorder | (others if self.process.arguments.speed is None else set())
        inputs = {topic: subscription for node in self.nodes for topic, subscription in node.inputs.items()}
        return (
            self.cuts.missing()
            + silent(self.nodes[0], self.publishers, wanted)
            + [f"nobody sends {topic}" for topic, subscription in inputs.items() if not subscription.get_publisher_count()]
        )

    # ---- the loop's thread

    def loop(self) -> None:
        """Run until the process is to stop."""
        try:
            if isinstance(self.clock, Lockstep):
                self.clock.run(self.publish, self.is_over)
            else:
                self.publish()  # time 0: latched topics
                self.clock.run(self.step, self.is_over, self.stood)
        except BaseException as error:
            self._failure = error
            traceback.print_exc()
        finally:
            self.process.stop()

    def step(self) -> None:
        """Do one controller sample.

        Commands that arrived since the last sample are applied after the plant has moved. So the answer to this sample acts from
        the next boundary on, with the same delay of one sample as the embedded controller.
        """
        self.rig.advance_samples(1)
        self.commands.apply()
        self.publish()

    def stood(self, seconds: float) -> None:
        """Trip a rig that stood still for so long [s of wall clock]."""
        self.rig.trip(f"the rig stood still for {seconds:.2f} s of real time", STOOD_STILL)

    def publish(self) -> None:
        """Send what is due now, and the time at every tick; in lockstep, wait first for the answers of cut devices."""
        if self.process.arguments.speed is not None:
            self.cuts.wait()
        if self.rig.sample % TICK_SAMPLES == 0:
            seconds, rest = divmod(self.rig.time_ns, 1_000_000_000)
            self._clock_out.publish(CLOCK_BYTES.pack(b"\x00\x01\x00\x00", seconds, rest))
        send, dropped, sent = self._send, self.dropped, []
        for topic, _, data in self.outputs.due():
            if dropped and self.is_dropped(topic, *dropped):
                continue
            send[topic](data)
            sent.append((topic, data))
        if self.tap is not None:
            self.tap.put(sent)
        if self._first_to:
            self._confirm_first()

    def _confirm_first(self) -> None:
        """Wait until users' nodes have the messages of time 0: a reader may know a writer later than the writer knows it."""
        until = time.monotonic() + FIRST
        for publisher in self._first_to:
            publisher.wait_for_all_acked(Duration(seconds=max(0.0, until - time.monotonic())))
        self._first_to = []

    def is_dropped(self, topic: str, name: str, number: int) -> bool:
        """Return whether this is the one message that must not be sent."""
        return topic == name and self.outputs.counts[topic] == number + 1

    def is_over(self) -> bool:
        """At every tick, report changes to the supervisor and trip the rig at an early end; True when the loop is to end."""
        rig = self.rig
        self.outputs.states.overruns = self.clock.overruns
        now = (rig.status, rig.reason)
        if now != self._seen and self._seen is not None and not self.process.stopping:
            self._log(*now, was=self._seen[0])
        if now != self._seen or rig.sample % 1000 == 0:
            self._seen = now
            self.process.status("state", state=rig.status.name, reason=rig.reason, trip=rig.tripped_by, t=rig.time)
        if not self.process.stopping:
            return False
        if self._last_ticks is None:
            orphaned, failure = self.process.orphaned(), self.process.failure
            if not (self.process.interrupted or orphaned or failure):
                return True
            self._last_ticks = LAST_TICKS
            if orphaned:
                rig.trip(ORPHANED, PROCESS_LOST)
            elif failure:
                rig.trip(f"container: {failure}", PROCESS_LOST)
            elif rig.status != RigStatus.TRIPPED:
                rig.trip(
                    "the run was ended before its sequence was done" if self.by_sequence else "the rig was ended by hand",
                    ENDED_EARLY,
                )
        self._last_ticks -= 1
        return self._last_ticks < 0

    def _log(self, status: RigStatus, reason: str, was: RigStatus) -> None:
        """Report a trip, and its end, to /rosout."""
        if status == RigStatus.TRIPPED:
            self.nodes[0].get_logger().error(f"safe state: {printable(reason)}")
        elif was == RigStatus.TRIPPED:
            self.nodes[0].get_logger().info("safe state left")

    # ---- the main thread

    def on_end(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """End the run in order, by the supervisor or, without one, by the end of this process, with which the launch ends too."""
        self.process.status("end")
        if self.process.arguments.status_fd is None:
            self.process.interrupted |= self.by_sequence
            self.process.stop()
        response.success, response.message = True, "the rig ends"
        return response

    def on_other_clock(self, text: str) -> None:
        """Report what a second sender of /clock does, as an event and to the person at the terminal."""
        self.commands.put(CLOCK, self.commands.event, SECOND_CLOCK, text)
        self.process.tell(text, self.rig.time)

    def work(self) -> None:
        """Wait for the other processes, run the loop, end in order."""
        if self.wait_for_others():
            if not isinstance(self.clock, Lockstep):
                prefer_process(MESSAGES)
            self.nodes[0].create_service(Trigger, "~/end", self.on_end)
            sign = announce(self.nodes[0].context.get_domain_id())
            self.process.status("running")
            self.process.follow_orders(self.obey)
            thread = threading.Thread(target=self.loop, name="rig", daemon=True)
            thread.start()
            while thread.is_alive():
                self.process.spin(0.05)
                self.other_clocks.look()
            sign.close()
        facts = {
            "time_s": self.rig.time,
            "state": self.rig.status.name,
            "reason": self.rig.reason,
            "trip": self.rig.tripped_by,
            "interrupted": self.process.interrupted,
            "refused": dict(self.commands.refused),
            "other_clocks": self.other_clocks.said,
            "real_time_priority": self.clock.real_time_priority,
        }
        if self.rig.shifts:  # a rig without shifts has no controller that could be late
            facts["delay"] = self.rig.delay
        if self.tap is not None:
            self.tap.close()
        self.process.leave(self.nodes, self.publishers.values(), published=self.outputs.counts, **facts, **self.clock.summary())
        if self._failure is not None:
            raise self._failure


def rig_on_the_graph(
    config: RigConfig, seed: int = 1, devices: str = "external", delay: int = 1, controller: str = "external"
) -> Rig:
    """Return a rig whose shift controller, if it has one, is a separate node.

    Parameters
    ----------
    config : RigConfig
        The rig's configuration.
    seed : int
        Seed of the run.
    devices : str
        "embedded" or "external", as for runs.rig.
    delay : int
        Delay of the controller's answers [samples], as for runs.rig.
    controller : str
        "external" or "plugged", as for runs.rig.

    Returns
    -------
    Rig
        The rig at time 0.
    """
    return Rig(config, seed, controller=controller, level=None, devices=devices, delay=delay)


def warm_up(config: RigConfig, record: dict, controller: str) -> None:
    """Load compiled code and encoders with a rig that is then discarded, so that the first sample of the real rig is on time."""
    rig = rig_on_the_graph(config, devices="embedded", controller=controller)
    outputs = Outputs(rig, record)
    for _ in range(SCALAR_SAMPLES):
        list(outputs.due())
        rig.advance_samples(1)


def main() -> int:
    """Run the process."""
    return run(lambda start: Container(start("container", "The rig container.", OPTIONS)).work())


if __name__ == "__main__":
    sys.exit(main())
