# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Two ends of a message that goes back and forth through DDS; `rig doctor` starts each end as a separate process.

`ping` prints the times of discovery and of the round trip, or ends with a sentence; `pong` answers until it is ended.
"""

import contextlib
import os
import sys
import time
from collections.abc import Callable

import rclpy
from rclpy.executors import ExternalShutdownException
from std_msgs.msg import UInt64

PATIENCE_S = 10.0


def ping() -> str:
    """Send this process' number and wait for its echo; end the process with a sentence after PATIENCE_S."""
    node = rclpy.create_node("doctor_ping")
    answers: list[int] = []
    out = node.create_publisher(UInt64, "/rig_doctor/ping", 1)
    node.create_subscription(UInt64, "/rig_doctor/pong", lambda m: answers.append(m.data), 1)
    began = time.monotonic()

    def spin_until(done: Callable[[], bool], failure: str) -> float:
        while not done():
            if time.monotonic() > began + PATIENCE_S:
                sys.exit(failure)
            rclpy.spin_once(node, timeout_sec=0.05)
        return time.monotonic()

    found = spin_until(
        lambda: out.get_subscription_count() and node.count_publishers("/rig_doctor/pong"),
        "two processes on this host do not discover each other",
    )
    # The other side may have discovered only one of its two ends, so the request is repeated until it answers.
    asked = 0.0

    def ask() -> bool:
        nonlocal asked
        if not answers and time.monotonic() > asked + 0.5:
            asked = time.monotonic()
            out.publish(UInt64(data=os.getpid()))
        return os.getpid() in answers

    answered = spin_until(ask, "processes see each other, but messages do not arrive")
    return f"discovery {1e3 * (found - began):.0f} ms, there and back {1e3 * (answered - asked):.1f} ms"


def pong() -> None:
    """Answer every ping until the process is ended."""
    node = rclpy.create_node("doctor_pong")
    publisher = node.create_publisher(UInt64, "/rig_doctor/pong", 1)
    node.create_subscription(UInt64, "/rig_doctor/ping", publisher.publish, 1)
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(node)


if __name__ == "__main__":
    rclpy.init()
    if sys.argv[1] == "ping":
        print(ping())
    else:
        pong()
    rclpy.try_shutdown()
