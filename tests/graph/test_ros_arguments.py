# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Arguments after --ros-args: used as by every ROS program, or refused in one sentence before any process starts."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest
from rcl_interfaces.srv import GetParameters
from rclpy.parameter_client import AsyncParameterClient
from rig_msgs.msg import RigState
from running_graph import Client
from std_srvs.srv import Trigger
from verbs import Verbs

from rig_nodes.bags.reader import Bag
from rig_nodes.cli.main import main
from rig_nodes.controllers.ros.domain import allocate, environment
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.rig import Rig

SAMPLE = Path(__file__).parents[2] / "bags" / "sample"
PATIENCE = 60.0
REPLAY, DEVICE = "rig_nodes.cli.replay:node", "rig_nodes.nodes.cut_device:main"


@pytest.fixture(scope="module")
def domain():
    with allocate() as domain:
        yield domain


def of(name: str) -> str:
    """Returns the entry point of one of the graph's processes."""
    return f"rig_nodes.nodes.{name}:main"


@pytest.fixture(scope="module")
def outcome(domain):
    """Returns exit code, stdout and stderr of an executable, in a new process in which Python is loaded already."""
    with Verbs() as verbs:
        yield lambda start, *arguments: verbs.of(start, *arguments, env=environment(domain))


NAMESPACE = "--ros-args -r __ns:=/left: the rig has no namespace"


@pytest.mark.parametrize(
    "start, arguments",
    [
        (of("rig_container"), []),
        (of("alfa46"), []),
        (of("sequencer"), ["--sequence", "demo"]),
        (of("recorder"), ["--out", "nowhere", "--name", "x"]),
        (DEVICE, ["motor"]),
        (REPLAY, [str(SAMPLE)]),
    ],
    ids=["container", "alfa46", "sequencer", "recorder", "device", "replay"],
)
def test_no_executable_takes_a_namespace(outcome, tmp_path, monkeypatch, start, arguments):
    monkeypatch.chdir(tmp_path)
    code, _, error = outcome(start, *arguments, "--ros-args", "-r", "__ns:=/left")
    assert code == 2 and NAMESPACE in error and error.count("\n") == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "start, arguments, ros, sentence",
    [
        (of("rig_container"), [], ["-r", "__node:=lab"], "so these cannot change"),
        (of("rig_container"), [], ["-p", "motor:sped:=100.0"], "no parameter of /motor 'sped'; did you mean 'speed'?"),
        (of("rig_container"), [], ["-p", "valve_zr_p1:gain:=1.0"], "there is no parameter of /valve_zr_p1 'gain'"),
        (of("rig_container"), [], ["-p", "motor:speed:=5000.0"], "parameters of /motor from the command line"),
        (of("alfa46"), [], ["-p", "motor:speed:=100.0"], "there is no node /motor here; expected one of /alfa46"),
        (of("alfa46"), [], ["-p", "t12:=9.0"], "Parameter t12 out of range"),
        (of("alfa46"), [], ["-p", "output_1.currents:=[0.3, 0.3, 0.9, 0.3, 0.2, 0.0]"], "output_1.P3 asks for 900 mA"),
        (REPLAY, [str(SAMPLE)], ["-p", "rig_replay:rate:=2.0"], "there is no parameter of /rig_replay 'rate'"),
        (REPLAY, [str(SAMPLE)], ["-r", "nonsense"], "--ros-args: Failed to parse ROS arguments"),
    ],
    ids=lambda value: value[-1] if isinstance(value, list) and value else "",
)
def test_what_cannot_be_honoured_is_refused_in_one_sentence(outcome, start, arguments, ros, sentence):
    code, _, error = outcome(start, *arguments, "--ros-args", *ros)
    assert code == 2 and "Traceback" not in error
    assert sentence in error.splitlines()[-1]


def test_the_rig_command_says_who_takes_them(capsys):
    assert main(["list", "rigs", "--ros-args", "-r", "a:=b"]) == 2
    assert "the executables of `ros2 run rig_nodes` and the launch file take it" in capsys.readouterr().err


