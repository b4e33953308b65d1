# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Templates of controllers of one's own, each a small law that shifts; written by ``rig controller new``.

A template is a folder beside this file and, for plugs that need them, files of the rig and of other templates.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

from ...base import RigError, quoted
from ..c.record_header import NAME, header_text
from ..record import ControllerRecord

HERE = Path(__file__).parent
INCLUDE, EXAMPLES = HERE.parent / "include", HERE.parent / "examples"


class Kind(NamedTuple):
    """files: from elsewhere, by the name that they get; commands: what to do next, in order, with {dir} for the folder.

    record: with rig_record.h of the rig.
    """

    folder: str
    files: dict[str, Path]
    commands: tuple[str, ...]
    record: bool = False


def tries(controller: str) -> tuple[str, str]:
    """Return the commands with which a controller is checked and then run."""
    return f"./rig controller check {controller}", f"./rig simulate demo --controller {controller}"


END = "kill %%  # ends the program in the background, which goes on from run to run"
LAW = {"my_law.py": HERE / "law_python" / "my_law.py"}
HEADER = {"rig_controller.h": INCLUDE / "rig_controller.h"}
TEMPLATES = {
    "python": Kind("python", {}, tries("python:{dir}/my_controller.py:MyController")),
    "c": Kind("c", HEADER, tries("c:{dir}/my_controller.c"), record=True),
    "cpp": Kind("cpp", HEADER, tries("c:{dir}/my_controller.cpp"), record=True),
    "simulink": Kind(
        "simulink",
        HEADER | {"rig_simulink.h": INCLUDE / "rig_simulink.h", "rtwtypes.h": EXAMPLES / "simulink" / "rtwtypes.h"},
        tries("simulink:{dir}"),
        record=True,
    ),
    "udp-c": Kind(
        "c",
        HEADER | {"rig_udp.h": INCLUDE / "rig_udp.h", "main.c": EXAMPLES / "udp_main.c"},
        (
            "cc -std=gnu99 -O2 -ffp-contract=off -o {dir}/my_controller {dir}/main.c {dir}/my_controller.c -lm",
            "{dir}/my_controller &",
            *tries("udp:9002 --level current"),
            END,
        ),
        record=True,
    ),
    "udp-python": Kind(
        "udp_python",
        LAW | {"rig_udp.py": HERE.parent / "udp" / "frames.py"},
        ("python3 {dir}/my_controller.py &", *tries("udp:9002 --level current"), END),
    ),
    "fmu": Kind(
        "c",
        HEADER,
        ("./rig export controller-fmu {dir}/my_controller.c -o {dir}/my_controller.fmu", *tries("fmu:{dir}/my_controller.fmu")),
        record=True,
    ),
    "can": Kind(
        "can",
        {},
        (
            "./rig export dbc -o {dir}/rig.dbc",
            ".venv/bin/python {dir}/my_tcu.py &",
            *tries("'can:239.74.163.2?interface=udp_multicast'"),
            END,
        ),
    ),
    "modbus": Kind("modbus", {}, (".venv/bin/python {dir}/my_plc.py &", *tries("modbus:5020"), END)),
    "ros-python": Kind(
        "ros_python",
        LAW | {"rig_ros.py": HERE.parent / "ros" / "node.py"},
        (".venv/bin/python {dir}/my_controller.py &", *tries("ros: --level current"), END),
    ),
    "ros-cpp": Kind(
        "ros_cpp",
        HEADER
        | {name: INCLUDE / name for name in ("rig_ros.hpp", "rig_ros_box.hpp")}
        | {"my_controller.cpp": HERE / "cpp" / "my_controller.cpp"},
        (
            *tries("c:{dir}/my_controller.cpp"),
            "colcon build --base-paths msgs {dir} && . install/setup.sh",
            "ros2 run my_controller my_controller &",
            *tries("ros: --level current"),
            END,
        ),
        record=True,
    ),
}


def _of_rig(text: str, record: ControllerRecord) -> str:
    """Return a template in Python with what it has of a rig, in the lines of its constants, from the record of another one."""
    table = ", ".join(f"{gear.number}: {gear.outputs}" for gear in record.gears)
    outputs, read = len(record.outputs), 4 + len(record.outputs) + len(record.transducers)
    for old, new in (
        (r"OUTPUTS_OF = \{.*\}", f"OUTPUTS_OF = {{{table}}}"),
        (r"OUTPUTS = \d+", f"OUTPUTS = {outputs}"),
        (r"READ, OUTPUTS = \d+, \d+", f"READ, OUTPUTS = {read}, {outputs}"),
    ):
        text = re.sub(f"^{old}", new, text, flags=re.M)
    return text


def write_template(kind: str, folder: str, record: ControllerRecord) -> tuple[list[Path], list[str]]:
    """(files written, commands to try them) for one of TEMPLATES and the record of a rig; RigError when the folder is not new or
    empty.
    """
    chosen, target = TEMPLATES[kind], Path(folder)
    if target.exists() and (not target.is_dir() or any(target.iterdir())):
        raise RigError(f"{folder}: it exists and is not an empty folder; choose a new name")
    try:
        target.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RigError(f"{folder}: cannot be made ({error.strerror}); choose another place") from None
    sources = {path.name: path for path in sorted((HERE / chosen.folder).iterdir()) if path.is_file()}
    written = []
    for name, source in (sources | chosen.files).items():
        text = source.read_text(encoding="utf-8")
        (target / name).write_text(_of_rig(text, record) if name.endswith(".py") else text, encoding="utf-8")
        written.append(target / name)
    if chosen.record:
        (target / NAME).write_text(header_text(record), encoding="utf-8")
        written.append(target / NAME)
    return written, [command.format(dir=quoted(folder)) for command in chosen.commands]
