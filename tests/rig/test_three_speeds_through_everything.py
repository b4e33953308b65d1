# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The three-speed gearbox, which is only a folder, with every verb and plug with which the laboratory's rig is tested."""

import json
import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from rig_nodes.bags.reader import Bag
from rig_nodes.cli.main import main
from rig_nodes.controllers.ros.domain import allocate, use_own_transports
from rig_nodes.runs.fmu.drive import main as drive

SEQUENCE = str(Path(__file__).with_name("three.yaml"))
RIG = ("--rig", "three_speed")


def shifts(folder) -> list[tuple[int, int, bool]]:
    """Returns the gear changes in a report."""
    report = json.loads((Path(folder) / "report.json").read_text())
    assert report["run"]["lost"] == 0 and report["run"]["end"]["state"] == "ended", report["run"]["end"]
    return [(one["from_gear"], one["to_gear"], one["valid"]) for one in report["shifts"]]


BOTH = [(1, 2, True), (2, 3, True)]
IN_A_CAMPAIGN = [pytest.param(kind, marks=pytest.mark.campaign) for kind in ("python", "udp-python")]


@pytest.fixture(scope="module")
def simulated(tmp_path_factory):
    """The folder of a simulated run."""
    folder = tmp_path_factory.mktemp("runs") / "simulated"
    assert main(["simulate", SEQUENCE, *RIG, "--out", str(folder)]) == 0
    return folder


def rig(*arguments, **keywords):
    return subprocess.run([sys.executable, "-m", "rig_nodes", *arguments], text=True, capture_output=True, timeout=200, **keywords)


def test_simulate_and_report(simulated, capsys):
    assert shifts(simulated) == BOTH
    assert main(["report", str(simulated)]) == 0
    output = capsys.readouterr().out
    assert "1 -> 2" in output and "2 -> 3" in output and "n_in rpm" in output


def test_run_in_lockstep_has_the_same_bits(simulated, tmp_path):
    done = rig("run", SEQUENCE, *RIG, "--speed", "max", "--out", str(tmp_path / "run"))
    assert done.returncode == 0, done.stdout + done.stderr
    mine, its = Bag(tmp_path / "run").canonical_hash(), Bag(simulated).canonical_hash()
    # orders reach the box over ROS, so the time of its events may differ
    assert {topic: mine[topic] for topic in its if topic not in ("/controller/events", "all")} == {
        topic: its[topic] for topic in its if topic not in ("/controller/events", "all")
    }


@pytest.mark.campaign
@pytest.mark.against_the_clock
def test_run_in_real_time(tmp_path):
    done = rig("run", SEQUENCE, *RIG, "--out", str(tmp_path / "run"))
    assert done.returncode == 0, done.stdout + done.stderr
    assert shifts(tmp_path / "run") == BOTH


def test_its_bag_is_replayed(simulated):
    done = rig("replay", str(simulated), "--rate", "20")
    assert done.returncode == 0, done.stdout + done.stderr


def test_view_has_the_rigs_own_clutches(simulated):
    pytest.importorskip("rerun")
    assert main(["view", str(simulated), "--no-open"]) == 0
    assert (simulated / "view.rrd").stat().st_size > 100_000


def test_sweep_over_a_delay_of_its_third_gear(tmp_path):
    out = tmp_path / "sweep"
    assert main(["sweep", SEQUENCE, *RIG, "--vary", "alfa46.t23=-250 ms, -150 ms", "--out", str(out), "--jobs", "2"]) == 0
    assert any(out.rglob("*.csv")) or any(out.rglob("*.parquet"))


def test_an_fmu_of_it_shifts(tmp_path):
    fmu = tmp_path / "three.fmu"
    assert main(["export", "fmu", *RIG, "-o", str(fmu)]) == 0
    assert drive([str(fmu), SEQUENCE, *RIG, "--out", str(tmp_path / "run")]) == 0
    assert shifts(tmp_path / "run") == BOTH


@pytest.fixture
def ros_domain():
    """A ROS domain of the test's own, also for the processes started there."""
    before = dict(os.environ)
    with allocate() as domain:
        os.environ["ROS_DOMAIN_ID"] = str(domain.number)
        use_own_transports()
        yield
    os.environ.clear()
    os.environ.update(before)


@pytest.fixture
def programs():
    """Starts programs, which end with the test."""
    started = []

    def start(command: list[str]) -> None:
        started.append(subprocess.Popen([sys.executable, *command[1:-1]], stderr=subprocess.PIPE, text=True))

    yield start
    for program in started:
        program.kill()
        program.communicate()


def printed(kind: str, capsys, on_own_port) -> list[list[str]]:
    """Returns the commands that `controller new` prints, at a port of the test's own; the folder is ``mine``."""
    assert main(["controller", "new", kind, "mine", *RIG]) == 0
    commands = capsys.readouterr().out.split("next:\n")[1]
    return [on_own_port(kind, shlex.split(line, comments=True)) for line in commands.splitlines()]


@pytest.mark.parametrize("kind", ["c", "ros-python", *IN_A_CAMPAIGN])
def test_a_controller_of_ones_own_shifts_it(kind, tmp_path, monkeypatch, capsys, ros_domain, programs, on_own_port):
    monkeypatch.chdir(tmp_path)
    for command in printed(kind, capsys, on_own_port):
        if "demo" in command:
            command[command.index("demo")] = SEQUENCE
            assert command[3:5] == ["--rig", "three_speed"], "the printed command is for the rig that was asked for"
            assert main([*command[1:], "--out", "run"]) == 0, capsys.readouterr().err
        elif command[-1] == "&":
            programs(command)
    assert shifts("run") == BOTH


# The set measures how long a step takes.
@pytest.mark.against_the_clock
@pytest.mark.parametrize("kind", ["c", pytest.param("ros-python", marks=pytest.mark.campaign), *IN_A_CAMPAIGN])
def test_a_controller_for_it_passes_the_conformance_set(kind, tmp_path, monkeypatch, capsys, ros_domain, programs, on_own_port):
    monkeypatch.chdir(tmp_path)
    for command in printed(kind, capsys, on_own_port):
        if command[:3] == ["./rig", "controller", "check"]:
            assert main(command[1:]) == 0, capsys.readouterr().out
        elif command[-1] == "&":
            programs(command)
    assert "13 of 13 passed" in capsys.readouterr().out
