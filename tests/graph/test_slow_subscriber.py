# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A reliable subscriber that no longer reads does not affect the rig: it causes no trip, no lost message and no processor time."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from rig_msgs.msg import RigState
from running_graph import Client, Graph

from rig_nodes.bags.reader import Bag
from rig_nodes.nodes.processes.result import facts_of, lost_messages

pytestmark = pytest.mark.against_the_clock

TOPICS = ("/instruments/controller", "/controller/command")  # 1 kHz each
DEAF = """
import sys, time
import rclpy
from rclpy.qos import HistoryPolicy, QoSProfile
from rig_nodes.rig.configuration import load_rig
from rig_nodes.nodes.message_class import message_class

rclpy.init()
node, profile = rclpy.create_node("deaf"), QoSProfile(depth=1000, history=HistoryPolicy.KEEP_ALL)
known = load_rig("hydmag").catalogue.topics
made = [node.create_subscription(message_class(known[t].ros_type), t, print, profile, raw=True) for t in sys.argv[1:]]
while not all(one.get_publisher_count() for one in made):
    time.sleep(0.02)
print("connected", flush=True)
sys.stdin.read()
"""


@pytest.fixture(scope="module")
def graph(tmp_path_factory):
    graph = Graph(tmp_path_factory.mktemp("graph") / "deaf")
    yield graph
    graph.close()


@pytest.fixture
def deaf(graph):
    """A process that has subscribed and was then stopped by the kernel."""
    found = os.environ | {"ROS_DOMAIN_ID": str(graph.domain.number), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    process = subprocess.Popen(
        [sys.executable, "-P", "-c", DEAF, *TOPICS], env=found, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout.readline() == "connected\n"
    os.kill(process.pid, signal.SIGSTOP)
    yield process
    process.kill()
    process.communicate()


def senders_again(pid):
    """Scheduling policy of each thread of Fast DDS that repeats messages, and of the process's other threads of DDS."""
    policies = {True: [], False: []}
    for thread in os.listdir(f"/proc/{pid}/task"):
        name = Path(f"/proc/{pid}/task/{thread}/comm").read_text()
        if name.startswith("dds."):
            policy = os.sched_getscheduler(int(thread)) & ~os.SCHED_RESET_ON_FORK
            policies[name.startswith("dds.asyn")].append(policy)
    return policies[True], policies[False]


def test_a_subscriber_that_stands_still_neither_trips_the_rig_nor_costs_a_message(graph, deaf):
    user = Client(graph.domain)
    try:
        states = user.listen("/rig/state", depth=1)
        first = user.until(lambda: states and states[-1].seq, "a state")
        user.until(lambda: states[-1].seq > first + 200, "a second of the run")
        assert states[-1].state == RigState.READY, states[-1].reason
    finally:
        user.close()
    # The cost of a slow subscriber appears only after seconds of undelivered messages, which is too long for a test. So the test
    # checks the property that limits the cost: the threads that repeat messages have the lowest priority on the machine.
    for name in ("container", "alfa46", "recorder"):
        again, others = senders_again(graph.supervisor.children[name].pid)
        assert again and set(again) == {os.SCHED_OTHER}, name
        if others.count(os.SCHED_FIFO) == 0:
            pytest.skip("no real-time priority is allowed here, so there is nothing to give way to")
    os.kill(deaf.pid, signal.SIGCONT)  # the end of a process waits up to 2 s for subscribers that lack something
    end = graph.close()
    assert (end.state, end.reason) == ("interrupted", "stopped"), "it ran until the test stopped it"
    assert lost_messages(Bag(graph.folder), facts_of(graph.folder)) == {}
