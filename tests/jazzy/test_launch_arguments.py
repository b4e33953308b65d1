# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The arguments of the launch file and those of the processes that it starts; needs no ROS 2 command line."""

import importlib.util
import os
import subprocess
import sys
from argparse import ArgumentParser
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import MagicMock

import pytest

from rig_nodes.base.errors import RigError
from rig_nodes.nodes import recorder
from rig_nodes.nodes.process import ordered
from rig_nodes.nodes.processes.supervisor import Order
from rig_nodes.rig.configuration import load_rig
from rig_nodes.rig.signal_catalogue import installed_topics

LAUNCH_FILE = Path(__file__).resolve().parents[2] / "rig_nodes" / "launch" / "rig_launch.py"
OF_LAUNCH = (
    "launch",
    "launch.actions",
    "launch.event_handlers",
    "launch.events",
    "launch.events.process",
    "launch.substitutions",
    "launch_ros",
    "launch_ros.actions",
)


@pytest.fixture
def launch_file(monkeypatch):
    """The launch file as a module, with stand-ins for the packages of launch."""
    for name in OF_LAUNCH:
        monkeypatch.setitem(sys.modules, name, MagicMock())
    spec = importlib.util.spec_from_file_location("rig_launch", LAUNCH_FILE)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def given(launch_file, **arguments) -> dict[str, str]:
    return {name: default for name, default, _ in launch_file.ARGUMENTS} | arguments


def test_a_bench_sequence_is_launched_on_its_own_rig_without_a_shift_controller(launch_file):
    order = launch_file.ordered(given(launch_file, sequence="clutch_bench"))
    assert order.processes == ("recorder", "container", "sequencer")
    assert "--rig clutch_bench --sequence clutch_bench" in " ".join(order.arguments("sequencer"))
    by_hand = launch_file.ordered(given(launch_file, rig="spring_bench"))
    assert by_hand.sequence is None and "alfa46" not in by_hand.processes
    with pytest.raises(RigError, match="'cylinder_bench' has no valves for a shift controller; leave out controller"):
        launch_file.ordered(given(launch_file, sequence="cylinder_bench", controller="udp:9000"))


def test_the_gearbox_rig_is_launched_with_everything_that_was_given(launch_file):
    order = launch_file.ordered(
        given(
            launch_file,
            sequence="demo",
            seed="3",
            delay="2",
            **{"set": "alfa46.t12=200 ms, wiring=swapped", "with": "pressures=1 MPa, 2 MPa,speed=40 rpm"},
        )
    )
    rig = ["--rig", "hydmag", "--set", "alfa46.t12=200 ms", "--set", "wiring=swapped"]
    chosen = ["--sequence", "demo", "--with", "pressures=1 MPa, 2 MPa", "--with", "speed=40 rpm"]
    assert order.arguments("container") == [*rig, *chosen, "--seed", "3", "--delay", "2"]
    assert order.arguments("alfa46") == rig
    assert order.arguments("sequencer") == [*rig, *chosen]
    with pytest.raises(RigError, match="seed:=one: expected a whole number"):
        launch_file.ordered(given(launch_file, seed="one"))


def test_the_launch_file_reads_names_without_the_packages_that_the_system_lacks():
    blocked = "import sys; sys.modules.update(dict.fromkeys(('numba', 'scipy', 'mcap', 'rosbags', 'rclpy')));"
    asked = (
        "import rig_nodes.nodes.processes.supervisor, rig_nodes.runs.folders; from rig_nodes.base.names import *;"
        "print(has_controller(rig_of('spring_bench', DEFAULT_RIG)), has_controller(rig_of('demo', DEFAULT_RIG)))"
    )
    done = subprocess.run([sys.executable, "-c", blocked + asked], capture_output=True, text=True)
    assert done.stdout.split() == ["False", "True"], done.stderr


def test_a_pushed_namespace_is_refused_before_anything_starts(launch_file):
    context = SimpleNamespace(launch_configurations={"ros_namespace": "/left"})
    with pytest.raises(RigError, match="PushRosNamespace: the rig has no namespace"):
        launch_file.start(context)


@pytest.mark.parametrize("sequence, reason", [("", ""), ("demo", "ended by /rig/end before its sequence was done")])
def test_a_rig_that_is_told_to_end_ends_the_launch_and_fails_only_a_sequence(launch_file, sequence, reason):
    run = launch_file.Run(sequence, None)
    run.nodes = {name: object() for name in ("rig_container", "alfa46", "sequencer")}
    gone = SimpleNamespace(action=run.nodes["rig_container"], returncode=0)
    assert len(run.on_exit(gone, SimpleNamespace(is_shutdown=False))) == 1
    assert launch_file.Shutdown.call_args.kwargs == {"reason": "the rig was ended by /rig/end"}
    assert run.reason == reason


@pytest.mark.parametrize(
    "rig, sequence, name", [(None, "clutch_bench", "clutch_bench"), (None, None, "hydmag"), ("spring_bench", None, "spring_bench")]
)
def test_a_process_takes_the_rig_of_its_sequence_unless_it_is_told_another(rig, sequence, name):
    assert ordered(SimpleNamespace(rig=rig, sequence=sequence, settings=[])).config.name == name


OF_A_DEVICE, OF_A_CONTROLLER = {"/motor/cut/port", "/motor/cut/answer"}, {"/controller/signals", "/controller/channels"}


@pytest.mark.parametrize(
    "rig, settings, controller, more",
    [
        ("hydmag", [], None, set()),
        ("hydmag", [], "alfa46@duty", set()),
        ("hydmag", ["motor.source=topic"], None, OF_A_DEVICE),
        ("hydmag", [], "udp:9000@current", OF_A_CONTROLLER),
        ("spring_bench", [], None, set()),
    ],
)
def test_the_recorder_takes_the_topics_of_its_rig_and_no_other(rig, settings, controller, more):
    order = Order(None, rig, settings=settings, controller=controller)
    parser = ArgumentParser()
    for flag, keywords in recorder.OPTIONS:
        parser.add_argument(flag, **keywords)
    given = parser.parse_args(["--out", "x", "--name", "x", *order.arguments("recorder")])
    assert recorder.topics_of(given)[1] == set(load_rig(rig).catalogue.topics) | more
    not_given = parser.parse_args(["--out", "x", "--name", "x"])
    assert recorder.topics_of(not_given)[1] == set(installed_topics())


RUN = "import sys; from rig_nodes.nodes.sequencer import main; sys.exit(main())"


@pytest.mark.parametrize(
    "before, arguments, sentence",
    [
        ("", ["--once", "--ros-args", "-r", "a:=b", "--", "--sequence", "nowhere"], "there is no sequence 'nowhere'"),
        ("", ["--ros-args", "-r", "nonsense"], "--ros-args: Failed to parse ROS arguments: Couldn't parse remap rule"),
        (
            "import sys, rclpy; sys.modules['rclpy.experimental'] = None;",
            ["--sequence", "demo"],
            "the rig needs rclpy 7.1.4 or newer",
        ),
    ],
    ids=["behind-ros-args", "wrong-ros-args", "old-rclpy"],
)
def test_a_process_says_in_one_sentence_what_stops_it(before, arguments, sentence, domain):
    done = subprocess.run(
        [sys.executable, "-c", before + RUN, *arguments],
        capture_output=True,
        text=True,
        timeout=60,
        env=dict(os.environ, ROS_DOMAIN_ID=str(domain)),
    )
    assert done.returncode == 2 and sentence in done.stderr and "Traceback" not in done.stderr
