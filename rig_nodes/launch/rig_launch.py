# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""`ros2 launch rig_nodes rig_launch.py`: the rig in real time as nodes of the terminal's ROS domain.

Needs a ROS 2 Jazzy with its launch package (docs/how_to/ros2.md), as `./rig run` does not. Numerics stay out of here: the
Python of `ros2` may be another one than that of the nodes, with ruamel.yaml but without what pip installs.
"""

import re
import shlex
import signal
import subprocess
from pathlib import Path

from ament_index_python.packages import get_package_prefix
from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, EmitEvent, LogInfo, OpaqueFunction, RegisterEventHandler, TimerAction
from launch.event_handlers import OnProcessExit
from launch.events import Shutdown, matches_action
from launch.events.process import ProcessExited, SignalProcess
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from rig_nodes.base import DEFAULT_RIG, RigError, has_controller, rig_of
from rig_nodes.controllers import check_namespace, from_environment
from rig_nodes.nodes import MODULES, Order, TopicChoice, processes_of
from rig_nodes.runs import run_folder

ARGUMENTS = (
    (
        "sequence",
        "",
        "name or .yaml file of a sequence, with whose end the launch ends; "
        "empty: the rig runs until Ctrl-C and takes orders over ROS",
    ),
    ("with", "", "values of the sequence's parameters, NAME=VALUE, several with commas between them"),
    (
        "rig",
        "",
        f"name, folder or .yaml file of the rig; empty: the one that the sequence is written for, {DEFAULT_RIG} without a sequence",
    ),
    ("set", "", "values of the rig to change, KEY=VALUE as for ./rig run --set, several with commas between them"),
    ("out", "", "new or empty folder for bag, report and logs; empty: runs/<sequence>-<n>"),
    ("seed", "1", "seed of the transducers' noise and errors"),
    (
        "controller",
        "",
        "your controller in place of the Alfa46: python:FILE.py:CLASS, c:FILE.c, ros:NAME or another "
        "of docs/how_to/controllers.md; not for a bench",
    ),
    ("delay", "1", "samples of 1 ms from a measurement to the effect of the controller's answer to it"),
    (
        "topics",
        "",
        "regular expression: beside the rig's own topics, record only those whose whole name matches; empty: "
        "every topic of the ROS domain",
    ),
    ("exclude", "", "regular expression: beside the rig's own topics, record none whose whole name matches"),
    ("recording", "", "further options of the recorder as `ros2 run rig_nodes recorder --help` lists them, e.g. '--keep-last 30'"),
)
AFTER_FAILURE = 1.0  # s in which the rig notices that its controller is gone and the bag gets the safe state
END_ORDER = ("rig_container", "alfa46", "recorder")  # each receives everything of those before it


class Run:
    """One run: its processes, and what the end of one means for the others."""

    def __init__(self, sequence: str, folder: Path | None) -> None:
        """folder: of the bag; None without a recorder."""
        self.sequence, self.folder = sequence, folder
        self.nodes: dict[str, Node] = {}  # by executable
        self.gone: dict[str, int] = {}  # exit codes
        self.reason = ""  # why the run failed, empty when nothing did

    def add(self, executable: str, *arguments: str) -> None:
        """One process. It gets no node name: the container hosts many nodes with names of their own."""
        logs = ["--logs", str(self.folder / "logs"), "--recorded"] if self.folder else []
        self.nodes[executable] = Node(package="rig_nodes", executable=executable, arguments=[*arguments, *logs], output="screen")

    def on_exit(self, event: ProcessExited, context: LaunchContext) -> list:
        """A process is gone: go on with the orderly end, or end all others with the reason."""
        name = next((name for name, node in self.nodes.items() if node is event.action), None)
        if name is None:
            return []
        self.gone[name] = event.returncode
        if len(self.gone) == len(self.nodes):
            return self.finish()
        if context.is_shutdown:
            return []
        if self.orderly():
            waiting = [node for node in END_ORDER if node in self.nodes and node not in self.gone]
            return [stop(self.nodes[waiting[0]])]
        if name == "rig_container" and event.returncode == 0 and not self.reason:
            if self.sequence:
                self.reason = "ended by /rig/end before its sequence was done"
            return [EmitEvent(event=Shutdown(reason="the rig was ended by /rig/end"))]
        if not self.reason:
            self.reason = self.why(name, event.returncode)
            over = EmitEvent(event=Shutdown(reason=self.reason))
            return [LogInfo(msg=f"the rig ends: {self.reason}"), TimerAction(period=AFTER_FAILURE, actions=[over])]
        return []

    def orderly(self) -> bool:
        """True when the sequence came to its end and every process that is gone went well."""
        return bool(self.sequence) and "sequencer" in self.gone and not any(self.gone.values())

    def why(self, name: str, code: int) -> str:
        """Sentence on a process whose end was not wanted."""
        if name == "sequencer" and self.sequence and code == 1:
            return "the sequence failed, the sequencer has printed the reason above"
        how = f"killed by signal {-code}" if code < 0 else f"ended with exit code {code}"
        return f"{name} {how}"

    def finish(self) -> list:
        """All processes are gone: the report of what was recorded, then the end of the launch."""
        if self.folder is not None and self.gone["recorder"] == 0:
            rig = Path(get_package_prefix("rig_nodes"), "lib", "rig_nodes", "rig")
            # In shutdown, launch starts no further process as an action.
            subprocess.run([rig, "report", self.folder], check=False)
        if self.reason:
            raise RuntimeError(self.reason)  # the exit code of `ros2 launch`
        reason = "the sequence ended" if self.sequence else "all processes ended"
        return [EmitEvent(event=Shutdown(reason=reason))]


def stop(node: Node) -> EmitEvent:
    """SIGTERM: the orderly end of a process; launch's own SIGINT means that the run is not done."""
    return EmitEvent(event=SignalProcess(signal_number=signal.SIGTERM, process_matcher=matches_action(node)))


