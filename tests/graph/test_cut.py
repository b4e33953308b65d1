# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Devices in processes of their own: the bits of `simulate` in lockstep, and the rig's reaction when they stop answering."""

import json
import math
import os
import re
import signal
import subprocess
import sys

import pytest
from running_graph import BRIEF, RigRun

from rig_nodes.bags.reader import Bag
from rig_nodes.cli.main import main
from rig_nodes.controllers.ros.domain import Domain, allocate, environment
from rig_nodes.nodes import cut_device
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.sequence import load_sequence
from rig_nodes.runs.simulation import simulate

NOT_THE_PLANTS = {"/controller/events", "/diagnostics", "/parameter_events", "/rosout", "all"}
GATE = "import sys; from rig_nodes.nodes import rig_container as c; c.GATE_TIMEOUT = 2.0; sys.exit(c.main())"


class DeviceProcess:
    """`rig device NAME` as in a second terminal; signals go to the node itself."""

    def __init__(self, name: str, domain: int):
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-m", "rig_nodes", "device", name, "--domain", str(domain)],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )
        self.output = ""

    def until(self, text: str) -> None:
        """Reads the output up to a line with this text."""
        for line in self.process.stdout:
            self.output += line
            if text in line:
                return
        raise AssertionError(f"'{text}' was never said:\n{self.output}")

    def end(self, number=signal.SIGINT) -> int:
        """Ends it by a signal; returns its exit code."""
        self.process.send_signal(number)
        self.output += self.process.communicate(timeout=20)[0]
        return self.process.returncode


@pytest.fixture
def start():
    """Starts devices in the run's domain that end with the test: (run, names) -> processes."""
    started = []

    def start(run, *names):
        domain = int(re.search(r"--domain (\d+)", run.until("is cut out; start it with: ./rig device"))[1])
        new = [DeviceProcess(name, domain) for name in names]
        started.extend(new)
        return new

    yield start
    for device in started:
        if device.process.poll() is None:
            device.process.kill()
            device.process.communicate()


def cut(*names):
    return [part for name in names for part in ("--set", f"{name}.source=topic")]


def messages(bag, topic):
    return [data for _, data in bag.raw(topic)]


def test_lockstep_gives_the_bits_of_simulate(tmp_path, start):
    names = ("motor", "valve_zr_p1")
    run = RigRun(tmp_path / "run", "--speed", "max", *cut(*names), sequence=BRIEF)
    devices = start(run, *names)
    config = load_rig("hydmag", {f"{name}.source": "topic" for name in names})
    simulate(config, load_sequence(BRIEF, default="hydmag"), tmp_path / "sim")
    code, output = run.end()
    assert code == 0, output
    ours, theirs = Bag(tmp_path / "sim"), Bag(run.folder)
    assert theirs.check() == [] and json.loads((run.folder / "report.json").read_text())["run"]["lost"] == 0
    answers = {f"/{name}/cut/answer" for name in names}
    a, b = ours.canonical_hash(), theirs.canonical_hash()
    assert {topic for topic in {*a, *b} if a.get(topic) != b.get(topic)} <= answers | NOT_THE_PLANTS
    for topic in answers:
        # on the graph the message of the last port may be answered too, although the run ends with it
        mine, its = messages(ours, topic), messages(theirs, topic)
        assert len(mine) > 500 and its[: len(mine)] == mine and len(its) - len(mine) <= 1
    for device in devices:
        device.until("the rig has left")
        assert device.end() == 0 and "Traceback" not in device.output


@pytest.mark.against_the_clock
def test_a_killed_device_trips_the_rig_within_100_ms_and_is_named(tmp_path, start):
    run = RigRun(tmp_path / "run", *cut("motor"))
    (device,) = start(run, "motor")
    run.until("wait until n_wej above")
    device.process.kill()
    code, output = run.end()
    assert code == 1
    reason = "motor: no answer on /motor/cut/answer for 100 ms"
    assert reason in output.splitlines()[-1]
    bag = Bag(run.folder)
    last = [message.sample for _, message in bag.messages("/motor/cut/answer")][-1] * 1e-3
    (tripped,) = [t for t, _, name, text, _ in bag.events() if name == "rig_tripped" and text == reason]
    assert 0.1 < tripped - last < 0.106
    assert [m.torque for _, m in bag.messages("/motor/state")][-1] == 0.0


