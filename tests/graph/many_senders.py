# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A user's program that sends numbered messages on many topics at a steady rate, with the default quality of service.

Arguments: number of topics, messages per second on each, seconds. It prints a line when every topic has a receiver, and at its end,
which SIGTERM brings earlier, how many messages it has sent on each.
"""

import signal
import sys
import time

import rclpy
from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import String

PADDING = "." * 200


def main(topics: int, rate: float, seconds: float) -> None:
    """Send until the time is over."""
    rclpy.init()
    node = rclpy.create_node("many")
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    publishers = [node.create_publisher(String, f"/many/topic_{k}", 10) for k in range(topics)]
    ended = []
    signal.signal(signal.SIGTERM, lambda *_: ended.append(True))
    while not all(publisher.get_subscription_count() for publisher in publishers):
        executor.spin_once(0.05)
    print("received", flush=True)
    began = due = time.monotonic()
    sent = 0
    while due < began + seconds and not ended:
        time.sleep(max(0.0, due - time.monotonic()))
        for publisher in publishers:
            publisher.publish(String(data=f"{sent} {PADDING}"))
        sent += 1
        due += 1.0 / rate
    for publisher in publishers:
        publisher.wait_for_all_acked()
    print(sent, flush=True)
    node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main(int(sys.argv[1]), float(sys.argv[2]), float(sys.argv[3]))