def ordered(given: dict[str, str]) -> Order:
    """The run that the launch arguments describe; RigError for a controller where there is nothing to control."""
    rig = given["rig"] or (rig_of(given["sequence"], DEFAULT_RIG) if given["sequence"] else DEFAULT_RIG)
    processes = processes_of(has_controller(rig))
    if "alfa46" not in processes and (given["controller"] or given["delay"] != "1"):
        raise RigError(f"the rig '{rig}' has no valves for a shift controller; leave out controller and delay")
    TopicChoice(given["topics"] or None, given["exclude"] or None)
    choice = [part for name in ("topics", "exclude") if given[name] for part in (f"--{name}", given[name])]
    for name in ("seed", "delay"):
        if not given[name].isdecimal():
            raise RigError(f"{name}:={given[name]}: expected a whole number")
    return Order(
        given["sequence"] or None,
        rig,
        int(given["seed"]),
        pairs(given["set"]),
        controller=given["controller"] or None,
        parameters=pairs(given["with"]),
        processes=processes,
        delay=int(given["delay"]),
        recording=(*choice, *shlex.split(given["recording"])),
    )


def pairs(text: str) -> list[str]:
    """NAME=VALUE,NAME=VALUE as single ones; a comma belongs to the value unless a name follows it."""
    return [pair.strip() for pair in re.split(r",(?=\s*[\w.]+\s*=)", text) if pair.strip()]


def start(context: LaunchContext) -> list:
    """The processes, with the values of the launch arguments."""
    check_namespace(context.launch_configurations.get("ros_namespace", ""), "PushRosNamespace")
    given = {name: LaunchConfiguration(name).perform(context) for name, *_ in ARGUMENTS}
    record = LaunchConfiguration("record").perform(context) == "true"
    sequence = given["sequence"]
    order = ordered(given)
    name = Path(sequence).stem or "by_hand"
    with from_environment(keep=True) as domain:
        domain.lead()  # from here on the container does
    folder = run_folder(given["out"] or None, name) if record else None
    run = Run(sequence, folder)
    more = {"sequencer": ["--once"] if sequence else []}
    if folder is not None:
        (folder / "logs").mkdir()
        more["recorder"] = ["--out", str(folder), "--name", name]
    for process in order.processes:
        if process != "recorder" or record:
            run.add(MODULES[process], *order.arguments(process), *more.get(process, []))
    return [RegisterEventHandler(OnProcessExit(on_exit=run.on_exit)), *run.nodes.values()]


def generate_launch_description() -> LaunchDescription:
    """Called by ros2 launch."""
    declared = [DeclareLaunchArgument(name, default_value=default, description=text) for name, default, text in ARGUMENTS]
    record = DeclareLaunchArgument(
        "record", default_value="true", choices=["true", "false"], description="record a bag with a report"
    )
    return LaunchDescription([*declared, record, OpaqueFunction(function=start)])
