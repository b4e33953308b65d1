# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The rig's end of the topics of a controller that is a ROS 2 node: start, ready, step, answer.

The plug (ros.py) uses it; docs/how_to/ros_controller.md describes the protocol. Instead of an executor there is one wait
set over two subscriptions, with messages as bytes; this takes less than half the time ("Cost" on that page).
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

from ...base import RigError
from ..seam import ControllerInputs
from .domain import from_environment, use_own_transports

if TYPE_CHECKING:
    from collections.abc import Collection

# Published reliably, so that any subscriber may listen; received best effort, because a reliable reader costs an
# acknowledgement for each message, and a step without an answer is sent again anyway. In both only the newest counts.
SENT = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)
ANSWER_QOS = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
# Nodes that come later receive the newest message too.
LASTING = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
# A reader's depth is shared by all writers: with 1, one node's refusal would displace another's ready.
FROM_MANY = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)

ENCAPSULATION = b"\x00\x01\x00\x00"  # little-endian CDR
# session, controller, seq, sample, time, gear request; four lists follow
STEP = struct.Struct("<4s2I2QdB3x")
# session, controller, seq, status, gear, shifting, flags; three lists and the message follow
ANSWER = struct.Struct("<2IQ4B")
COUNT = struct.Struct("<I")


class NoAnswer(ValueError):
    """The bytes are no ControllerAnswer."""


class Answered(NamedTuple):
    """The fields of a ControllerAnswer."""

    session: int
    controller: int
    seq: int
    status: int
    gear: int
    shifting: int
    flags: int
    command: tuple[float, ...]
    setpoint: tuple[float, ...]
    signals: tuple[float, ...]
    message: str


def pack_step(session: int, controller: int, seq: int, inputs: ControllerInputs) -> bytes:
    """Return the bytes of a ControllerStep.

    Parameters
    ----------
    session, controller, seq : int
        Numbers of the session, of the controller and of the step.
    inputs : ControllerInputs
        The sample.

    Returns
    -------
    bytes
        The message in CDR.
    """
    data = STEP.pack(ENCAPSULATION, session, controller, seq, inputs.sample, inputs.time, inputs.gear_request)
    for values in (inputs.current, inputs.measured, inputs.others.values(), inputs.settings.values()):
        data += _list(values, len(data))
    return data


def _list(values: Collection[float], at: int) -> bytes:
    """Return the bytes of a float64[] that begins ``at`` bytes after the begin of the message, a multiple of 4."""
    count = len(values)
    gap = 4 if count and at % 8 else 0  # numbers lie on multiples of 8, counted from behind the encapsulation's 4 bytes
    return struct.pack(f"<I{gap}x{count}d", count, *values)


def unpack_answer(data: bytes) -> Answered:
    """Return the ControllerAnswer that bytes hold; NoAnswer when they hold none."""
    try:
        if data[1] != 1:
            raise NoAnswer("an answer is not little-endian CDR")
        session, controller, seq, status, gear, shifting, flags = ANSWER.unpack_from(data, 4)
        command, at = _take_list(data, 4 + ANSWER.size)
        setpoint, at = _take_list(data, at)
        signals, at = _take_list(data, at)
        (length,) = COUNT.unpack_from(data, at)
        if at + 4 + length > len(data):
            raise NoAnswer(f"an answer of {len(data)} bytes is cut off")
        message = data[at + 4 : at + 4 + length].rstrip(b"\0").decode("utf-8", "replace")
    except (struct.error, IndexError):
        raise NoAnswer(f"an answer of {len(data)} bytes is cut off") from None
    return Answered(session, controller, seq, status, gear, shifting, flags, command, setpoint, signals, message)


def _take_list(data: bytes, at: int) -> tuple[tuple[float, ...], int]:
    """Return the float64[] at a place, and where it ends."""
    at += -at % 4
    (count,) = COUNT.unpack_from(data, at)
    at += 4
    if not count:
        return (), at
    at += -(at - 4) % 8
    return struct.unpack_from(f"<{count}d", data, at), at + 8 * count


class Topics:
    """The topics /NAME/start and /NAME/step out, /NAME/ready and /NAME/answer in, in the ROS domain of this process.

    Parameters
    ----------
    name : str
        NAME of the topics.

    Raises
    ------
    RigError
        When another rig holds these topics in this domain, or ROS_DOMAIN_ID is no domain.
    """

    def __init__(self, name: str) -> None:
        """Open the topics."""
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
        self._answers = node.create_subscription(ControllerAnswer, f"/{name}/answer", _nothing, ANSWER_QOS, raw=True)
        self._wait_set = rclpy_c.WaitSet(2, 0, 0, 0, 0, 0, self._context.handle)

    def _hold(self, name: str) -> socket.socket:
        """Reserve the topics' name in this domain; the kernel frees it when this process dies."""
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
        """Publish what a run is, for the controllers that are there and those that come."""
        self._start.publish(message)

    def step(self, data: bytes) -> None:
        """Publish a ControllerStep."""
        self._step.publish(data)

    def somebody_answers(self) -> bool:
        """Return whether a node on the graph offers answers; a node that was killed counts for another 20 s."""
        return self._answers.get_publisher_count() > 0

    def take(self, seconds: float) -> Answered | ControllerReady | None:
        """Return the next message.

        Parameters
        ----------
        seconds : float
            Longest wait [s of wall clock].

        Returns
        -------
        Answered, ControllerReady or None
            None when no message comes in time.

        Raises
        ------
        NoAnswer
            When a message cannot be read.
        """
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
        """Leave the graph when the last message has arrived, after ``patience`` s of wall clock at the latest."""
        self._start.wait_for_all_acked(Duration(seconds=patience))
        self._node.destroy_node()
        self._context.shutdown()
        self._held.close()


def _nothing(_message: object) -> None:
    """Do nothing, because messages are taken by hand and callbacks are not used."""
