# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A rig that runs in another process, over DDS, for the commands gear, set, stop, reset and status.

cli.by_hand uses it and sets up the environment before ROS is loaded.
"""

from __future__ import annotations

import json
import math
import os
import time
from collections.abc import Callable
from functools import cached_property
from typing import Any, NamedTuple

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.srv import GetParameters, ListParameters, SetParameters
from rclpy.action import ActionClient
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from rig_msgs.action import Shift
from rig_msgs.msg import RigState, RunInfo
from std_srvs.srv import Trigger

from ..base import RigError
from ..rig import (
    CONTROLLER_COMMAND,
    QUANTITIES,
    Catalogue,
    Setting,
    Settings,
    Transmission,
    catalogue,
    own_setting,
    settings_of,
    structure_of,
    transmission_of,
)
from .executor import events_executor
from .message_class import message_class
from .qos import recorder_profile

PATIENCE, AGAIN = 5.0, 1.0  # s for an answer, and until a request without an answer is repeated
LONGEST_SHIFT = 30.0  # s
STATUS = 2.0  # s for a whole status; what is missing by then, e.g. because there is no recorder, is left out
ROS_OWN = ("use_sim_time", "start_type_description_service")  # parameters of every node
STATES = {value: name for name, value in vars(RigState).items() if name.isupper() and isinstance(value, int)}
RUN_INFO, STATE, DIAGNOSTICS = "/rig/run_info", "/rig/state", "/diagnostics"


class RefusedByRig(RigError):
    """Something that the rig refused to do; the message has its reason."""

    exit_code = 1


class Turned(NamedTuple):
    """A setting with its present value."""

    setting: Setting
    value: bool | float | list[float]

    def parsed(self, text: str) -> bool | float | list[float]:
        """Return the SI value of what a person wrote; RigError when it is no such value or out of range."""
        setting = self.setting
        if setting.numbers == 1:
            value = setting.value_of(text, setting.name)
            return value if isinstance(value, bool) else float(value)
        return [float(setting.value_of(part.strip(), setting.name)) for part in text.split(",")]

    def __str__(self) -> str:
        """Return the value as people read it."""
        if isinstance(self.value, bool):
            return "on" if self.value else "off"
        if isinstance(self.value, float):
            return shown(self.value, self.setting.unit)
        return ", ".join(shown(number, self.setting.unit) for number in self.value)

    def range(self) -> str:
        """Return the range as people read it; empty when there is none."""
        one = self.setting
        return f"{shown(one.low, one.unit)} to {shown(one.high, one.unit)}" if one.is_number and math.isfinite(one.low) else ""


def read_in(unit: str) -> tuple[str, float]:
    """Return the unit in which people read a quantity, and the factor to it, from its SI unit."""
    like = next((one for one in QUANTITIES.values() if one.unit.replace("N.m", "Nm") == unit), None)
    return (unit, 1.0) if like is None else (like.display, like.scale)


def shown(value: float, unit: str) -> str:
    """Return a value [SI] as text in the unit in which people read its quantity."""
    unit, scale = read_in(unit)
    return f"{value * scale:.5g} {unit}".rstrip()


class RunningRig:
    """The rig in a ROS domain, as a context manager; RigError when it does not answer in time."""

    def __init__(self, number: int) -> None:
        self.number = number
        rclpy.init(args=[], domain_id=number, signal_handler_options=SignalHandlerOptions.NO)
        # not needed of a node that lives for a second; the description of types alone costs 0.1 s
        silent = [Parameter("start_type_description_service", value=False)]
        self.node = rclpy.create_node(
            f"rig_command_{os.getpid()}", enable_rosout=False, start_parameter_services=False, parameter_overrides=silent
        )
        self.executor = events_executor()
        self.executor.add_node(self.node)
        self._info = []
        self.node.create_subscription(RunInfo, RUN_INFO, self._info.append, recorder_profile("latched"))

    def __enter__(self) -> RunningRig:
        return self

    def __exit__(self, *_: object) -> None:
        self.executor.remove_node(self.node)
        self.node.destroy_node()
        rclpy.shutdown()

    def until(self, predicate: Callable, what: str, seconds: float = PATIENCE) -> Any:
        """Return the predicate's value as soon as it is true.

        Parameters
        ----------
        predicate : callable
            It is called again and again.
        what : str
            What is awaited, for the error.
        seconds : float
            Longest time [s].

        Returns
        -------
        object
            The value.

        Raises
        ------
        RigError
            When it takes longer.
        """
        deadline = time.monotonic() + seconds
        while not (value := predicate()):
            if time.monotonic() > deadline:
                raise RigError(f"the rig in ROS domain {self.number} does not answer: no {what} within {seconds:g} s")
            self.executor.spin_until_future_complete(Future(), 0.005)
        return value

    def _listen(self, topic: str, callback: Callable[[Any], None]) -> None:
        known = self.catalogue.all_topics[topic]
        self.node.create_subscription(message_class(known.ros_type), topic, callback, recorder_profile(known.qos))

    @cached_property
    def configuration(self) -> dict:
        """The record of the rig's configuration."""
        info = self.until(lambda: self._info, RUN_INFO)[0]
        return json.loads(info.json)["configuration"]

    @cached_property
    def catalogue(self) -> Catalogue:
        """The rig's topics and signals."""
        return catalogue(self.configuration)

    @cached_property
    def transmission(self) -> Transmission:
        """The rig's gears; RigError when it has none."""
        if CONTROLLER_COMMAND not in self.catalogue.topics:
            raise RigError(f"the rig '{self.configuration['name']}' in ROS domain {self.number} has no gears")
        return transmission_of(self.configuration)

    # ---- orders

    def _ask(self, asked: dict[str, tuple]) -> dict:
        """The responses of services by name; ``asked`` has their types and requests by name."""
        clients = {name: self.node.create_client(kind, name) for name, (kind, _) in asked.items()}
        for name, client in clients.items():
            self.until(client.service_is_ready, name)
        sent = {name: [] for name in clients}

        def answered() -> dict[str, list[Future]] | None:
            # repeated after a while, because a server that does not know the client yet sends no answer
            now = time.monotonic()
            for name, calls in sent.items():
                if not calls or (now - calls[-1][1] > AGAIN and not any(future.done() for future, _ in calls)):
                    calls.append((clients[name].call_async(asked[name][1]), now))
            done = {name: [future for future, _ in calls if future.done()] for name, calls in sent.items()}
            return done if all(done.values()) else None

        done = self.until(answered, f"answer of {' or '.join(clients)}") if clients else {}
        return {name: futures[0].result() for name, futures in done.items()}

    def trigger(self, name: str) -> str:
        """Call a service of type Trigger and return its message on what it has done; RefusedByRig when it has refused."""
        answer = self._ask({name: (Trigger, Trigger.Request())})[name]
        if not answer.success:
            raise RefusedByRig(answer.message)
        return answer.message

    def shift(self, gear: int) -> str:
        """Order a gear by its number, wait for the end of the shift and return its message; RefusedByRig when it failed."""
        client = ActionClient(self.node, Shift, "/controller/shift")
        self.until(client.server_is_ready, "shift controller")
        asked = client.send_goal_async(Shift.Goal(gear=gear))
        self.until(asked.done, "answer of the shift controller")
        if not asked.result().accepted:
            raise RefusedByRig(f"the shift controller has no gear {gear}")
        ended = asked.result().get_result_async()
        result = self.until(lambda: ended.done() and ended.result().result, "end of the shift", LONGEST_SHIFT)
        if not result.success:
            raise RefusedByRig(result.message)
        return result.message

    # ---- settings

    @cached_property
    def known(self) -> Settings:
        """The settings of this rig, without those that a user's controller has itself."""
        return settings_of(structure_of(self.configuration["structure"]), self.configuration)

    def settings(self, nodes: list[str] | None = None) -> dict[str, Turned]:
        """Return all settings that can be changed at some nodes (default: all), by ``node.name``."""
        if nodes is None:
            nodes = sorted(self._nodes())
        lists = self._ask({f"/{node}/list_parameters": (ListParameters, ListParameters.Request()) for node in nodes})
        names = {node: [name for name in lists[f"/{node}/list_parameters"].result.names if name not in ROS_OWN] for node in nodes}
        answers = self._ask(
            {f"/{node}/get_parameters": (GetParameters, GetParameters.Request(names=names[node])) for node in nodes if names[node]}
        )
        found = {}
        for node in filter(names.get, nodes):
            for key, value in zip(names[node], map(parameter_value_to_python, answers[f"/{node}/get_parameters"].values)):
                name = f"{node}.{key}"
                setting = self.known.get(name) or own_setting(name)
                found[name] = Turned(setting, value if isinstance(value, (bool, float)) else list(value))
        return found

    def _nodes(self) -> set[str]:
        return {one.owner for one in self.known.values() if one.live and not one.lacking}

    def setting(self, name: str) -> Turned:
        """Return a setting by its full name; RigError, with the names most like it, when there is none."""
        node = name.partition(".")[0]
        found = self.settings([node]) if node in self._nodes() else {}
        if name not in found:
            self.known.find(name).check_lives()
            raise RigError(f"{name} is not there while the rig runs as it does")
        return found[name]

    def set(self, name: str, text: str) -> Turned:
        """Set a value as a person writes it, and return the setting with the new value; RefusedByRig with the reason."""
        turned = self.setting(name)
        value = turned.parsed(text)
        node, _, parameter = name.partition(".")
        service = f"/{node}/set_parameters"
        request = SetParameters.Request(parameters=[Parameter(parameter, value=value).to_parameter_msg()])
        (result,) = self._ask({service: (SetParameters, request)})[service].results
        if not result.successful:
            raise RefusedByRig(result.reason)
        return turned._replace(value=value)

    # ---- status

    def status(self) -> dict:
        """Return what the rig does now, for people and programs: state, signals [SI], controller, devices, recording."""
        messages, health = {}, {}
        self.node.create_subscription(
            DiagnosticArray,
            DIAGNOSTICS,
            lambda message: health.update((status.name.removeprefix("rig/"), status) for status in message.status),
            10,
        )
        self._listen(STATE, lambda message: messages.update({STATE: message}))
        known = self.catalogue
        signals = [signal for signal in known.signals.values() if known.topics[signal.topic].type == "Measurement"]
        topics = {signal.topic for signal in signals} | ({CONTROLLER_COMMAND} & known.topics.keys())
        for topic in topics:
            self._listen(topic, lambda message, topic=topic: messages.update({topic: message}))
        self.until(lambda: STATE in messages, STATE)
        processes = {"rig", "sequencer", "recorder"} | ({"alfa46"} if CONTROLLER_COMMAND in known.topics else set())
        try:
            self.until(lambda: topics <= messages.keys() and processes <= health.keys(), "whole status", STATUS)
        except RigError:
            pass  # what has arrived is reported
        state = messages[STATE]
        recorder = health.get("recorder")
        counts = {} if recorder is None else {value.key: value.value for value in recorder.values}
        content = {
            "domain": self.number,
            "time_s": state.header.stamp.sec + state.header.stamp.nanosec * 1e-9,
            "state": STATES[state.state],
            "reason": state.reason,
            "rig": self.configuration["name"],
            "signals": {
                signal.name: {"value": messages[signal.topic].value, "unit": signal.unit}
                for signal in signals
                if signal.topic in messages
            },
            "recording": recorder is not None,
            "recorded": int(counts.get("received", 0)),
            "lost": int(counts.get("overflow", 0)) + int(counts.get("unreadable", 0)),
            "devices": {
                name: {"level": ("OK", "WARN", "ERROR", "STALE")[status.level[0]], "message": status.message}
                for name, status in sorted(health.items())
            },
        }
        if CONTROLLER_COMMAND in messages:
            content |= {"gear": messages[CONTROLLER_COMMAND].gear, "shifting": messages[CONTROLLER_COMMAND].shifting}
        return content