def test_a_device_that_hangs_in_lockstep_trips_after_the_step_timeout(tmp_path, start):
    run = RigRun(tmp_path / "run", "--speed", "1", "--step-timeout", "3", *cut("load_pump"))
    (device,) = start(run, "load_pump")
    run.until("shift to I")
    device.process.send_signal(signal.SIGSTOP)
    code, output = run.end()
    device.process.send_signal(signal.SIGCONT)
    assert code == 1
    assert "load_pump: no answer on /load_pump/cut/answer within 3 s of real time" in output.splitlines()[-1]
    assert Bag(run.folder).check() == []


def test_without_its_device_the_rig_does_not_start_and_says_how():
    with allocate() as domain:
        env = os.environ | {"ROS_DOMAIN_ID": str(domain.number)}
        done = subprocess.run(
            [sys.executable, "-P", "-c", GATE, *cut("motor")], env=env, text=True, capture_output=True, timeout=60
        )
        assert done.returncode != 0 and "Traceback" not in done.stderr
        start = f"./rig device motor --domain {domain.number}"
        assert f"motor is cut out and no node answers /motor/cut/port; start its node with: {start}" in done.stderr


def test_a_device_without_a_rig_says_so_and_ends_in_order():
    with allocate() as domain:
        device = DeviceProcess("valve_zr_p1", domain.number)
        device.until(f"there is no rig in ROS domain {domain.number} yet")
        assert device.end(signal.SIGTERM) == 0


@pytest.mark.parametrize(
    "module, arguments, sentence",
    [
        ("cli.main", ["device", "gearbox"], "gearbox cannot be cut out of the plant: its shafts carry"),
        ("nodes.cut_device", ["clutch_s1"], "clutch_s1 cannot be cut out of the plant: clutches that lock"),
        ("nodes.cut_device", ["motr"], "there is no device 'motr'"),
        ("nodes.cut_device", [], "name the device that the rig has cut out, e.g. device motor"),
        ("cli.main", ["device", "motor"], "give --domain N"),
        ("cli.main", ["device", "motor", "--domain", "300"], "expected a number from 0 to 232"),
        ("cli.main", ["device", "motor", "--domain", "3", "--set", "motor.ramp=3 Nm"], "is a torque"),
    ],
)
def test_what_is_no_device_is_refused_in_one_sentence(module, arguments, sentence, capsys, monkeypatch):
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    monkeypatch.setattr(sys, "argv", [module, *arguments])
    monkeypatch.setattr(os, "execve", lambda *_: pytest.fail("it became a device"))
    assert (main() if module == "cli.main" else cut_device.main()) == 2
    error = capsys.readouterr().err
    assert sentence in error and len(error.strip().splitlines()) == 1


STRONG = (
    "import sys; from rig_nodes.nodes import cut_device as d; from rig_nodes.plant.engine.outside import Answer, OtherSide\n"
    "def step(self, port, ticks=1, old=OtherSide.step):\n"
    "    self.ticks = getattr(self, 'ticks', 0) + ticks\n"
    "    answer = old(self, port, ticks)\n"
    "    return answer._replace(torque=1e308) if self.ticks > 200 else answer\n"
    "OtherSide.step = step; sys.argv[1:1] = ['motor']; sys.exit(d.main())"
)


def test_a_torque_that_no_speed_can_follow_trips_the_rig_and_is_in_no_message(tmp_path):
    run = RigRun(tmp_path / "run", "--speed", "max", *cut("motor"))
    domain = re.search(r"--domain (\d+)", run.until("is cut out; start it with: ./rig device"))[1]
    device = subprocess.Popen(
        [sys.executable, "-P", "-c", STRONG],
        env=environment(Domain(int(domain))),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        code, output = run.end()
    finally:
        device.kill()
        device.wait()
    last = output.splitlines()[-1]
    assert code == 1 and re.search(
        r"^rig: .* became (-?inf|nan) between \d+\.\d{3} s and \d+\.\d{3} s, which is no finite "
        "number",
        last,
    ), output
    end = json.loads((run.folder / "report.json").read_text())["run"]["end"]
    assert end["reason"] in last
    bag = Bag(run.folder)
    assert bag.check() == []
    assert all(math.isfinite(value) for name in ("n_wej", "n_wyj", "M_wej") for value in bag.series(name)[1])
