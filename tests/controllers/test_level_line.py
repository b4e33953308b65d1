# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Every run first prints its controller, the level, and the origin of the level."""

import itertools
import json

import pytest

from rig_nodes.cli.main import main
from rig_nodes.controllers.load import level_line, load_controller
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.conformance import Check

SHORT = """\
description: gear I at standstill
steps:
  - oil: {pressure: 4 MPa}
  - shift: {to: I, timeout: 2 s}
"""
BOX = """
from rig_nodes.controllers.seam import ControllerOutputs


class Box:
    LEVELS
    def initialize(self, info): pass
    def step(self, inputs):
        ampere = 0.5 if inputs.gear_request else 0.0
        return ControllerOutputs([ampere, 0.0, 0.0], SETPOINT, inputs.gear_request, False)
    def terminate(self): pass
"""


@pytest.fixture
def box(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "short.yaml").write_text(SHORT)

    def written(levels="", setpoint="None"):
        (tmp_path / "box.py").write_text(BOX.replace("LEVELS", levels).replace("SETPOINT", setpoint))
        return "python:box.py:Box"

    return written


@pytest.mark.parametrize(
    "levels, given, line",
    [
        (
            "",
            [],
            "sends shares of the supply: level duty, by default, the controller declares none; if it sends currents "
            "in A, choose --level current",
        ),
        ("", ["--level", "duty"], "sends shares of the supply: level duty, as given"),
        ('levels = ("current", "duty")', [], "sends currents in A: level current, as the controller declares"),
    ],
)
def test_a_run_says_controller_level_and_its_origin_first(box, capsys, levels, given, line):
    assert main(["simulate", "short.yaml", "--controller", box(levels), "--out", "run", *given]) in (0, 1)
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == f"controller python:box.py:Box {line}"
    record = json.loads(open("run/report.json").read())["run"]["controller"]
    assert f"level {record['level']}, {record['level_from']}" in line


def test_the_built_in_one_says_it_too_in_runs_and_procedures(box, capsys):
    line = "controller alfa46 sends shares of the supply: level duty, as the controller declares"
    assert main(["simulate", "short.yaml", "--out", "run"]) == 0
    assert capsys.readouterr().out.splitlines()[0] == line
    assert level_line(load_controller(None, load_rig("hydmag"))) == line
    assert json.loads(open("run/report.json").read())["run"]["controller"]["level_from"] == "as the controller declares"
    assert main(["procedure", "valve_response", "--series", "ZR-P1", "--out", "series"]) == 0
    assert capsys.readouterr().out.splitlines()[0] == line


def test_a_sweep_and_a_check_say_it(box, capsys, monkeypatch):
    spec = box('levels = ("current",)')
    assert main(
        ["sweep", "short.yaml", "--vary", "alfa46.t12=-200 ms, -180 ms", "--controller", spec, "--jobs", "1", "--out", "swept"]
    ) in (0, 1)
    first = capsys.readouterr().err.splitlines()[0]
    assert first.startswith("controller python:") and first.endswith(
        "box.py:Box sends currents in A: level current, as the controller declares"
    )
    items = Check.items
    monkeypatch.setattr(Check, "items", lambda check: itertools.islice(items(check), 1))  # the line is that of the first
    main(["controller", "check", spec])
    assert (
        capsys.readouterr().out.splitlines()[0].endswith(f"{spec} sends currents in A: level current, as the controller declares")
    )


@pytest.mark.parametrize("setpoint, doubted", [("[ampere, 0.0, 0.0]", True), ("[0.3, 0.0, 0.0]", False), ("None", False)])
def test_a_duty_that_is_the_current_asked_for_is_doubted_once(box, capsys, setpoint, doubted):
    main(["simulate", "short.yaml", "--controller", box(setpoint=setpoint), "--out", "run"])
    output = capsys.readouterr().out
    assert output.count("so it looks like amperes, and level duty (by default, the controller declares none)") == doubted
