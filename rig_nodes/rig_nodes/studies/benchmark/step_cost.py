# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Measures the cost of a controller step through each plug, with the reference controller; for ``rig bench controllers``.

A plug is one line in CASES; a plug whose other side is a program names the command that starts it.
"""

from __future__ import annotations

import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from ...controllers import PORT, load_controller

if TYPE_CHECKING:
    from ...rig import RigConfig

EXAMPLES = Path(__file__).parents[2] / "controllers" / "examples"
INCLUDE = Path(__file__).parents[2] / "controllers" / "include"
WARM_UP, STEPS = 500, 5000
COME = 20.0  # s of wall clock in which a program has to come


class Cost(NamedTuple):
    """One line of the table: us per step, or in ``missing`` why there is none."""

    plug: str
    median_us: float
    p99_us: float
    missing: str = ""


class Case(NamedTuple):
    """One plug to measure.

    Parameters
    ----------
    name : str
        The plug's name, for people.
    spec : str
        The controller's specification, with {port} and {folder}.
    needs : str
        A command without which the plug cannot be measured.
    program : callable or None
        Returns the command of the other side for a folder and a number of its own, which is a free port.
    build : callable or None
        Writes what ``spec`` names into the folder.
    """

    name: str
    spec: str
    needs: str = ""
    program: Callable[[Path, int], list[str]] | None = None
    build: Callable[[Path, RigConfig], None] | None = None


def _c_program(folder: Path, port: int) -> list[str]:
    program = folder / "alfa46_udp"
    sources = [str(EXAMPLES / name) for name in ("udp_main.c", "alfa46.c")]
    flags = ["-std=gnu99", "-O2", "-ffp-contract=off", f"-I{INCLUDE}"]
    subprocess.run(["cc", *flags, "-o", str(program), *sources, "-lm"], check=True)
    return [str(program), "127.0.0.1", str(port)]


def _python_program(_folder: Path, port: int) -> list[str]:
    return [sys.executable, "-m", "rig_nodes.controllers.examples.alfa46_udp", "127.0.0.1", str(port)]


def _ros_program(_folder: Path, port: int) -> list[str]:
    return [sys.executable, "-m", "rig_nodes.controllers.examples.alfa46_ros", f"bench{port}"]


def _fmu(folder: Path, config: RigConfig) -> None:
    from ...runs import build_controller_fmu

    build_controller_fmu([EXAMPLES / "alfa46.c"], folder / "alfa46.fmu", config)


CASES = (
    Case("built-in through the seam", "alfa46"),
    Case("Python class", "python:rig_nodes.controllers.examples.alfa46:Alfa46"),
    Case("Python class, `--in-process`", "python:rig_nodes.controllers.examples.alfa46:Alfa46@in-process"),
    Case("C library", f"c:{EXAMPLES / 'alfa46.c'}", "cc"),
    Case("Simulink Coder's form", f"simulink:{EXAMPLES / 'simulink'}", "cc"),
    Case("FMU", "fmu:{folder}/alfa46.fmu", "cc", build=_fmu),
    Case("UDP, C program", "udp:{port}", "cc", _c_program),
    Case("UDP, Python program", "udp:{port}", "", _python_program),
    Case("ROS 2 node, Python", "ros:bench{port}", "", _ros_program),
)


def measure(case: Case, config: RigConfig, steps: int = STEPS) -> Cost:
    """Return the cost of one plug.

    Parameters
    ----------
    case : Case
        The plug.
    config : RigConfig
        The rig's configuration.
    steps : int
        Number of measured steps.

    Returns
    -------
    Cost
        With a reason in place of numbers when what the plug needs is not installed.
    """
    if case.needs and not shutil.which(case.needs):
        return Cost(case.name, float("nan"), float("nan"), f"{case.needs} is not installed")
    with tempfile.TemporaryDirectory(prefix="rig-bench-") as folder:
        if case.build:
            case.build(Path(folder), config)
        port = _free_port() if case.program else PORT
        program = subprocess.Popen(case.program(Path(folder), port)) if case.program else None
        try:
            plug = load_controller(case.spec.format(port=port, folder=folder), config)
            plug.wait(COME)
            plug.order(1)
            took = []
            for sample in range(WARM_UP + steps):
                began = time.perf_counter()
                plug.step(sample, (0.3, 0.1, 0.0), (150.0, 60.0, 1.0e6, 1.0e5))
                took.append(time.perf_counter() - began)
            plug.close()
        finally:
            if program is not None:
                program.terminate()
                program.wait()
    took = sorted(took[WARM_UP:])
    return Cost(case.name, took[steps // 2] * 1e6, took[steps * 99 // 100] * 1e6)


def _free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


def controllers_table(config: RigConfig, steps: int = STEPS) -> list[Cost]:
    """Return the cost of every plug, in the order of docs/how_to/controllers.md."""
    return [measure(case, config, steps) for case in CASES]
