# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A separate process that receives topics and writes, per topic, the number of messages and a hash over them in order of arrival.

Arguments: file to write, then topic=package/msg/Name pairs. It ends when all publishers have ended and no message arrives any
more. For /clock it also writes the times.
"""

import json
import sys
import time

import rclpy
from rclpy.experimental import EventsExecutor
from rclpy.qos import HistoryPolicy
from rclpy.task import Future
from streams import Streams

from rig_nodes.bags import cdr
from rig_nodes.nodes.message_class import message_class
from rig_nodes.nodes.qos import publisher_profile, recorder_profile
from rig_nodes.rig.configuration import load_rig

PATIENCE = 60.0  # s; longest wait for a message, in case that a publisher never starts


def main(out, pairs):
    rclpy.init()
    node = rclpy.create_node("listener")
    executor = EventsExecutor()
    executor.add_node(node)
    streams, times, inputs = Streams(), [], []

    def keep(topic, ros_type):
        def on_message(data):
            streams.add(topic, ros_type, data)
            if topic == "/clock":
                clock = cdr.decode(ros_type, data).clock
                times.append(clock.sec * 10**9 + clock.nanosec)

        return on_message

    for topic, ros_type in (pair.split("=") for pair in pairs):
        known = load_rig("hydmag").catalogue.topics.get(topic)
        profile = recorder_profile(known.qos) if known else publisher_profile("measurement")
        profile.history = HistoryPolicy.KEEP_ALL  # only with this history does a full receiver hold up the sender
        inputs.append(node.create_subscription(message_class(ros_type), topic, keep(topic, ros_type), profile, raw=True))
    deadline = time.monotonic() + PATIENCE
    met = left = False
    before = -1
    while time.monotonic() < deadline and not (left and streams.total == before):
        if streams.total != before:
            before, deadline = streams.total, time.monotonic() + PATIENCE
        executor.spin_until_future_complete(Future(), 0.05)
        there = sum(bool(i.get_publisher_count()) for i in inputs)
        met = met or there == len(inputs)
        left = met and not there
    with open(out, "w", encoding="utf-8") as file:
        json.dump({"topics": streams.found(), "clock": times}, file)
    executor.remove_node(node)
    node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
