# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rig controller new`: the commands that it prints compile the written files without a warning and run them through a shift."""

import json
import os
import re
import shlex
import signal
import socket
import struct
import subprocess
import sys
from pathlib import Path

import pytest

from rig_nodes.cli.main import main
from rig_nodes.controllers.templates import HERE, TEMPLATES

from .conftest import multicast_works

DOCS = Path(__file__).parents[2] / "docs" / "how_to"

PYTHONS = ("python3", ".venv/bin/python")
OWN_CLOCK = ("can", "modbus")  # programs that are not started with a run
AS_C = ("cpp", "simulink", "udp-c")  # compiled in every run of the tests, and run as a whole in a campaign, as c is in each
CHECKED = ("c", "python")  # in every run of the tests; the check of the others takes seconds of the processor, or of the wall


REAL_TIME = pytest.mark.against_the_clock


@pytest.mark.parametrize(
    ("kind", "checks"),
    [
        *(pytest.param(kind, False, marks=REAL_TIME, id=kind) for kind in OWN_CLOCK),
        *(pytest.param(kind, True, marks=[REAL_TIME, pytest.mark.campaign], id=f"{kind} with its check") for kind in OWN_CLOCK),
        *(pytest.param(kind, kind in CHECKED, id=kind) for kind in TEMPLATES if kind not in (*OWN_CLOCK, *AS_C)),
        *(pytest.param(kind, True, id=f"{kind} with its check", marks=pytest.mark.campaign) for kind in (*AS_C, "fmu", "ros-cpp")),
    ],
)
def test_it_shifts_by_the_commands_that_are_printed(kind, checks, tmp_path, monkeypatch, capsys, request, on_own_port):
    if kind == "can" and (why := multicast_works()):
        pytest.skip(why)
    if kind.startswith("ros-"):
        request.getfixturevalue("ros_domain")
    monkeypatch.chdir(tmp_path)
    assert main(["controller", "new", kind, "mine"]) == 0
    wrote, commands = capsys.readouterr().out.split("next:\n")
    if kind == "ros-cpp":  # the further commands need a ROS 2 with rclcpp and colcon
        commands = "\n".join(commands.splitlines()[:2])
    assert all(Path(line.removeprefix("wrote ")).is_file() for line in wrote.splitlines())
    programs = []
    try:
        for line in commands.splitlines():
            command = on_own_port(kind, shlex.split(line, comments=True), "mine/my_plc.py")
            if command[:3] == ["./rig", "controller", "check"] and not checks:
                continue
            if command[:2] in (["./rig", "export"], ["./rig", "controller"]):
                assert main(command[1:]) == 0, capsys.readouterr()
                assert kind not in CHECKED or "13 of 13 passed" in capsys.readouterr().out
            elif command[0] == "./rig":
                command[command.index("demo")] = "sample"  # the shorter sequence
                assert main([*command[1:], "--out", "run"]) == 0, capsys.readouterr().err  # one program serves check and run
            elif command[-1] == "&":
                program = [sys.executable if command[0] in PYTHONS else command[0], *command[1:-1]]
                programs.append(subprocess.Popen(program, stderr=subprocess.PIPE, text=True))
            elif command == ["kill", "%%"]:
                if kind in (*OWN_CLOCK, "udp-python"):  # Ctrl-C ends the program without a traceback
                    programs[0].send_signal(signal.SIGINT)
                    error = programs[0].communicate(timeout=10)[1]
                    assert (error.replace("message of the rig: the run is over\n", ""), programs[0].returncode) == ("", 130)
            else:
                done = subprocess.run(command, capture_output=True, text=True, check=True)
                assert "warning" not in done.stderr
    finally:
        for program in programs:
            program.kill()
            program.communicate()
    (shift,) = json.loads(Path("run", "report.json").read_text())["shifts"]
    assert commands.count("./rig controller check ") == 1, "its check comes before its run"
    assert (shift["from_gear"], shift["to_gear"], shift["valid"]) == (1, 2, True)
    assert shift["interrupted_s"] == 0.0, "a clutch drives the output all the time"
    assert shift["t_c_s"] == pytest.approx(0.598, abs=0.05), "one law in all templates"


@pytest.mark.parametrize(
    ("kind", "compiler", "standard"),
    [("c", "cc", "-std=c99"), ("cpp", "c++", "-std=c++17"), ("simulink", "cc", "-std=c99"), ("udp-c", "cc", "-std=gnu99")],
)
def test_it_compiles_without_a_warning(kind, compiler, standard, tmp_path):
    folder = tmp_path / "mine"
    assert main(["controller", "new", kind, str(folder)]) == 0
    for source in [*folder.glob("*.c"), *folder.glob("*.cpp")]:
        flags = [standard, "-O2", "-Wall", "-Wextra", "-Werror"]
        subprocess.run([compiler, *flags, "-c", "-o", tmp_path / "out.o", source], check=True)


