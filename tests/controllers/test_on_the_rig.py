# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Plugged controllers on the rig: both levels, failures, and the commands and code of docs/how_to/controllers.md."""

import json
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from rig_nodes.bags.reader import Bag
from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import main
from rig_nodes.controllers import load_controller
from rig_nodes.runs.rig import Rig
from rig_nodes.runs.rig_base import RigStatus
from rig_nodes.runs.sequence import load_sequence
from rig_nodes.runs.simulation import advance_with, simulate
from rig_nodes.studies.benchmark.step_cost import CASES, measure

from .conftest import PYTHON

DOCS = Path(__file__).parents[2] / "docs" / "how_to" / "controllers.md"
RUNNING = """
description: first gear at 300 rpm, then on
ready: {timeout: 1 s}
steps:
  - oil: {pressure: 4 MPa}
  - wait: {for: 300 ms}
  - shift: {to: I, timeout: 2 s}
  - motor: {speed: 300 rpm}
  - wait: {for: 1 s}
"""
COSTS = ("built-in through the seam", "UDP, Python program")  # measured in every run: one inside and one that is a program
# acts as the Alfa46 until FAIL_AT and then executes the code of the test
WRAPPED = """
from rig_nodes.controllers import ControllerOutputs, Status
from rig_nodes.controllers.examples.alfa46 import Alfa46

class Mine(Alfa46):
    def step(self, inputs):
        if inputs.sample >= FAIL_AT:
            WHAT
        return super().step(inputs)
"""


@pytest.fixture
def sequence(tmp_path):
    path = tmp_path / "running.yaml"
    path.write_text(RUNNING)
    return path


@pytest.fixture
def failing(tmp_path):
    """Returns the specification of a controller that does something from a sample on."""

    def make(what, sample=1500):
        path = tmp_path / "mine.py"
        path.write_text(WRAPPED.replace("FAIL_AT", str(sample)).replace("WHAT", what))
        return f"python:{path}:Mine"

    return make


# ---- the power stage at level current


def powered(config, setpoint=0.4, samples=600):
    """Returns a rig at level current that got one setpoint for output 1 with every sample."""
    rig = Rig(config, controller="external", level="current")
    for sample in range(samples):
        rig.advance_samples(1)
        rig.set_current(sample, [setpoint, 0.0, 0.0], 1, False)
    return rig


def test_the_power_stage_brings_the_coil_to_its_setpoint(config):
    rig = powered(config)
    assert rig.measurement("I_zr_p1") == pytest.approx(0.4, abs=0.004)
    assert rig.measurement("I_zr_p2") < 0.004
    assert rig.setpoint.tolist() == [0.4, 0.0, 0.0]


def test_it_goes_on_between_commands_however_time_is_cut(config):
    whole, pieces = powered(config), powered(config)
    whole.advance_samples(60)
    for _ in range(60):
        pieces.advance_samples(1)
    assert whole.state_hash() == pieces.state_hash()
    assert whole.measurement("I_zr_p1") == pytest.approx(0.4, abs=0.004)


@pytest.mark.parametrize("level", [0, 1], ids=["duty", "current"])
def test_the_first_command_says_at_which_level_a_rig_is_driven(config, level):
    with_level, without_level = (Rig(config, controller="external", level=kind) for kind in (("duty", "current")[level], None))
    for sample in range(50):
        for rig in (with_level, without_level):
            rig.advance_samples(1)
            rig.set_command(level, sample, [0.2, 0.0, 0.0], [0.3, 0.0, 0.0], 1, False, 0)
    assert without_level.level == with_level.level and without_level.state_hash() == with_level.state_hash()
    assert (without_level.duty.any(), without_level.measurement("I_zr_p1") > 0.01) == (level == 0, True)
    without_level.trip("somebody says so", "test")
    without_level.reset()
    without_level.advance_samples(1)
    with pytest.raises(RigError, match=f"level '{with_level.level}', found one at .*stays until its end"):
        without_level.set_command(1 - level, 50, [0.0] * 3, [0.0] * 3, 0, False, 0)
    with pytest.raises(RigError, match="level 2 is neither"):
        without_level.set_command(2, 50, [0.0] * 3, [0.0] * 3, 0, False, 0)


