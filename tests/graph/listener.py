# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A process of its own that receives topics as raw bytes and writes them to a file in the order in which they came.

Arguments: file to write, then topic=package/msg/Name pairs. It ends when all publishers have left and
nothing comes any more.
"""

import pickle
import sys
import time

import rclpy
from rclpy.experimental import EventsExecutor
from rclpy.qos import HistoryPolicy
from rclpy.task import Future

from rig_nodes.catalogue import catalogue
from rig_nodes.nodes.message_class import message_class
from rig_nodes.nodes.qos import publisher_profile, recorder_profile

PATIENCE = 60.0


def main(out, pairs):
    rclpy.init()
    node = rclpy.create_node("listener")
    executor = EventsExecutor()
    executor.add_node(node)
    came, inputs = [], []
    for topic, ros_type in (pair.split("=") for pair in pairs):
        known = catalogue().topics.get(topic)
        profile = recorder_profile(known.qos) if known else publisher_profile("measurement")
        profile.history = HistoryPolicy.KEEP_ALL  # only with this history does a full receiver hold up the sender
        keep = (lambda topic: lambda data: came.append((topic, data)))(topic)
        inputs.append(node.create_subscription(message_class(ros_type), topic, keep, profile, raw=True))
    deadline = time.monotonic() + PATIENCE
    met = left = False
    before = -1
    while time.monotonic() < deadline and not (left and len(came) == before):
        before = len(came)
        executor.spin_until_future_complete(Future(), 0.05)
        there = sum(bool(i.get_publisher_count()) for i in inputs)
        met = met or there == len(inputs)
        left = met and not there
    with open(out, "wb") as file:
        pickle.dump(came, file)
    executor.remove_node(node)
    node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
