# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Current setpoints over ROS in real time: from a controller of the run, and from a node of the user."""

import numpy as np
import pytest
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import QoSProfile
from rig_msgs.action import RunSequence
from rig_msgs.msg import ControllerSample, RigState, ValveCommand
from running_graph import SHORT, Client, Graph

from rig_nodes.analysis.run_report import build_report
from rig_nodes.bags.reader import Bag
from rig_nodes.nodes.processes.result import facts_of, lost_messages

pytestmark = pytest.mark.against_the_clock

# a controller that answers no sample and so leaves every one to the user's node
SILENT = """
from rig_nodes.controllers import ControllerOutputs, Status


class Silent:
    def initialize(self, info):
        pass

    def step(self, inputs):
        return ControllerOutputs(status=Status.DISCARD)

    def terminate(self):
        pass
"""


def test_a_sequence_runs_at_level_current_and_the_gains_are_the_rigs(tmp_path):
    graph = Graph(tmp_path / "graph", controller="alfa46@current")
    user = Client(graph.domain)
    try:
        client = AsyncParameterClient(user.node, "alfa46")
        user.until(client.services_are_ready, "the parameters of alfa46")
        for name, value, taken in (("gain_p", 10.0, False), ("t12", -0.2, True)):
            future = client.set_parameters([Parameter(name, value=value)])
            user.until(future.done, "the answer")
            (result,) = future.result().results
            assert result.successful is taken and ("power stage closes the loop" in result.reason) is not taken
        result = user.order(RunSequence, "/sequencer/run", RunSequence.Goal(name=str(SHORT))).result()
        assert result.success, result.message
    finally:
        user.close()
        graph.close()
    bag, facts = Bag(graph.folder), facts_of(graph.folder)
    assert facts["alfa46"]["controller"] == {"name": "alfa46", "level": "current", "level_from": "as given"}
    assert lost_messages(bag, facts) == {}
    (shift,) = build_report(bag, bag.run_info())["shifts"]
    assert (shift["from_gear"], shift["to_gear"], shift["valid"]) == (1, 2, True)
    commands = [message for _, message in bag.messages("/controller/command")]
    assert {message.level for message in commands} == {ValveCommand.LEVEL_CURRENT}
    assert not any(np.any(message.duty) for message in commands)
    t, wanted = bag.series("I_set_zr_p1")
    held = t[wanted == 0.74]
    t, current = bag.series("I_zr_p1")
    assert abs(np.mean(current[(t > held[0] + 0.5) & (t < held[-1])]) - 0.74) < 0.005, "P3 of Tab. 7.5"


def test_a_node_of_the_users_own_sends_setpoints(tmp_path):
    plug = tmp_path / "silent.py"
    plug.write_text(SILENT)
    graph = Graph(tmp_path / "graph", controller=f"python:{plug}:Silent")
    user = Client(graph.domain)
    try:
        states, events, coil = (user.listen(t) for t in ("/rig/state", "/rig/events", "/valve_zr_p1/current"))
        valve = user.listen("/valve_zr_p1/state")
        profile = QoSProfile(depth=1)
        publisher = user.publisher("/controller/command", profile)
        send = {"level": ValveCommand.LEVEL_CURRENT}

        def on_sample(sample):
            publisher.publish(ValveCommand(sample=sample.sample, setpoint=[0.4, 0.0, 0.0], gear=1, **send))

        user.until(lambda: states and states[-1].state == RigState.STARTING, "a rig without commands")
        user.node.create_subscription(ControllerSample, "/instruments/controller", on_sample, QoSProfile(depth=10))
        user.until(lambda: states[-1].state == RigState.READY, "the first command")
        user.until(lambda: coil and coil[-1].value == pytest.approx(0.4, abs=0.01), "0.4 A in the coil")
        assert valve[-1].duty > 0.2, "the rig's own power stage drives it"
        send["level"] = ValveCommand.LEVEL_DUTY  # this is refused in mid-run, and the rig trips because nothing else comes
        user.until(lambda: any(e.name == "command_refused" for e in events), "the refusal")
        text = next(e.text for e in events if e.name == "command_refused")
        assert "takes commands at level 'current', found one at level 'duty'; the level stays until its end" in text
        user.until(lambda: states[-1].state == RigState.TRIPPED, "the safe state")
        assert "older than 100 ms" in states[-1].reason
        assert len([e for e in events if e.name == "command_refused"]) <= 2
    finally:
        user.close()
        graph.close()