def test_silence_ends_in_the_safe_state_at_level_current_too(config):
    rig = powered(config)
    rig.advance(0.11)
    assert rig.status == RigStatus.TRIPPED and "older than 100 ms" in rig.reason
    rig.advance(0.2)
    assert [float(valve["duty"]) for valve in rig.valves] == [0.0, 0.0] and rig.measurement("I_zr_p1") < 0.005
    rig.reset()
    rig.advance(0.05)
    assert rig.status == RigStatus.STARTING and rig.measurement("I_zr_p1") < 0.005, "the old setpoint is forgotten"


@pytest.mark.parametrize("spec", ["alfa46", f"{PYTHON}@current"])
def test_after_a_reset_a_clutch_is_clamped_only_when_it_is_ordered_anew(config, spec):
    plug = load_controller(spec, config)
    rig = Rig(config, controller="external", level=plug.level)
    rig.set("oil", 4e6, True)

    def moved(samples):
        for _ in range(samples):
            advance_with(rig, plug)
        return rig.status, bool(rig.measurement("I_zr_p1") > 0.3), bool(rig.measurement("p1") > 1.5e6)

    moved(1)
    plug.order(1)
    assert moved(1000) == (RigStatus.READY, True, True)
    rig.e_stop()
    moved(300)
    rig.reset()
    assert moved(500) == (RigStatus.STARTING, False, False), "a controller that has not heard of it asks in vain"
    plug.force_neutral()
    assert moved(1500) == (RigStatus.READY, False, False) and plug.gear == 0  # the release takes 1.25 s
    plug.order(1)
    assert moved(1000) == (RigStatus.READY, True, True)
    # in the middle of a shift
    plug.order(2)
    moved(100)
    rig.e_stop()
    plug.force_neutral()
    moved(5)
    rig.reset()
    moved(3000)
    assert (
        rig.status == RigStatus.READY and [float(clutch["static"]) for clutch in rig.clutches] == [0.0, 0.0] and not plug.shifting
    )
    plug.close()


def test_an_output_at_zero_is_off_unless_its_flag_holds_it(config):
    """The loop of an output that was off starts anew, with a peak of the duty; that of a held output continues from its state."""
    seen = {}
    for flags in (0, 1):
        rig = powered(config)
        for sample in range(600, 620):
            rig.advance_samples(1)
            rig.set_current(sample, [0.0 if sample < 602 else 0.4, 0.0, 0.0], 1, False, flags)
        seen[flags] = rig.measurement("I_zr_p1")
    assert abs(seen[1] - 0.4) < 0.01 < abs(seen[0] - 0.4)


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda rig: rig.set_current(9, [0.9, 0, 0], 1, False), "0 to 0.8 A"),
        (lambda rig: rig.set_current(9, [-0.1, 0, 0], 1, False), "0 to 0.8 A"),
        (lambda rig: rig.set_current(9, [float("nan"), 0, 0], 1, False), "3 finite numbers"),
        (lambda rig: rig.set_current(9, [0.1, 0], 1, False), "3 finite numbers"),
        (lambda rig: rig.set_current(4, [0.1, 0, 0], 1, False), "expected one after 4 and not after 10"),
        (lambda rig: rig.set_current(11, [0.1, 0, 0], 1, False), "not after 10"),
        (lambda rig: rig.set_duty(9, [0.1, 0, 0], [0, 0, 0], 1, False), "at level 'current', found one at level 'duty'"),
    ],
)
def test_wrong_setpoints_are_refused_and_the_old_ones_stay(config, call, sentence):
    rig = powered(config, samples=5)
    rig.advance_samples(5)
    with pytest.raises(RigError, match=sentence):
        call(rig)
    assert rig.setpoint.tolist() == [0.4, 0.0, 0.0]


def test_setpoints_are_refused_at_level_duty(config):
    with pytest.raises(RigError, match="at level 'duty', found one at level 'current'"):
        Rig(config, controller="external").set_current(0, [0.1, 0, 0], 0, False)
    with pytest.raises(RigError, match="level is 'volts'"):
        Rig(config, controller="external", level="volts")


