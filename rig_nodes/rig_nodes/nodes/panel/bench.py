# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The ROS side of the operator's page: what a running rig publishes, and orders by its actions, services and parameters.

nodes.panel.panel uses it from its own thread. One thread serves ROS; its callbacks only store.
"""

from __future__ import annotations

import json
import queue
import re
import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from typing import TYPE_CHECKING, Any

import rclpy
from action_msgs.srv import CancelGoal
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.msg import ParameterEvent
from rcl_interfaces.srv import GetParameters, ListParameters, SetParameters, SetParametersAtomically
from rclpy.action import ActionClient
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future as RosFuture
from rig_msgs.action import RunSequence, Shift
from rig_msgs.msg import RunInfo
from std_srvs.srv import Trigger

from ...base import RigError
from ..executor import events_executor
from ..message_class import message_class
from ..qos import recorder_profile
from ..running_rig import DIAGNOSTICS, ROS_OWN, RUN_INFO, RefusedByRig

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from rclpy.client import Client

    from ...rig import Topic

SLICE, IDLE = 0.1, 2.0  # s after which the thread looks for jobs that wait for a server, and without any; new ones wake it
KEPT = 20_000  # messages of one topic that wait for the page's thread, 20 s at 1 kHz; the newest stay
FOUND = 10.0  # s in which the server of an action is found on a busy machine
BEHIND = 0.3  # s by which a busy machine may be behind with a topic, of which then the newest messages are received
SILENT = 5.0  # s without a word of a process on /diagnostics, where each speaks once a second, after which what it has said is old
RUNS = re.compile(r"runs '(.*?)', (?:step (\d+) of (\d+): )?(.*)", re.DOTALL)  # the sequencer there
PARAMETERS = "/parameter_events"
NODE = "panel"


class Bench:
    """A node in the rig's domain, served by a thread of its own.

    Every method may be called from another thread; orders return futures whose error is a RefusedByRig with the reason.

    Parameters
    ----------
    domain : int
        The ROS domain.
    """

    def __init__(self, domain: int) -> None:
        rclpy.init(args=[], domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
        self._node = rclpy.create_node(NODE, enable_rosout=False, start_parameter_services=False)
        self._executor = events_executor()
        self._executor.add_node(self._node)
        self._jobs: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._turn = RosFuture()  # ends the executor's wait
        self._stopping = threading.Event()
        self.failure: Exception | None = None  # what has ended the thread
        self._inputs: list = []
        self._clients: dict[str, Client] = {}
        self._fresh: dict[str, deque[bytes]] = {}
        self.records: deque[dict] = deque(maxlen=4)  # of rigs that have begun to run, not yet taken
        self.health: dict[str, tuple[float, Any]] = {}  # when it came, by time.monotonic(), and newest DiagnosticStatus by name
        self.changed: deque[tuple[str, Any]] = deque(maxlen=KEPT)  # full names and new values of parameters
        self._node.create_subscription(RunInfo, RUN_INFO, self._on_info, recorder_profile("latched"))
        self._node.create_subscription(DiagnosticArray, DIAGNOSTICS, self._on_health, 10)
        self._node.create_subscription(ParameterEvent, PARAMETERS, self._on_parameters, 1000)
        self._shift = ActionClient(self._node, Shift, "/controller/shift")
        self._sequence = ActionClient(self._node, RunSequence, "/sequencer/run")
        self._open: set[Future] = set()  # of the orders that have not ended
        self._thread = threading.Thread(target=self._serve, name="ros", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Leave the domain."""
        self._stopping.set()
        self._turn.set_result(None)
        self._thread.join()
        self._executor.remove_node(self._node)
        self._node.destroy_node()
        rclpy.shutdown()

    # ---- what the rig publishes

    def listen(self, topics: Collection[Topic], whole: Collection[str]) -> None:
        """Receive these topics in place of those before, ``whole`` without gaps; :meth:`take` gives their messages."""

        def begin() -> None:
            for one in self._inputs:
                self._node.destroy_subscription(one)
            self._fresh = {topic.name: deque(maxlen=KEPT) for topic in topics}
            self._inputs = [
                self._node.create_subscription(
                    message_class(topic.ros_type),
                    topic.name,
                    keeper(self._fresh[topic.name]),
                    profile(topic, topic.name in whole),
                    raw=True,
                )
                for topic in topics
            ]

        self._do(begin)

    def take(self) -> dict[str, list[bytes]]:
        """Return the messages that have come since the last call, by topic."""
        found = {}
        for topic, waiting in self._fresh.items():
            if waiting:
                found[topic] = [waiting.popleft() for _ in range(len(waiting))]
        return found

    def nodes(self) -> list[str]:
        """Return the names of all other nodes of the domain."""
        names = self._node.get_node_names_and_namespaces()
        found = {f"{space.rstrip('/')}/{name}".lstrip("/") for name, space in names if not name.startswith("_")}
        return sorted(found - {NODE})

    def holders(self) -> dict[str, bytes]:
        """Return the nodes that hold parameters, each with the number of its publisher, which is another after a restart."""
        found = self._node.get_publishers_info_by_topic(PARAMETERS)
        return {f"{one.node_namespace.rstrip('/')}/{one.node_name}".lstrip("/"): bytes(one.endpoint_gid) for one in found}

    def said(self) -> dict[str, tuple[Any, bool]]:
        """Return the newest word of each device and process on its health, and whether it is old, as nothing comes any more."""
        old = time.monotonic() - SILENT
        return {name: (one, came < old) for name, (came, one) in sorted(self.health.items())}

    @property
    def progress(self) -> dict[str, Any]:
        """The sequence that runs, whoever has started it, as the sequencer tells; ``text`` has why the last one has failed."""
        came, one = self.health.get("sequencer", (0.0, None))
        if one is None or came < time.monotonic() - SILENT:
            return {"running": False, "text": ""}
        if found := RUNS.fullmatch(one.message):
            return {"running": True, "step": int(found[2] or 0), "steps": int(found[3] or 1), "text": found[4]}
        return {"running": False, "text": one.message if one.level != DiagnosticStatus.OK else ""}

    def _on_info(self, message: RunInfo) -> None:
        try:
            self.records.append(json.loads(message.json)["configuration"])
        except (ValueError, KeyError, TypeError):
            pass  # not a record of this project's runs

    def _on_health(self, message: DiagnosticArray) -> None:
        now = time.monotonic()
        self.health.update((one.name.removeprefix("rig/"), (now, one)) for one in message.status)

    def _on_parameters(self, message: ParameterEvent) -> None:
        for one in (*message.new_parameters, *message.changed_parameters):
            self.changed.append((f"{message.node.lstrip('/')}.{one.name}", plain(parameter_value_to_python(one.value))))

    # ---- orders

    def trigger(self, name: str) -> Future:
        """Call a service of type Trigger; the result is its message."""

        def outcome(answer: Trigger.Response) -> str:
            if not answer.success:
                raise RefusedByRig(answer.message)
            return answer.message

        return self.call(Trigger, name, Trigger.Request(), outcome)

    def set(self, values: Mapping[str, Any]) -> Future:
        """Set parameters of one node, all or none, by their full names; the result is None."""
        node = next(iter(values)).partition(".")[0]
        parameters = [Parameter(name.partition(".")[2], value=value).to_parameter_msg() for name, value in values.items()]

        def outcome(answer: Any) -> None:
            results = getattr(answer, "results", None) or [answer.result]
            for one in results:
                if not one.successful:
                    raise RefusedByRig(one.reason)

        if len(parameters) == 1:
            return self.call(SetParameters, f"/{node}/set_parameters", SetParameters.Request(parameters=parameters), outcome)
        request = SetParametersAtomically.Request(parameters=parameters)
        return self.call(SetParametersAtomically, f"/{node}/set_parameters_atomically", request, outcome)

    def values(self, node: str) -> Future:
        """Return the parameters of a node by their full names, without those that ROS gives every node."""
        result: Future = Future()

        def named(names: list[str]) -> None:
            wanted = [name for name in names if name not in ROS_OWN]

            def outcome(answer: GetParameters.Response) -> dict[str, Any]:
                return {f"{node}.{name}": plain(parameter_value_to_python(value)) for name, value in zip(wanted, answer.values)}

            hand_on(self.call(GetParameters, f"/{node}/get_parameters", GetParameters.Request(names=wanted), outcome), result)

        listed = self.call(ListParameters, f"/{node}/list_parameters", ListParameters.Request(), lambda answer: answer.result.names)
        listed.add_done_callback(
            lambda done: hand_on(done, result) if done.cancelled() or done.exception() else named(done.result())
        )
        result.add_done_callback(lambda _: listed.cancel())
        return result

    def call(self, kind: type, name: str, request: Any, outcome: Callable[[Any], Any]) -> Future:
        """Call a service; the result is what ``outcome`` makes of its response."""
        result: Future = Future()
        self._open.add(result)
        result.add_done_callback(self._open.discard)

        def begin() -> None:
            if name not in self._clients:
                self._clients[name] = self._node.create_client(kind, name)
            client = self._clients[name]
            if result.done():
                return
            if client.service_is_ready():
                client.call_async(request).add_done_callback(lambda done: settle(result, lambda: outcome(done.result())))
            else:  # it is new to this node, or its server is away
                self._jobs.put(begin)

        self._do(begin)
        return result

    def shift(self, gear: int, accepted: Callable[[], None]) -> Future:
        """Order a gear by its number; ``accepted`` is called when the shift begins, the result is the message on its end."""
        return self._act(self._shift, Shift.Goal(gear=gear), accepted, "the shift controller", f"has no gear {gear}")

    def run_sequence(self, name: str, accepted: Callable[[], None]) -> Future:
        """Start a sequence; ``accepted`` is called when it begins, the result is the message on its end."""
        return self._act(self._sequence, RunSequence.Goal(name=name), accepted, "the sequencer", "has refused the sequence")

    def cancel_sequence(self) -> Future:
        """Cancel the sequence that runs, whoever has started it; the result is a sentence."""

        def outcome(answer: CancelGoal.Response) -> str:
            if answer.return_code != CancelGoal.Response.ERROR_NONE or not answer.goals_canceling:
                raise RefusedByRig("no sequence runs")
            return "the sequence is aborted"

        # a request without an id and without a stamp is for all goals (action_msgs/CancelGoal)
        return self.call(CancelGoal, "/sequencer/run/_action/cancel_goal", CancelGoal.Request(), outcome)

    def _act(self, client: ActionClient, goal: Any, accepted: Callable[[], None], server: str, rejected: str) -> Future:
        """Send a goal; ``server`` and ``rejected`` make the sentence of a goal that is not accepted."""
        result, asked = Future[str](), time.monotonic()
        self._open.add(result)
        result.add_done_callback(self._open.discard)

        def outcome(done: RosFuture) -> str:
            answer = done.result().result
            if not answer.success:
                raise RefusedByRig(answer.message)
            return answer.message

        def answered(done: RosFuture) -> None:
            handle = done.result()
            if handle.accepted:
                accepted()
                handle.get_result_async().add_done_callback(lambda ended: settle(result, lambda: outcome(ended)))
            else:
                settle(result, refuse(f"{server} {rejected}"))

        def begin() -> None:
            if result.done():
                return
            if client.server_is_ready():
                client.send_goal_async(goal).add_done_callback(answered)
            elif time.monotonic() - asked > FOUND:
                settle(result, refuse(f"{server} does not answer"))
            else:
                self._jobs.put(begin)

        self._do(begin)
        return result

    def forget(self, why: str) -> None:
        """Refuse all orders that have not ended, because the rig that they were for is gone; none acts on the next one."""

        def end() -> None:
            for one in list(self._open):
                settle(one, refuse(why))

        if self._open:
            self._do(end)

    # ---- the thread

    def _do(self, job: Callable[[], None]) -> None:
        """Have the thread do a job now."""
        self._jobs.put(job)
        self._turn.set_result(None)

    def _serve(self) -> None:
        try:
            while not self._stopping.is_set():
                self._turn = RosFuture()
                for _ in range(self._jobs.qsize()):
                    self._jobs.get()()
                # each call keeps 32 bytes for good (rclpy 7.1), so not ten a second; spin_once keeps nothing, but costs
                # 30 us a message beside other threads, and with events that it leaves behind rclpy has crashed
                self._executor.spin_until_future_complete(self._turn, SLICE if self._jobs.qsize() else IDLE)
        except Exception as error:
            self.failure = error


