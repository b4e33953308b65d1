# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Helpers of the graph tests: a live graph under the supervisor, a client of it in this process, and `rig run`."""

import contextlib
import io
import os
import select
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import rclpy
from rclpy.action import ActionClient
from rclpy.context import Context
from rclpy.experimental import EventsExecutor
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from rig_nodes.cli.main import main
from rig_nodes.controllers.ros.domain import allocate
from rig_nodes.nodes.message_class import message_class
from rig_nodes.nodes.processes.supervisor import MODULES, Order, Supervisor
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.rig import Rig

CATALOGUE = load_rig("hydmag").catalogue

SHORT, BRIEF = (Path(__file__).with_name(name) for name in ("short.yaml", "brief.yaml"))
PATIENCE = 20.0


class Graph:
    """A rig that runs until closed or to the end of its sequence, under the same supervisor as `rig run`."""

    def __init__(self, folder: Path, sequence: str | None = None, **order):
        """Starts the graph; ``order`` holds fields of the supervisor's Order, e.g. speed for a run in lockstep."""
        self.folder = folder
        folder.mkdir()
        Rig(load_rig("hydmag")).advance_samples(1)  # compiles what is not compiled yet, outside the time limit below
        self.domain = allocate()
        self.reports = []
        order_of = Order(sequence, "hydmag", **order)
        self.supervisor = Supervisor(order_of, folder, self.domain, lambda t, text: self.reports.append(text))
        self._thread = threading.Thread(target=self.supervisor.run, daemon=True)  # pytest ends also where a failed test leaves it
        self._thread.start()
        if not self.supervisor.running.wait(PATIENCE) or self.supervisor.ended.is_set():
            self.close()
            raise AssertionError(f"the graph did not start: {self.reports}")

    def close(self):
        """Ends the graph in order; returns how it ended."""
        self.supervisor.stop()
        self._thread.join()
        self.domain.release()
        return self.supervisor.end


class Client:
    """A user's own node: plain rclpy, with the default quality of service unless another one is given."""

    def __init__(self, domain, discovery="LOCALHOST"):
        os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = discovery
        self.context = Context()
        rclpy.init(context=self.context, domain_id=domain.number, signal_handler_options=SignalHandlerOptions.NO)
        self.node = rclpy.create_node("user", context=self.context)
        self.executor = EventsExecutor(context=self.context)
        self.executor.add_node(self.node)
        self._services, self._subscriptions = {}, []

    def forget(self):
        """Ends all subscriptions, because unread messages would occupy the executor."""
        while self._subscriptions:
            self.node.destroy_subscription(self._subscriptions.pop())

    def close(self):
        self.executor.remove_node(self.node)
        self.executor.shutdown()  # otherwise it keeps the participant of DDS, which takes part in the domains of later tests
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)

    def until(self, predicate, what: str, timeout: float = PATIENCE):
        """Serves callbacks until the predicate is true; returns its value."""
        deadline = time.monotonic() + timeout
        while not (value := predicate()):
            assert time.monotonic() < deadline, f"waited {timeout} s for {what}"
            self.executor.spin_until_future_complete(Future(), 0.02)
        return value

    def until_silent(self, messages: list, seconds: float = 0.3):
        """Serves callbacks until for some seconds no message has come; only time can show that none is on its way."""
        last = [len(messages), time.monotonic()]

        def silent():
            if len(messages) != last[0]:
                last[:] = len(messages), time.monotonic()
            return time.monotonic() - last[1] > seconds

        self.until(silent, "silence")

    def listen(self, topic: str, depth: int = 1000) -> list:
        """Returns a list that grows with the messages of a topic.

        At depth 1 it receives only the newest message each time, so that a busy machine does not process old ones.
        """
        messages = []
        kind = message_class(CATALOGUE.topics[topic].ros_type)
        subscription = self.node.create_subscription(kind, topic, messages.append, QoSProfile(depth=depth))
        self._subscriptions.append(subscription)
        self.until(subscription.get_publisher_count, f"a publisher of {topic}")
        return messages

    def publisher(self, topic: str, profile=10):
        """Returns a publisher to which the graph is subscribed."""
        kind = message_class(CATALOGUE.topics[topic].ros_type)
        publisher = self.node.create_publisher(kind, topic, profile)
        # the two receivers are recorder and device
        self.until(lambda: publisher.get_subscription_count() >= 2, f"receivers of {topic}")
        return publisher

    def service(self, kind, name: str):
        """Returns the client of a service that is ready.

        A test creates it early where a call must not wait until client and service are connected.
        """
        if name not in self._services:
            self._services[name] = self.node.create_client(kind, name)
        self.until(self._services[name].service_is_ready, name)
        return self._services[name]

    def call(self, kind, name: str, again: float = 2.0, **fields):
        """Returns the response of a service to a request with these fields; the request is repeated after ``again`` seconds."""
        client, asked = self.service(kind, name), []

        def answered():
            # the request is repeated, because the server's answers may not yet reach the client
            if not asked or time.monotonic() - asked[-1][1] > again:
                asked.append((client.call_async(kind.Request(**fields)), time.monotonic()))
            return next((future for future, _ in asked if future.done()), None)

        future = self.until(answered, f"the answer of {name}")
        return future.result()

    def order(self, kind, name: str, goal) -> "Goal":
        """Sends a goal."""
        client = ActionClient(self.node, kind, name)
        self.until(client.server_is_ready, name)
        return Goal(self, client, goal)