def test_an_answer_acts_one_sample_later(config, python_controller):
    plug = python_controller("return Out([1, 0, 0] if inputs.sample == 2 else [0, 0, 0])")
    rig, acted = Rig(config, controller="external"), []
    for _ in range(5):
        advance_with(rig, plug)
        acted.append(float(rig.valves[0]["duty"]))
    assert acted == [0.0, 0.0, 0.0, 1.0, 0.0], "what answers sample 2 acts from sample 3 to sample 4"


# ---- failures


@pytest.mark.parametrize(
    ("what", "reason"),
    [
        ("raise ValueError('the table is empty')", r"sample 1500: step failed: mine.py line 8: ValueError: the table is empty"),
        ("return ControllerOutputs(status=Status.ERROR, message='no speed')", "sample 1500: status error: no speed"),
        ("return ControllerOutputs(status=Status.FATAL)", "sample 1500: status fatal"),
        ("return ControllerOutputs([float('nan'), 0, 0])", r"sample 1500: command\[0\] is nan"),
        ("return ControllerOutputs(status=Status.DISCARD)", "older than 100 ms"),
    ],
)
def test_a_controller_that_fails_trips_the_rig_and_the_bag_is_whole(config, sequence, failing, tmp_path, what, reason):
    plug = load_controller(failing(what), config)
    run = simulate(config, load_sequence(sequence, default="hydmag"), tmp_path / "run", controller=plug)
    assert run["end"]["state"] == "tripped" and re.search(reason, run["end"]["reason"])
    bag = Bag(tmp_path / "run")
    assert not any(bag.gaps().values())
    tripped = [(t, text) for t, topic, name, text, _ in bag.events() if name == "rig_tripped"]
    assert [text for _, text in tripped] == [run["end"]["reason"]]
    silence = 0.1 if "older" in reason else 0.0
    assert tripped[0][0] == pytest.approx(1.5 + silence, abs=0.0031)
    t, current = bag.series("I_zr_p1")
    assert np.interp(1.49, t, current) > 0.6, "in gear until then"
    assert current[-1] < 0.02, "the safe state is in the bag"


def test_a_controller_that_never_answers_trips_the_rig(config, sequence, failing, tmp_path):
    plug = load_controller(failing("return ControllerOutputs(status=Status.DISCARD)", 0), config)
    run = simulate(config, load_sequence(sequence, default="hydmag"), tmp_path / "run", controller=plug)
    assert "none of the first 101 samples was answered" in run["end"]["reason"]
    assert run["duration_s"] < 0.3


def test_a_gear_that_is_not_taken_is_a_shift_that_does_not_end(config, sequence, python_controller, tmp_path):
    run = simulate(
        config, load_sequence(sequence, default="hydmag"), tmp_path / "run", controller=python_controller("return Out()")
    )
    assert (
        run["end"]["state"] == "failed"
        and "'shift to I' did not come true within 2 s; the controller reports gear 0, not shifting" in run["end"]["reason"]
    )


def test_the_command_says_why_and_ends_with_1(sequence, failing, tmp_path, capsys):
    arguments = [
        "simulate",
        str(sequence),
        "--out",
        str(tmp_path / "run"),
        "--controller",
        failing("return ControllerOutputs(status=1 / 0)"),
    ]
    assert main(arguments) == 1
    captured = capsys.readouterr()
    assert re.fullmatch(
        r"rig: controller python:.*mine.py:Mine, sample 1500: step failed: mine.py line 8: "
        r"ZeroDivisionError: division by zero\n",
        captured.err,
    )
    assert "Traceback" not in captured.out
    report = json.loads((tmp_path / "run" / "report.json").read_text())
    assert report["run"]["end"]["state"] == "tripped" and report["run"]["controller"]["level"] == "duty"
    log = (tmp_path / "run" / "logs" / "controller.log").read_text()
    assert "Traceback" in log and "1 / 0" in log