def profile(topic: Topic, whole: bool) -> QoSProfile:
    """Return how a topic is received: ``whole``, or as far as this process keeps up."""
    wanted = recorder_profile(topic.qos)
    if not whole and topic.rate:
        wanted.depth = max(10, round(BEHIND * topic.rate))
        # a reliable reader that falls behind would make the rig's publishers send again
        wanted.reliability = ReliabilityPolicy.BEST_EFFORT
    return wanted


def keeper(waiting: deque[bytes]) -> Callable[[bytes], None]:
    """Return the callback that stores messages; rclpy takes no built-in function."""
    return lambda data: waiting.append(data)


def refuse(why: str) -> Callable[[], Any]:
    """Return a function that raises RefusedByRig."""

    def act() -> None:
        raise RefusedByRig(why)

    return act


def settle(future: Future, outcome: Callable[[], Any]) -> None:
    """Give a future its result or its error, unless nobody waits for it any more or it has one."""
    if future.done() or not future.set_running_or_notify_cancel():
        return
    try:
        future.set_result(outcome())
    except RigError as error:
        future.set_exception(error)


def hand_on(source: Future, target: Future) -> None:
    """Give a future the outcome of another one."""
    source.add_done_callback(lambda done: settle(target, done.result))
    target.add_done_callback(lambda _: source.cancel())  # nobody waits for it any more


def plain(value: Any) -> bool | float | str | list[float] | None:
    """Return the value of a parameter with arrays as lists."""
    return value if isinstance(value, (bool, float, int, str)) or value is None else list(value)