class Goal:
    """A goal that was sent: ``feedback`` collects its feedback, and :meth:`result` waits for the end and sets ``status``."""

    def __init__(self, user: Client, client: ActionClient, goal):
        self.user, self.client, self.feedback, self._result, self.status = user, client, [], [], None
        future = client.send_goal_async(goal, feedback_callback=lambda message: self.feedback.append(message.feedback))
        user.until(future.done, "the goal's acceptance")
        self.handle = future.result()
        assert self.handle.accepted
        self.handle.get_result_async().add_done_callback(self._on_result)

    def _on_result(self, future):
        self.status = future.result().status
        self._result.append(future.result().result)

    def cancel(self):
        """Response to a request to cancel it."""
        future = self.handle.cancel_goal_async()
        self.user.until(future.done, "the answer to the cancel request")
        return future.result()

    def result(self):
        """Returns the result when the goal has ended."""
        self.user.until(lambda: self._result, "the goal's result")
        return self._result[0]


def rig_run(folder: Path, *arguments: str, sequence: Path = SHORT) -> tuple[int, str]:
    """Returns exit code and output of a `rig run` that is not disturbed; it runs in this process, its graph in others."""
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    output = io.StringIO()
    try:
        with contextlib.redirect_stdout(output), contextlib.redirect_stderr(output):
            code = main(["run", str(sequence), "--out", str(folder), *arguments])
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
    return code, output.getvalue()


class RigRun:
    """`rig run` in a process of its own, as in a terminal."""

    def __init__(self, folder: Path, *arguments: str, sequence=SHORT, env=None):
        command = [sys.executable, "-P", "-m", "rig_nodes", "run", str(sequence), "--out", str(folder), *arguments]
        self.folder, self.output = folder, []
        # unset as for most users: with it, the order of stdout and stderr would not depend on the program's flushes
        plain = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
        self.process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True, env=plain | (env or {})
        )

    def until(self, text: str) -> str:
        """Reads the output up to a line with this text."""
        for line in self.process.stdout:
            self.output.append(line)
            if text in line:
                return line
        raise AssertionError(f"'{text}' was never printed:\n" + "".join(self.output))

    def ctrl_c(self):
        """Sends SIGINT to the whole foreground group, as a terminal does on Ctrl-C."""
        os.killpg(self.process.pid, signal.SIGINT)

    def children(self) -> dict[str, int]:
        """Returns the process ids of the graph by the names of the processes."""
        found = {}
        for stat in Path("/proc").glob("[0-9]*/stat"):
            try:
                pid, _, rest = stat.read_text().partition(" (")
                name, _, fields = rest.rpartition(") ")
            except OSError:
                continue
            found[int(pid)] = (name, int(fields.split()[1]))
        servers = {pid for pid, (_, parent) in found.items() if parent == self.process.pid}
        return {name: pid for pid, (name, parent) in found.items() if parent in servers and name in MODULES}

    def end(self) -> tuple[int, str]:
        """Returns exit code and whole output."""
        rest, _ = self.process.communicate(timeout=60)
        return self.process.returncode, "".join(self.output) + rest


class Traces:
    """Processes and shared memory that a run uses at this time, for a later check that they are gone."""

    def __init__(self, run: RigRun):
        self.children = run.children()
        self._descriptors = [os.pidfd_open(pid) for pid in self.children.values()]

    def shared_memory(self) -> list[str]:
        """Returns the Fast DDS segments that the processes use."""
        maps = "".join(Path(f"/proc/{pid}/maps").read_text() for pid in self.children.values())
        return [line for line in maps.splitlines() if "/dev/shm/fastrtps" in line]

    def wait_gone(self):
        """Waits until all processes have ended."""
        for descriptor in self._descriptors:
            ready, _, _ = select.select([descriptor], [], [], PATIENCE)
            os.close(descriptor)
            assert ready, "a process of the graph is still there"
