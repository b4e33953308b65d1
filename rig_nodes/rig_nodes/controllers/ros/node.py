# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A shift controller as a ROS 2 node: brings a class with initialize / step / terminate to the rig.

The messages are those of docs/how_to/ros_controller.md. The file is copied unchanged to where a controller runs and needs
rclpy and rig_msgs. ``serve(controller)`` answers until it is stopped; a node with further tasks makes a ControllerNode
and spins it itself. include/rig_ros.hpp is the same for C++.
"""

from __future__ import annotations

import os
import random
import signal
import sys
import traceback
from types import SimpleNamespace
from typing import Any

import rclpy
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from rig_msgs.msg import ControllerAnswer, ControllerReady, ControllerStart, ControllerStep

try:
    from rclpy.experimental import EventsExecutor as Executor  # takes a third of the time
except ImportError:
    from rclpy.executors import SingleThreadedExecutor as Executor

NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)
UNCONFIRMED = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)  # the rig repeats a step without an answer
LASTING = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
# a reader's depth is shared by all writers: the last message of one rig must not displace the start of the next
FROM_MANY = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
LEVELS = {
    "duty": (ControllerStart.LEVEL_DUTY, ControllerReady.DUTY),
    "current": (ControllerStart.LEVEL_CURRENT, ControllerReady.CURRENT),
}
MORE = {"settings": ":VALUE"}  # what follows the name in the rig's option


class ControllerNode(Node):
    """A node that brings a controller to the rig.

    Parameters
    ----------
    controller : Any
        An object with initialize / step / terminate like the rig's Python classes.
    levels : tuple of str
        "duty", "current" or both.
    topics : str
        NAME of the rig's ``--controller ros:NAME``.
    name : str
        The node's name.
    **others : Any
        Further arguments of rclpy's Node.
    """

    def __init__(
        self,
        controller: Any,
        levels: tuple[str, ...] = ("duty",),
        topics: str = "controller",
        name: str = "my_controller",
        **others: Any,
    ) -> None:
        super().__init__(name, **others)
        self.controller, self.levels = controller, levels
        # read once, at the start: the controller may use attributes of these names for itself later
        self.needs = {kind: tuple(getattr(controller, kind, ())) for kind in ("wants", "settings", "signals")}
        self.number = random.randrange(1, 2**32)  # distinguishes this controller from others on the same topics
        self.session, self.running = 0, False
        self.start: ControllerStart | None = None
        self.answer: ControllerAnswer | None = None
        self._ready = self.create_publisher(ControllerReady, f"/{topics}/ready", LASTING)
        self._answer = self.create_publisher(ControllerAnswer, f"/{topics}/answer", NEWEST)
        self.create_subscription(ControllerStep, f"/{topics}/step", self.on_step, UNCONFIRMED)
        self.create_subscription(ControllerStart, f"/{topics}/start", self.on_start, FROM_MANY)

    def announce(self, state: int, message: str = "") -> None:
        """Publish a ControllerReady: this node is ready, refuses or leaves."""
        levels = sum(LEVELS[name][1] for name in self.levels)
        self._ready.publish(
            ControllerReady(
                session=self.session,
                controller=self.number,
                state=state,
                levels=levels,
                process_id=os.getpid(),
                pid_namespace=os.readlink("/proc/self/ns/pid"),
                message=message,
            )
        )

    def on_start(self, start: ControllerStart) -> None:
        """Begin or end a run."""
        if start.over and start.session != self.session:
            return  # the last message of an earlier rig
        if self.running:
            self.end()
        if start.over:
            return
        self.session, self.start, self.answer = start.session, start, None
        level = next((name for name, (number, _) in LEVELS.items() if number == start.level), f"number {start.level}")
        why = self.refusal(start, level)
        if why:
            self.announce(ControllerReady.REFUSES, why)
            return
        try:
            self.controller.initialize(
                SimpleNamespace(
                    period=start.period,
                    level=level,
                    command_high=start.command_high,
                    parameters=dict(zip(start.parameter_names, start.parameter_values)),
                    outputs=tuple(start.record.outputs),
                    transducers=dict(zip(start.record.transducers, start.record.units)),
                    gears=dict(zip(start.record.gears, start.record.gear_names)),
                    record=start.record.id,
                )
            )
        except Exception as error:
            self.get_logger().error(f"initialize failed:\n{traceback.format_exc()}")
            self.announce(ControllerReady.REFUSES, f"initialize failed: {type(error).__name__}: {error}")
            return
        self.running = True
        self.announce(ControllerReady.READY)

    def refusal(self, start: ControllerStart, level: str) -> str:
        """Return why the controller cannot work in a run, or an empty str.

        Parameters
        ----------
        start : ControllerStart
            The run.
        level : str
            The run's level.

        Returns
        -------
        str
            The reason: the level, or something that the controller's class names and the rig does not offer.
        """
        if level not in self.levels:
            return f"this run is at level {level}, the controller's is {' and '.join(self.levels)}; choose with --level"
        lacking = [name for kind, names in self.needs.items() for name in names if name not in getattr(start, kind)]
        if lacking:
            whole = "&".join(
                f"{kind}={','.join(name + MORE.get(kind, '') for name in dict.fromkeys([*getattr(start, kind), *names]))}"
                for kind, names in self.needs.items()
                if names
            )
            return f"it needs {', '.join(lacking)}; start the rig with ros:NAME?{whole}"
        return ""

    def on_step(self, step: ControllerStep) -> None:
        """Answer a sample: compute once, and send the same answer again when the same step comes again."""
        if not self.running or step.session != self.session or step.controller not in (0, self.number):
            return
        if self.answer is None or step.seq > self.answer.seq:
            self.answer = self.compute(step)
        if step.seq == self.answer.seq:
            self._answer.publish(self.answer)

    def compute(self, step: ControllerStep) -> ControllerAnswer:
        """Return the ControllerAnswer to a ControllerStep; an error in the controller becomes an answer with status ERROR."""
        answer = ControllerAnswer()
        answer.session, answer.controller, answer.seq = step.session, self.number, step.seq
        try:
            start, record = self.start, self.start.record
            for what, names in (
                ("current", record.outputs),
                ("measured", record.transducers),
                ("others", start.wants),
                ("settings", start.settings),
            ):
                if len(getattr(step, what)) != len(names):
                    raise ValueError(f"the step has {len(getattr(step, what))} numbers in {what}, expected {len(names)}")
            out = self.controller.step(
                SimpleNamespace(
                    sample=step.sample,
                    time=step.time,
                    gear_request=step.gear_request,
                    current=tuple(step.current),
                    measured=tuple(step.measured),
                    **dict(zip(self.start.record.transducers, step.measured)),
                    others=dict(zip(self.start.wants, step.others)),
                    settings=dict(zip(self.start.settings, step.settings)),
                )
            )
            # messages do not check types: a number that does not fit, or is no float, would be sent as another number
            answer.status, answer.message = _byte("status", getattr(out, "status", 0)), str(getattr(out, "message", ""))
            answer.gear, answer.shifting, answer.flags = _byte("gear", out.gear), bool(out.shifting), _byte("flags", out.flags)
            answer.command = [float(value) for value in out.command or [0.0] * len(step.current)]
            answer.setpoint = [float(value) for value in out.setpoint or ()]
            answer.signals = [float(out.signals[name]) for name in self.start.signals]
        except Exception as error:
            self.get_logger().error(f"sample {step.sample}:\n{traceback.format_exc()}")
            answer.status, answer.message = ControllerAnswer.ERROR, f"{type(error).__name__}: {error}"
        return answer

    def end(self) -> None:
        """End the run for the controller."""
        self.running = False
        try:
            self.controller.terminate()
        except Exception:  # the node serves the next run all the same
            self.get_logger().error(f"terminate failed:\n{traceback.format_exc()}")

    def leave(self, why: str) -> None:
        """Send the reason of the end when a run is on, and wait until it has arrived."""
        if self.running:
            self.announce(ControllerReady.LEAVES, why)
            self._ready.wait_for_all_acked(Duration(seconds=0.5))
            self.end()


def _byte(name: str, value: Any) -> int:
    """Return a number of an answer as a message can hold it; ValueError when it cannot."""
    if not 0 <= int(value) <= 255:
        raise ValueError(f"{name} is {value}, expected 0 to 255")
    return int(value)


def serve(controller: Any, levels: tuple[str, ...] = ("duty",), topics: str = "controller") -> int:
    """Connect a controller with rigs that are started with ``--controller ros:NAME``, until Ctrl-C; either may start first.

    Parameters
    ----------
    controller, levels, topics
        As in :class:`ControllerNode`.

    Returns
    -------
    int
        130 after Ctrl-C, 0 after SIGTERM, 2 when ROS_DOMAIN_ID is no domain.
    """
    domain = os.environ.get("ROS_DOMAIN_ID", "") or "0"
    if not (domain.isdecimal() and int(domain) <= 232):
        print(f"{sys.argv[0]}: ROS_DOMAIN_ID is {domain!r}, expected a number from 0 to 232", file=sys.stderr)
        return 2
    asked = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda number, _frame: asked.append(number))
    rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
    node, executor = ControllerNode(controller, levels, topics), Executor()
    executor.add_node(node)
    print(f"waiting for the rig in ROS domain {int(domain)}, topics /{topics}/..., until Ctrl-C", flush=True)
    while not asked:
        executor.spin_until_future_complete(Future(), 0.1)
    node.leave("the controller was stopped")
    executor.remove_node(node)
    node.destroy_node()
    rclpy.shutdown()
    return 130 if signal.SIGINT in asked else 0