def test_the_command_refuses_before_it_makes_a_folder(tmp_path, capsys):
    for arguments in (["--controller", "c:nowhere.so"], ["--controller", f"{PYTHON}@duty", "--level", "current"]):
        assert main(["simulate", "sample", "--out", str(tmp_path / "run"), *arguments]) == 2
        captured = capsys.readouterr()
        assert captured.err.startswith("rig: controller ") and captured.err.count("\n") == 1
    assert not (tmp_path / "run").exists()


LAZY = """
from rig_nodes.controllers import ControllerOutputs

class Lazy:
    def initialize(self, info):
        pass

    def step(self, inputs):
        return ControllerOutputs((0.0, 0.0, 0.0), gear=inputs.gear_request)

    def terminate(self):
        pass
"""


def test_a_controller_that_only_says_that_it_shifts_fails_a_strict_run_and_no_other(tmp_path, capsys):
    (tmp_path / "lazy.py").write_text(LAZY)
    sequence = str(Path(__file__).parents[1] / "sweep" / "short.yaml")
    run = ["simulate", sequence, "--controller", f"python:{tmp_path / 'lazy.py'}:Lazy", "--out"]
    assert main([*run, str(tmp_path / "one")]) == 0
    assert "is not valid" in capsys.readouterr().out
    assert main([*run, str(tmp_path / "two"), "--strict"]) == 1
    assert re.search(r"rig: --strict: (\d) of \1 shifts not valid; the report has the reasons", capsys.readouterr().err)
    assert main(["simulate", "sample", "--strict", "--out", str(tmp_path / "three")]) == 0


# ---- the pages


def doc_commands(heading, page=DOCS):
    section = page.read_text(encoding="utf-8").split(f"## {heading}\n")[1].split("\n## ")[0]
    return re.findall(r"^    (\S.*)$", re.sub(r"```.*?```", "", section, flags=re.S), re.M)


@pytest.mark.parametrize(
    ("kind", "page", "count"),
    [
        ("Python", "controllers.md", 1),
        ("C", "controllers.md", 4),
        ("Simulink Coder", "controllers.md", 2),
        ("UDP", "udp.md", 7),
        ("ROS", "ros_controller.md", 3),
    ],
)
def test_the_first_shift_page_works_as_it_is_written(kind, page, count, tmp_path, monkeypatch, request):
    if kind == "ROS":
        request.getfixturevalue("ros_domain")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rig_nodes").symlink_to(DOCS.parents[2] / "rig_nodes")
    if kind == "Python":
        Path("my_controller.py").write_text(re.search(r"```python\n(.*?)```", DOCS.read_text(encoding="utf-8"), re.S)[1])
    heading = "From your code to the first shift" + (f": {kind}" if page == "controllers.md" else "")
    commands = doc_commands(heading, DOCS.with_name(page))
    assert len(commands) == count
    programs = []
    try:
        for command in map(shlex.split, commands):
            if command[-1] == "&":
                for program in programs:  # only one program runs at a time
                    program.kill()
                program = sys.executable if command[0] in ("python3", ".venv/bin/python") else command[0]
                programs.append(subprocess.Popen([program, *command[1:-1]], stderr=subprocess.DEVNULL))
            elif command[0] != "./rig":
                subprocess.run(command, check=True)
            elif command[1] in ("controller", "export"):
                assert main(command[1:]) == 0
            else:
                if kind != "Python":
                    command[command.index("demo")] = "sample"  # the shorter sequence
                assert main(command[1:]) == 0
                shifts = json.loads(Path(command[-1], "report.json").read_text())["shifts"]
                both = [(1, 2, True), (2, 1, True)] if kind == "Python" else [(1, 2, True)]
                assert [(s["from_gear"], s["to_gear"], s["valid"]) for s in shifts] == both
    finally:
        for program in programs:
            program.kill()
            program.wait()


@pytest.mark.parametrize(
    "case", [pytest.param(case, id=case.name, marks=() if case.name in COSTS else pytest.mark.campaign) for case in CASES]
)
def test_the_cost_of_each_plug_is_measured(config, case):
    cost = measure(case, config, steps=100)
    assert cost.missing or 1.0 < cost.median_us <= cost.p99_us
