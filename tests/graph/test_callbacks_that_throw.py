# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Callbacks that a process gives to ROS are made to throw: the rig goes into its safe state, by name, without a zombie.

The callbacks are those that the processes themselves register (broken_callback.py). A few are thrown in always, all of them on
demand: `./rig test -m campaign tests/graph/test_callbacks_that_throw.py` prints how many.
"""

import importlib
import os
import time

import pytest
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.action import ActionClient
from rclpy.task import Future
from running_graph import Client, Graph

from rig_nodes.nodes.processes import supervisor
from rig_nodes.nodes.processes.child import Child

HELPER = "broken_callback"
FEW = (
    ("container", "create_service rig ~/e_stop"),
    ("container", "create_timer rig 0.05"),
    ("alfa46", "create_subscription alfa46 /rig/state"),
    ("alfa46", "goal_callback alfa46 /controller/shift"),
)
WITHIN = 60.0  # s of wall clock on a busy machine


class BrokenGraph(Graph):
    """A graph operated by hand, one of whose processes has a callback that throws."""

    def __init__(self, folder, monkeypatch, process, label):
        self.label, self.labels, self.armed = label, folder / "labels", folder / "armed"

        def child(name, module, arguments, logs, env, links=None, life=1):
            if name == process and life == 1:
                env = {**env, "BROKEN": f"{module}:{label}", "LABELS": str(self.labels), "ARMED": str(self.armed)}
                module = HELPER
            made = Child(name, module, arguments, logs, env, links, life)
            self.pids.append(made.pid)
            return made

        self.pids = []
        monkeypatch.setattr(supervisor, "Child", child)
        super().__init__(folder)

    def poke(self):
        """Has the callback called, where nothing in the graph does so."""
        kind, node, *what = self.label.split(" ", 2)
        user = Client(self.domain)
        try:
            name = what[0].replace("~", f"/{node}") if what else ""
            name = name if name.startswith("/") or not name else f"/{name}"
            act = self._act(user, kind, node, name)
            self.armed.touch()  # not before: where the graph itself calls the callback, the rig has soon ended
            until = time.monotonic() + WITHIN
            while time.monotonic() < until and not self.told():
                act()  # again and again, because the first may not arrive everywhere
                user.executor.spin_until_future_complete(Future(), 0.3)
        finally:
            user.close()

    def _act(self, user, kind, node, name):
        """Returns a function that has the callback called."""
        if kind == "create_service":
            of = _type_of(user, user.node.get_service_names_and_types, name)
            client = user.service(of, name)
            return lambda: client.call_async(of.Request())
        if kind == "create_subscription":
            message = _type_of(user, user.node.get_topic_names_and_types, name)
            publisher = user.node.create_publisher(message, name, 10)
            return lambda: publisher.publish(message())
        if "parameters" in kind:
            client = user.service(SetParameters, f"/{node}/set_parameters")
            value = Parameter(name="use_sim_time", value=ParameterValue(type=1, bool_value=True))
            return lambda: client.call_async(SetParameters.Request(parameters=[value]))
        if kind.endswith("_callback"):
            action = _type_of(user, user.node.get_topic_names_and_types, f"{name}/_action/feedback")
            client = ActionClient(user.node, action, name)
            return lambda: client.send_goal_async(action.Goal())
        return lambda: None

    def told(self):
        """The supervisor's lines on the callback."""
        return [text for text in self.reports if "died of ValueError: thrown by" in text] or self.supervisor.ended.is_set()


def _type_of(user, names_and_types, name):
    """The class of a topic or service by its name."""
    found = user.until(lambda: dict(names_and_types()).get(name), name)[0]
    package, kind, of = found.removesuffix("_FeedbackMessage").split("/")
    return getattr(importlib.import_module(f"{package}.{kind}"), of)


def thrown(folder, monkeypatch, process, label):
    """Returns (how the run ended, lines for people, numbers of its processes) of a graph in which a callback was made to throw."""
    graph = BrokenGraph(folder, monkeypatch, process, label)
    try:
        graph.poke()
    finally:
        end = graph.close()
    return end, graph.reports, graph.pids


def check_safe(process, end, reports, log):
    """The rig tripped, and the sentence has the exception, whichever way it went."""
    told = " ".join([end.reason, *reports])
    assert "the rig is tripped: " in told, (process, told)
    assert "died of ValueError: thrown by " in told + log, (process, told)


def gone(pid):
    """Returns whether a process has ended."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return True
    return False


@pytest.mark.parametrize("process, label", FEW)
def test_a_callback_that_throws_is_the_safe_state_by_name(process, label, tmp_path, monkeypatch):
    end, reports, pids = thrown(tmp_path / "run", monkeypatch, process, label)
    check_safe(process, end, reports, (tmp_path / "run" / "logs" / f"{process}.log").read_text())
    assert all(map(gone, pids))


@pytest.mark.against_the_clock
@pytest.mark.campaign
@pytest.mark.parametrize("process", ["container", "alfa46", "sequencer", "recorder"])
def test_each_callback_of_a_process_that_throws_is_the_safe_state(process, tmp_path, monkeypatch):
    graph = BrokenGraph(tmp_path / "all", monkeypatch, process, "none")
    graph.close()
    labels = dict.fromkeys(graph.labels.read_text().splitlines())
    wrong = []
    for number, label in enumerate(labels):
        folder = tmp_path / str(number)
        end, reports, pids = thrown(folder, monkeypatch, process, label)
        try:
            check_safe(process, end, reports, (folder / "logs" / f"{process}.log").read_text())
            assert all(map(gone, pids))
        except AssertionError as error:
            wrong.append(f"{label}: {error}")
    print(f"{process}: {len(labels)} callbacks made to throw, {len(wrong)} not the safe state")
    assert not wrong, wrong