@pytest.mark.parametrize(
    ("kind", "arguments", "domain", "sentence"),
    [
        ("ros-python", [], "abc", "ROS_DOMAIN_ID is 'abc', expected a number from 0 to 232"),
        ("udp-python", ["127.0.0.1", "abc"], "", "'abc' is no port; expected 1 to 65535, e.g. 9002"),
        ("udp-python", ["localhost.", "0"], "", "'0' is no port; expected 1 to 65535, e.g. 9002"),
    ],
)
def test_what_is_wrong_is_one_sentence(kind, arguments, domain, sentence, tmp_path):
    assert main(["controller", "new", kind, str(tmp_path / "mine")]) == 0
    program = tmp_path / "mine" / "my_controller.py"
    done = subprocess.run(
        [sys.executable, program, *arguments], capture_output=True, text=True, env=os.environ | {"ROS_DOMAIN_ID": domain}
    )
    assert (done.returncode, done.stderr) == (2, f"{program}: {sentence}\n")


@pytest.mark.parametrize(
    ("kind", "sentence"),
    [
        ("udp-python", "waiting for the rig at 127.0.0.1:9002, until Ctrl-C"),
        ("udp-c", "waiting for the rig at 127.0.0.1:9002, until Ctrl-C"),
        ("ros-python", "waiting for the rig in ROS domain {domain}, topics /controller/..., until Ctrl-C"),
    ],
)
def test_a_program_says_where_it_waits(kind, sentence, tmp_path, ros_domain):
    folder = tmp_path / "mine"
    assert main(["controller", "new", kind, str(folder)]) == 0
    command = [sys.executable, folder / "my_controller.py"]
    if kind == "udp-c":
        build = TEMPLATES[kind].commands[0].format(dir=folder)
        subprocess.run(build.split(), check=True, capture_output=True)
        command = [folder / "my_controller"]
    program = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert program.stdout.readline().strip() == sentence.format(domain=ros_domain)
    finally:
        program.kill()
        program.communicate()


@pytest.mark.parametrize("language", ["python", "simulink"])
def test_the_code_of_the_page_shifts_as_the_templates_do(language, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    page = (DOCS / "controllers.md").read_text(encoding="utf-8")
    if language == "simulink":  # the page's shim with the template's model, renamed as on the page
        assert main(["controller", "new", "simulink", "mine"]) == 0
        parameter = "typedef struct { real_T t12; } P;\nextern P rtP;\nextern ExtU rtU;"
        for old, new in (
            ("n_in; ", "n_in_rpm; "),
            ("current[", "i_valve["),
            ("extern ExtU rtU;", parameter),
            ("ExtU rtU;\nExtY", "P rtP;\nExtU rtU;\nExtY"),
            ("my_model.h", "your_model.h"),
            ("my_model_", "your_model_"),
        ):
            for name in ("my_model.h", "my_model.c"):
                Path("mine", name).write_text(Path("mine", name).read_text().replace(old, new))
        Path("mine", "my_model.h").rename("mine/your_model.h")
        (shim,) = (code for code in re.findall(r"```c\n(.*?)```", page, re.S) if "rtU" in code)
        Path("mine", "rig_shim.c").write_text(shim)
        spec = "simulink:mine"
    else:
        Path("my_controller.py").write_text(re.search(r"```python\n(.*?)```", page, re.S)[1])
        spec = "python:my_controller.py:MyController"
    assert main(["simulate", "sample", "--controller", spec, "--out", "run"]) == 0, capsys.readouterr().err
    (shift,) = json.loads(Path("run", "report.json").read_text())["shifts"]
    assert shift["t_c_s"] == pytest.approx(0.598, abs=0.01)


def test_the_modbus_template_looks_for_the_rig_again_however_it_went(tmp_path):
    """A server that ends closes the connection in order or, with a request on its way, by a reset."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(20)
        text = (HERE / "modbus" / "my_plc.py").read_text(encoding="utf-8")
        (tmp_path / "my_plc.py").write_text(text.replace("5020", str(server.getsockname()[1])))
        program = subprocess.Popen([sys.executable, tmp_path / "my_plc.py"], stderr=subprocess.PIPE, text=True)
        try:
            for linger in (1, 0, 1):  # with 0 the connection is reset
                client, _ = server.accept()
                assert client.recv(1000)[7] == 23, "its first request"
                client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", linger, 0))
                client.close()
            program.send_signal(signal.SIGINT)
            assert (program.communicate(timeout=10)[1], program.returncode) == ("", 130)
        finally:
            program.kill()
            program.communicate()


def test_nothing_of_the_users_is_written_over(tmp_path, capsys):
    (tmp_path / "kept.txt").write_text("mine")
    assert main(["controller", "new", "c", str(tmp_path)]) == 2
    assert "it exists and is not an empty folder" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["kept.txt"]
    assert main(["controller", "new", "fortran", str(tmp_path / "new")]) == 2
    assert "fortran" in capsys.readouterr().err
