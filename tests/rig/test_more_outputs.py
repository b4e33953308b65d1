# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A Ravigneaux set with five valves and a dual clutch: a controller has as many outputs as the rig wires, on each plug."""

import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import main
from rig_nodes.controllers.can.database import database
from rig_nodes.controllers.modbus.registers import register_map
from rig_nodes.controllers.record import record_of
from rig_nodes.controllers.ros.domain import allocate, use_own_transports
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.rig import Rig

from ..controllers.conftest import multicast_works

CLUTCHES = {"k1": "joins: [input, sun_small]", "k2": "joins: [input, sun_large]", "k3": "joins: [input, carrier]"}
CLUTCHES |= {"b1": "brakes: carrier", "b2": "brakes: sun_large"}
BODIES = """\
  sun_small: {inertia: [0.005 kg m2, "assumed"]}
  sun_large: {inertia: [0.01 kg m2, "assumed"]}
  carrier: {inertia: [0.02 kg m2, "assumed"]}

planetary_sets:
  rear: {sun: sun_large, ring: output, carrier: carrier, teeth: [36, 72], source: "assumed"}
relations:
  front: {coefficients: {sun_small: 30, output: -72, carrier: 42}, source: "sun 30 on double planets, ring 72"}
"""
DUAL = """\
  odd: {inertia: [0.01 kg m2, "assumed"]}
  even: {inertia: [0.01 kg m2, "assumed"]}
  wheel_1: {inertia: [0.002 kg m2, "assumed"]}
  wheel_2: {inertia: [0.002 kg m2, "assumed"]}
meshes:
  - {bodies: [wheel_1, output], teeth: [20, 60], source: "assumed"}
  - {bodies: [wheel_2, output], teeth: [26, 52], source: "assumed"}
clutches:
  dog_1: {joins: [odd, wheel_1]}
  dog_2: {joins: [even, wheel_2]}
inputs:
  dog_1: [900 Nm, "preselected"]
  dog_2: [900 Nm, "preselected"]
"""
SEQUENCE = """\
description: upshifts under load
steps:
  - oil: {pressure: 4 MPa}
  - wait: {for: 500 ms}
  - shift: {to: "1", timeout: 3 s}
  - motor: {speed: 1000 rpm}
  - wait: {until: {signal: n_in, above: 990 rpm}, timeout: 10 s}
  - wait: {for: 1 s}
"""
SHIFT = '  - shift: {to: "%d", timeout: 5 s}\n  - wait: {for: 500 ms}\n'


def begun(folder: Path, bodies: str, gears: str, last: int) -> str:
    """Returns the file of a new rig with other bodies and gears; its sequence demo shifts up to the last gear."""
    assert main(["new", "rig", str(folder)]) == 0
    for name in ("validation.yaml", "calibration.yaml"):
        (folder / name).unlink()
    (folder / "sequences" / "demo.yaml").write_text(SEQUENCE + "".join(SHIFT % k for k in range(2, last + 1)))
    text = (folder / "rig.yaml").read_text()
    text = re.sub(r"  wheel_1: massless\n(?:.*\n)*?(?=# The input and the output)", lambda _: bodies, text)
    text = re.sub(r"  I: .*\n  II: .*\n", gears, text)
    return re.sub(r"^view:\n(?:.*\n)*", "", text, flags=re.M)


def part_of(text: str, name: str) -> str:
    """Returns the lines of a device or transducer in a rig's file."""
    return re.search(rf"^  {name}:.*\n(?:    .*\n)*", text, re.M)[0]


@pytest.fixture(scope="module")
def ravigneaux(tmp_path_factory):
    folder = tmp_path_factory.mktemp("rigs") / "ravigneaux"
    gears = '  "1": [k1, b1]\n  "2": [k1, b2]\n  "3": [k1, k3]\n  "4": [k3, b2]\n'
    text = begun(folder, BODIES, gears, 4)
    for first, second in (("clutch_1", "clutch_2"), ("valve_c1", "valve_c2"), ("p_c1", "p_c2"), ("I_v_c1", "I_v_c2")):
        block, copies = part_of(text, first), ""
        for k, (name, holds) in enumerate(CLUTCHES.items(), 1):
            one = block.replace("joins: [wheel_1, output]", holds).replace("output: 1", f"output: {k}").replace("clutch_1", name)
            copies += one.replace("C1", name.upper()).replace("c1", name)
        text = text.replace(part_of(text, second), "").replace(block, copies)
    (folder / "rig.yaml").write_text(text)
    return folder


