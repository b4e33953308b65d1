# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A user's node that listens before a run begins gets every message of it, from the first on; what cannot be connected is named."""

import json
import os
import subprocess
import sys

import pytest
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy
from running_graph import BRIEF, rig_run

from rig_nodes.bags.reader import Bag
from rig_nodes.controllers.ros.domain import allocate, participants
from rig_nodes.nodes.qos import beyond, publisher_profile

TOPICS = ("/motor/state", "/controller/command", "/motor/command", "/rig/events")  # of the container, alfa46 and the sequencer
LISTENER = """
import json, sys
import rclpy
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile
from rclpy.task import Future
from rig_nodes.rig.configuration import load_rig
from rig_nodes.nodes.executor import events_executor
from rig_nodes.nodes.message_class import message_class

rclpy.init()
node, executor = rclpy.create_node("users_listener"), events_executor()
executor.add_node(node)
known = load_rig("hydmag").catalogue.topics
got, inputs = {topic: [] for topic in sys.argv[1:]}, []
for topic, numbers in got.items():
    kind, every = message_class(known[topic].ros_type), QoSProfile(depth=1, history=HistoryPolicy.KEEP_ALL)
    inputs.append(node.create_subscription(kind, topic, lambda message, numbers=numbers: numbers.append(message.seq), every))
late = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
node.create_subscription(message_class("rig_msgs/msg/OilState"), "/oil_supply/state", print, late)
print("listens", flush=True)
while not all(one.get_publisher_count() for one in inputs):
    executor.spin_until_future_complete(Future(), 0.05)
while any(one.get_publisher_count() for one in inputs):
    executor.spin_until_future_complete(Future(), 0.05)
executor.spin_until_future_complete(Future(), 0.2)
print(json.dumps(got))
"""


@pytest.mark.parametrize(
    "speed",
    [("--speed", "max"), pytest.param((), marks=(pytest.mark.against_the_clock, pytest.mark.campaign))],
    ids=["max", "real time"],
)
def test_a_listener_that_is_there_before_the_run_gets_its_first_message_and_all_others(tmp_path, monkeypatch, speed):
    with allocate() as domain:
        number = domain.number
    monkeypatch.setenv("ROS_DOMAIN_ID", str(number))
    command = [sys.executable, "-P", "-c", LISTENER, *TOPICS]
    listener = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=os.environ)
    try:
        assert listener.stdout.readline() == "listens\n"
        assert participants(number) == 1
        code, output = rig_run(tmp_path / "run", *speed, sequence=BRIEF)
        got = json.loads(listener.communicate(timeout=60)[0])
    finally:
        listener.kill()
        listener.wait()
    assert code == 0, output
    counts = Bag(tmp_path / "run").counts
    assert got == {topic: list(range(counts.get(topic, 0))) for topic in TOPICS}
    assert "2 subscriptions of other nodes to topics of container, 0 topics of them not connected" in output
    why = "users_listener on /oil_supply/state, which asks for messages from before it came (transient local)"
    assert output.count(f"not waited for, and receives nothing: {why}") == 1


def test_what_a_subscription_asks_for_beyond_the_offer_is_said_in_words():
    offered, asked = publisher_profile("measurement"), QoSProfile(depth=1)
    offered.deadline = Duration()
    assert beyond(offered, asked) == ""
    asked.deadline = Duration(seconds=2**31 - 1, nanoseconds=999_999_999)  # as DDS gives back what has none
    assert beyond(offered, asked) == ""
    asked.deadline = Duration(nanoseconds=50_000_000)
    asked.durability, asked.liveliness = DurabilityPolicy.TRANSIENT_LOCAL, LivelinessPolicy.MANUAL_BY_TOPIC
    asked.liveliness_lease_duration = Duration(seconds=1)
    offered.reliability = ReliabilityPolicy.BEST_EFFORT
    assert beyond(offered, asked) == (
        "reliable messages and messages from before it came (transient local) and a deadline of 0.05 s and manual liveliness "
        "and liveliness within 1 s"
    )
