# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The wheel in a fresh environment that has the core's packages and no ROS: the commands work, and the bag is the same."""

import json
import os
import re
import subprocess
import sys
import venv
from importlib.metadata import requires
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).parents[2]
SITE = Path(next(path for path in sys.path if path.endswith("site-packages")))
PLAIN = re.compile(r"[\w.-]+")


def files_of(name, seen):
    """What a package and those that it requires without an extra installed here, as names in the folder of packages."""
    from importlib.metadata import PackageNotFoundError, files

    if name.lower() in seen:
        return set()
    seen.add(name.lower())
    try:
        own = {path.parts[0] for path in files(name) if path.parts[0] != ".."}
    except PackageNotFoundError:  # for another Python or system
        return set()
    needed = [PLAIN.match(text)[0] for text in requires(name) or () if "extra ==" not in text]
    return own.union(*(files_of(one, seen) for one in needed))


@pytest.fixture(scope="module")
def core(tmp_path_factory):
    """Returns a function that runs ``rig`` of the wheel; the environment has links to the packages that its metadata names."""
    folder = tmp_path_factory.mktemp("core")
    source = folder / "source"
    subprocess.run(["cp", "-rL", str(CHECKOUT / "rig_nodes"), str(source)], check=True)
    build = "import sys; from setuptools import build_meta; print(build_meta.build_wheel(sys.argv[1]))"
    done = subprocess.run([sys.executable, "-c", build, str(folder)], cwd=source, capture_output=True, text=True, check=True)
    wheel = folder / done.stdout.splitlines()[-1]
    assert wheel.name.endswith("-py3-none-any.whl")
    home = folder / "venv"
    venv.create(home, symlinks=True)
    site = home / SITE.relative_to(sys.prefix)
    pip = [sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--no-index", "--target", str(site), str(wheel)]
    subprocess.run(pip, check=True, capture_output=True)
    metadata = next(site.glob("rig_nodes-*.dist-info")) / "METADATA"
    lines = [line for line in metadata.read_text().splitlines() if line.startswith("Requires-Dist") and "extra ==" not in line]
    core_of = [PLAIN.match(line.partition(": ")[2])[0] for line in lines]
    seen = {"rig_nodes"}
    for entry in set().union(*(files_of(name, seen) for name in core_of)) - {"__pycache__"}:
        if not (site / entry).exists():
            os.symlink(SITE / entry, site / entry)

    def rig(*words, code=0):
        env = {"PATH": os.defpath, "HOME": str(folder), "PYTHONPYCACHEPREFIX": str(folder / "bytecode")}
        command = [str(home / "bin" / "python"), "-P", "-m", "rig_nodes", *words]
        done = subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True, timeout=300)
        assert done.returncode == code, done.stdout + done.stderr
        return done.stdout + done.stderr

    return rig


def test_a_run_without_ros_has_the_bytes_of_one_with_it(core, tmp_path):
    core("simulate", "demo", "--out", str(tmp_path / "core"))
    command = [sys.executable, "-m", "rig_nodes", "simulate", "demo", "--out", str(tmp_path / "whole")]
    subprocess.run(command, check=True, capture_output=True)
    one, other = core("bag", "hash", str(tmp_path / "core"), str(tmp_path / "whole")).split()[::2]
    assert one == other
    assert "I -> II" in core("report", str(tmp_path / "core"))
    core("export", "parquet", str(tmp_path / "core"), "--out", str(tmp_path / "run.parquet"))
    core("sweep", "demo", "--vary", "alfa46.t12=-220 ms, -100 ms", "--jobs", "1", "--out", str(tmp_path / "sweep"))
    assert json.loads((tmp_path / "sweep" / "sweep.json").read_text())["members"] == 2


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["run", "demo"], "rig: rig run needs ROS 2 Jazzy with the rig's messages, and this Python has no rclpy and no rig_msgs; "),
        (["replay", "x"], "rig: rig replay needs ROS 2 Jazzy"),
        (["simulate", "demo", "--controller", "ros:mine"], "rig: controller ros:mine needs ROS 2 Jazzy"),
        (
            ["view", str(CHECKOUT / "bags" / "sample")],
            "rig: the Python package rerun is not installed; pip install 'rig_nodes[view]'",
        ),
        (
            ["simulate", "demo", "--controller", "modbus:5020"],
            "rig: the Python package pymodbus is not installed; pip install 'rig_no",
        ),
        (
            ["simulate", "demo", "--controller", "can:vcan0"],
            "rig: the Python package cantools is not installed; pip install 'rig_no",
        ),
        (
            ["export", "mf4", str(CHECKOUT / "bags" / "sample"), "--out", "a.mf4"],
            "rig: the Python package asammdf is not installed",
        ),
        (["status"], "rig: no rig runs on this host, or none has started yet; start one with: rig run"),
    ],
)
def test_what_is_missing_is_one_sentence(core, words, sentence):
    said = core(*words, code=2)
    assert said.splitlines()[-1].startswith(sentence) and "Traceback" not in said


def test_the_doctor_says_what_is_missing_and_finds_no_fault(core):
    said = core("doctor")
    assert "ROS 2 is not installed" in said and "FAIL" not in said.upper().split()