@pytest.fixture(scope="module")
def dual(tmp_path_factory):
    folder = tmp_path_factory.mktemp("rigs") / "dual"
    text = begun(folder, DUAL, '  "1": [clutch_1, dog_1]\n  "2": [clutch_2, dog_2]\n', 2)
    for k, shaft in (("1", "odd"), ("2", "even")):
        text = text.replace(f"joins: [wheel_{k}, output]", f"joins: [input, {shaft}]")
    (folder / "rig.yaml").write_text(text)
    return folder


@pytest.fixture(scope="module")
def ros_domain():
    before = dict(os.environ)
    with allocate() as domain:
        os.environ["ROS_DOMAIN_ID"] = str(domain.number)
        use_own_transports()
        yield
    os.environ.clear()
    os.environ.update(before)


def shifts(folder: str) -> list[tuple[int, int]]:
    report = json.loads(Path(folder, "report.json").read_text())
    assert report["run"]["end"]["state"] == "ended", report["run"]["end"]
    return [(one["from_gear"], one["to_gear"]) for one in report["shifts"]]


UP = [(1, 2), (2, 3), (3, 4)]


def test_check_names_the_line_that_the_alfa46_cannot_drive(ravigneaux, capsys):
    assert main(["check", str(ravigneaux)]) == 0
    out = capsys.readouterr().out
    assert "gear 1: K1, B1, ratio 2.4" in out and "B2: V-B2 on output 5" in out
    line = 1 + (ravigneaux / "rig.yaml").read_text().splitlines().index("    output: 5")
    assert f"rig.yaml:{line}: the Alfa46 has 3 outputs, and V-B2 is on output 5; run this rig with a controller of your own" in out


