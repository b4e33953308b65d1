# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The rig's end of the topics of a controller that is a ROS 2 node: start, ready, step, answer.

Used by the plug (ros.py); the protocol is docs/how_to/ros_controller.md. No executor, but one wait set over two subscriptions
and messages as bytes, which takes less than half the time (the page, "Cost").
"""

from __future__ import annotations

import os
import socket
import struct
from typing import TYPE_CHECKING, NamedTuple

from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.impl.implementation_singleton import rclpy_implementation as rclpy_c
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rig_msgs.msg import ControllerAnswer, ControllerReady, ControllerStart, ControllerStep

from ..errors import RigError
from ..graph.domain import from_environment, use_own_transports
from .seam import ControllerInputs

if TYPE_CHECKING:
    from collections.abc import Collection

# Published reliably, so that any subscriber may listen; received best effort, because a reliable reader costs an
# acknowledgement for each message, and a step without an answer is sent again anyway. Of both only the newest counts.
SENT = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)
HEARD = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
# Those who come later get the newest one too.
LASTING = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
# A reader's depth is for all writers together: with 1, one node's refusal would displace another's ready.
FROM_MANY = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)

ENCAPSULATION = b"\x00\x01\x00\x00"  # of little-endian CDR
# session, controller, seq, sample, time, gear request; four lists follow
STEP = struct.Struct("<4s2I2QdB3x")
# session, controller, seq, status, gear, shifting, flags; three lists and the message follow
ANSWER = struct.Struct("<2IQ4B")
COUNT = struct.Struct("<I")


class NoAnswer(ValueError):
    """Bytes that are no ControllerAnswer."""


class Answered(NamedTuple):
    """A ControllerAnswer."""

    session: int
    controller: int
    seq: int
    status: int
    gear: int
    shifting: bool
    flags: int
    command: tuple[float, ...]
    setpoint: tuple[float, ...]
    signals: tuple[float, ...]
    message: str


def pack_step(session: int, controller: int, seq: int, inputs: ControllerInputs) -> bytes:
    """The bytes of a ControllerStep."""
    data = STEP.pack(ENCAPSULATION, session, controller, seq, inputs.sample, inputs.time, inputs.gear_request)
    for values in (inputs.current, inputs.measured, inputs.others.values(), inputs.settings.values()):
        data += _list(values, len(data))
    return data


def _list(values: Collection[float], at: int) -> bytes:
    """A float64[] that begins ``at`` bytes after the message's begin, a multiple of 4."""
    count = len(values)
    gap = 4 if count and at % 8 else 0  # numbers lie on multiples of 8 behind the encapsulation's 4 bytes
    return struct.pack(f"<I{gap}x{count}d", count, *values)


def unpack_answer(data: bytes) -> Answered:
    """The ControllerAnswer of bytes; NoAnswer when they are none."""
    try:
        if data[1] != 1:
            raise NoAnswer("an answer is not little-endian CDR")
        session, controller, seq, status, gear, shifting, flags = ANSWER.unpack_from(data, 4)
        at, lists = 4 + ANSWER.size, []
        for _ in range(3):
            values, at = _take_list(data, at)
            lists.append(values)
        (length,) = COUNT.unpack_from(data, at)
        if at + 4 + length > len(data):
            raise NoAnswer(f"an answer of {len(data)} bytes is cut off")
        message = data[at + 4 : at + 4 + length].rstrip(b"\0").decode("utf-8", "replace")
    except (struct.error, IndexError):
        raise NoAnswer(f"an answer of {len(data)} bytes is cut off") from None
    return Answered(session, controller, seq, status, gear, bool(shifting), flags, *lists, message)


def _take_list(data: bytes, at: int) -> tuple[tuple[float, ...], int]:
    """The float64[] at a place, and where it ends."""
    at += -at % 4
    (count,) = COUNT.unpack_from(data, at)
    at += 4
    if not count:
        return (), at
    at += -(at - 4) % 8
    return struct.unpack_from(f"<{count}d", data, at), at + 8 * count


class Topics:
    """/NAME/start and /NAME/step out, /NAME/ready and /NAME/answer in, in the ROS domain of this process."""

    def __init__(self, name: str) -> None:
        """RigError when another rig holds these topics in this domain, or ROS_DOMAIN_ID is none."""
        before = dict(os.environ)
        use_own_transports()
        try:
            self.domain = from_environment(keep=True).number
            self._held = self._hold(name)
            self._context = Context()
            self._context.init(args=[], initialize_logging=False)
            self._node = Node(
                "rig", namespace=f"/{name}", context=self._context, start_parameter_services=False, enable_rosout=False
            )
        finally:
            for added in set(os.environ) - set(before):
                del os.environ[added]
            os.environ.update(before)  # other runs of this process have domains of their own
        node = self._node
        self._start = node.create_publisher(ControllerStart, f"/{name}/start", LASTING)
        self._step = node.create_publisher(ControllerStep, f"/{name}/step", SENT)
        self._ready = node.create_subscription(ControllerReady, f"/{name}/ready", _nothing, FROM_MANY)
        self._answers = node.create_subscription(ControllerAnswer, f"/{name}/answer", _nothing, HEARD, raw=True)
        self._wait_set = rclpy_c.WaitSet(2, 0, 0, 0, 0, 0, self._context.handle)

    def _hold(self, name: str) -> socket.socket:
        """The topics' name in this domain, which the kernel frees when this process dies."""
        held = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        try:
            held.bind(f"\0rig-ros-controller-{self.domain}-{name}")
        except OSError:
            held.close()
            raise RigError(
                f"controller ros:{name}: another rig uses these topics in ROS domain {self.domain}; give "
                "one of the two another name or another ROS_DOMAIN_ID"
            ) from None
        return held

    def start(self, message: ControllerStart) -> None:
        """Publish what a run is, for those who are there and those who come."""
        self._start.publish(message)

    def step(self, data: bytes) -> None:
        """Publish a ControllerStep."""
        self._step.publish(data)

    def somebody_answers(self) -> bool:
        """True while a node on the graph offers answers; one that was killed counts for another 20 s."""
        return self._answers.get_publisher_count() > 0

    def take(self, seconds: float) -> Answered | ControllerReady | None:
        """The next message within so many seconds of wall clock; NoAnswer for one that cannot be read."""
        found = self._look()
        if found is not None or seconds <= 0.0:
            return found
        self._wait_set.clear_entities()
        self._wait_set.add_subscription(self._answers.handle)
        self._wait_set.add_subscription(self._ready.handle)
        self._wait_set.wait(int(seconds * 1e9))
        return self._look()

    def _look(self) -> Answered | ControllerReady | None:
        found = self._answers.handle.take_message(ControllerAnswer, True)
        if found:
            return unpack_answer(found[0])
        found = self._ready.handle.take_message(ControllerReady, False)
        return found[0] if found else None

    def close(self, patience: float) -> None:
        """Leave the graph when the last words have arrived, after ``patience`` s of wall clock at the latest."""
        self._start.wait_for_all_acked(Duration(seconds=patience))
        self._node.destroy_node()
        self._context.shutdown()
        self._held.close()


def _nothing(_message: object) -> None:
    """Callbacks are not used: messages are taken by hand."""