def test_a_replay_takes_remappings_and_is_listed_at_once(domain):
    user = Client(domain)
    start = "import pkgutil, sys; sys.exit(pkgutil.resolve_name(sys.argv.pop(1))())"
    replay = subprocess.Popen(
        [
            sys.executable,
            "-c",
            start,
            REPLAY,
            str(SAMPLE),
            "--loop",
            "--ros-args",
            "-r",
            "/motor/m_wej:=/left/m_wej",
            "--log-level",
            "warn",
        ],
        env=environment(domain),
        stdout=subprocess.DEVNULL,
    )
    try:
        user.until(lambda: user.node.count_publishers("/left/m_wej"), "the topic under its other name", PATIENCE)
        assert user.node.count_publishers("/motor/m_wej") == 0
        # `ros2 param list` asks every node that it sees for this, and waits 5 s for the answer
        client = AsyncParameterClient(user.node, "rig_replay")
        user.until(client.services_are_ready, "the parameters of the replay", 2.0)
        names = client.list_parameters()
        user.until(names.done, "their names", 2.0)
        assert "use_sim_time" in names.result().result.names
    finally:
        replay.send_signal(signal.SIGINT)
        assert replay.wait(PATIENCE) == 130
        user.close()


@pytest.mark.against_the_clock
def test_parameters_of_a_command_line_and_a_file_act_and_stand_in_the_bag(domain, tmp_path):
    """Launch passes them on in this form: SetParameter and a file for all nodes go to every process."""
    Rig(load_rig("hydmag")).advance_samples(1)  # compiles what is not compiled yet, outside the time limit below
    (tmp_path / "logs").mkdir()
    (tmp_path / "lab.yaml").write_text(
        "motor:\n  ros__parameters: {speed: 100.0}\n"
        "/alfa46:\n  ros__parameters: {t21: 0.125, output_1.currents: "
        "[0.3, 0.25, 0.6, 0.3, 0.2, 0.0]}\nmotr:\n  ros__parameters: {speed: 1.0}\n"
    )
    ros = ["--ros-args", "-p", "t12:=0.25", "--params-file", str(tmp_path / "lab.yaml")]
    processes = {}
    for name, arguments in (
        ("recorder", ["--out", str(tmp_path / "bag"), "--name", "x"]),
        ("alfa46", []),
        ("rig_container", []),
        ("sequencer", []),
    ):
        with open(tmp_path / "logs" / f"{name}.log", "wb") as log:
            processes[name] = subprocess.Popen(
                [sys.executable, "-P", "-m", f"rig_nodes.nodes.{name}", *arguments, "--recorded", *ros],
                stdout=log,
                stderr=log,
                env=environment(domain),
            )
    user = Client(domain)
    try:
        states, motor = user.listen("/rig/state"), user.listen("/motor/state")
        ready = RigState.READY, RigState.RUNNING
        user.until(lambda: states and states[-1].state in ready and motor, "a rig", PATIENCE)
        for node, values in (("motor", {"speed": 100.0}), ("alfa46", {"t12": 0.25, "t21": 0.125})):
            answer = user.call(GetParameters, f"/{node}/get_parameters", names=list(values))
            assert [value.double_value for value in answer.values] == list(values.values())
        assert user.call(Trigger, "/rig/end").success
        for name in ("rig_container", "alfa46", "sequencer", "recorder"):
            if name != "rig_container":
                processes[name].send_signal(signal.SIGTERM)
            assert processes[name].wait(PATIENCE) == 0, (tmp_path / "logs" / f"{name}.log").read_text()
    finally:
        user.close()
        for process in processes.values():
            process.kill()
            process.wait()
    texts = {text for _, _, name, text, _ in Bag(tmp_path / "bag").events() if name == "setting_changed"}
    assert {"motor.speed = 100 rad/s", "alfa46.t12 = 0.25 s", "alfa46.t21 = 0.125 s"} <= texts
    log = (tmp_path / "logs" / "rig_container.log").read_text()
    assert "its entry /motr is for no node here" in log
    assert "--ros-args -p t12:=0.25: none of /rig, /motor" in log and "nothing done here" in log