@pytest.mark.parametrize("verb", ["simulate", "run"])
def test_the_alfa46_is_refused_in_one_sentence(verb, ravigneaux, tmp_path, capsys):
    assert main([verb, "demo", "--rig", str(ravigneaux), "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert error.startswith("rig: the Alfa46 has 3 outputs, and V-B2 is on output 5;") and error.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_a_rig_on_fewer_outputs_has_the_three_of_before():
    for rig in ("hydmag", "three_speed"):
        assert [one.name for one in record_of(load_rig(rig)).outputs] == ["output_1", "output_2", "output_3"]


def test_an_output_beyond_the_flags_is_refused(ravigneaux, tmp_path):
    (tmp_path / "rig.yaml").write_text(f"description: more\nbase: {ravigneaux}/rig.yaml\nparts:\n  valve_b2: {{output: 9}}\n")
    with pytest.raises(RigError, match=r"rig.yaml:4: parts.valve_b2.output is 9, expected output 1 to 8 of the controller"):
        load_rig(tmp_path)


def test_every_wire_has_all_outputs(ravigneaux):
    config = load_rig(ravigneaux)
    record = record_of(config)
    assert [gear.outputs for gear in record.gears] == [(), (0, 3), (0, 4), (0, 2), (2, 4)]
    messages = {m.name: [s.name for s in m.signals] for m in database(record).messages}
    assert messages["RIG_CURRENTS"] == ["sample", "current_1", "current_2", "current_3"]
    assert messages["RIG_CURRENTS_2"] == ["sample", "current_4", "current_5"]
    assert messages["CONTROL_COMMAND_CURRENT_2"] == ["sample", "command_4", "command_5"]
    assert messages["RIG_MEASURED_2"] == ["p_k3", "p_b1", "p_b2"]
    rows = [row.name for row in register_map(record)]
    assert {"current_5", "command_5", "p_b2"} <= set(rows)
    rig = Rig(config, controller="external", level="current")
    with pytest.raises(RigError, match="the setpoint must be 5 finite numbers"):
        rig.set_current(0, [0.0] * 3, 0, False)


# ---- the templates: each shifts the rig for which it is written, by the commands that are printed

FREE = (pytest.mark.against_the_clock, pytest.mark.campaign)  # tests/controllers has both buses with another rig
KINDS = ["c"]  # test_the_graph_carries_all_outputs has the one in Python; in a campaign:
MORE = [
    pytest.param(kind, marks=pytest.mark.campaign)
    for kind in ("python", "ros-python", "fmu", "udp-python", "cpp", "simulink", "udp-c")
]


@pytest.mark.parametrize("kind", [*KINDS, *MORE, pytest.param("can", marks=FREE), pytest.param("modbus", marks=FREE)])
def test_a_template_shifts_it(kind, ravigneaux, tmp_path, monkeypatch, capsys, ros_domain, on_own_port):
    if kind == "can" and (why := multicast_works()):
        pytest.skip(why)
    monkeypatch.chdir(tmp_path)
    assert main(["controller", "new", kind, "mine", "--rig", str(ravigneaux)]) == 0
    commands, programs = capsys.readouterr().out.split("next:\n")[1], []
    try:
        for line in commands.splitlines():
            command = on_own_port(kind, shlex.split(line, comments=True), "mine/my_plc.py")
            if command[:3] == ["./rig", "controller", "check"] or command[0] == "kill":
                continue
            if command[0] == "./rig":
                if "--rig" not in command:
                    command += ["--rig", str(ravigneaux)]
                out = ["--out", "out"] if command[1] == "simulate" else []
                assert main([*command[1:], *out]) == 0, capsys.readouterr().err
            elif command[-1] == "&":
                program = command[1:-1] if command[0].endswith(("python", "python3")) else [command[0], *command[1:-1]]
                words = [sys.executable, *program] if len(program) < len(command) - 1 else program
                programs.append(subprocess.Popen(words))
            else:
                subprocess.run(command, check=True)
    finally:
        for program in programs:
            program.kill()
            program.wait()
    assert shifts("out") == UP


@pytest.mark.campaign  # tests/controllers has the templates' conformance
def test_a_template_passes_the_conformance_set_of_the_rig(ravigneaux, tmp_path, capsys):
    folder = tmp_path / "mine"
    assert main(["controller", "new", "python", str(folder), "--rig", str(ravigneaux)]) == 0
    spec = f"python:{folder / 'my_controller.py'}:MyController"
    assert main(["controller", "check", spec, "--rig", str(ravigneaux)]) == 0
    assert "13 of 13 passed" in capsys.readouterr().out


def test_the_graph_carries_all_outputs(ravigneaux, tmp_path, ros_domain):
    folder, out = tmp_path / "mine", tmp_path / "out"
    assert main(["controller", "new", "python", str(folder), "--rig", str(ravigneaux)]) == 0
    spec = f"python:{folder / 'my_controller.py'}:MyController"
    words = ["run", "demo", "--rig", str(ravigneaux), "--controller", spec, "--speed", "max", "--out", str(out)]
    done = subprocess.run([sys.executable, "-m", "rig_nodes", *words], text=True, capture_output=True, timeout=400)
    assert done.returncode == 0, done.stdout + done.stderr
    assert shifts(str(out)) == UP


def test_a_dual_clutch_has_gears_that_dog_clutches_hold_too(dual, capsys):
    assert main(["check", str(dual)]) == 0
    assert "gear 2: C2, dog_2, ratio 2" in capsys.readouterr().out


@pytest.mark.campaign
def test_a_dual_clutch_shifts_between_them(dual, tmp_path):
    assert main(["simulate", "demo", "--rig", str(dual), "--out", str(tmp_path / "out")]) == 0
    assert shifts(str(tmp_path / "out")) == [(1, 2)]


def test_a_gear_of_dog_clutches_alone_is_refused(dual, tmp_path):
    text = (dual / "rig.yaml").read_text().replace("[clutch_2, dog_2]", "[dog_2]")
    (tmp_path / "rig.yaml").write_text(text)
    with pytest.raises(RigError, match="gears.2 is held by elements alone; a gear is ordered by a clutch of the parts"):
        load_rig(tmp_path)
