# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A fresh environment that has the core's packages and no ROS: the commands work, and the bag is the same."""

import json
import os
import re
import subprocess
import sys
import venv
import zipfile
from importlib.metadata import requires
from pathlib import Path

import pytest

from rig_nodes.base.compiled import cache_key, cache_root
from rig_nodes.cli.main import main
from rig_nodes.controllers.ros.domain import allocate

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
def wheel(tmp_path_factory):
    """The package's wheel, built by its own build system without a look at any index."""
    folder = tmp_path_factory.mktemp("wheel")
    source = folder / "source"
    subprocess.run(["cp", "-rL", str(CHECKOUT / "rig_nodes"), str(source)], check=True)
    build = "import sys; from setuptools import build_meta; print(build_meta.build_wheel(sys.argv[1]))"
    done = subprocess.run([sys.executable, "-c", build, str(folder)], cwd=source, capture_output=True, text=True, check=True)
    return folder / done.stdout.splitlines()[-1]


@pytest.fixture(scope="module")
def core(wheel, tmp_path_factory):
    """Returns a function that runs ``rig`` in an environment of the core's packages alone, those that the wheel's metadata names.

    The packages are links to those of the tests, and rig_nodes is the checkout's, whose compiled code need not be made anew.
    """
    folder = tmp_path_factory.mktemp("core")
    home = folder / "venv"
    venv.create(home, symlinks=True)
    site = home / SITE.relative_to(sys.prefix)
    (site / "rig_nodes.pth").write_text(f"{CHECKOUT / 'rig_nodes'}\n")
    seen = {"rig_nodes"}
    for entry in set().union(*(files_of(name, seen) for name in core_of(wheel))) - {"__pycache__"}:
        os.symlink(SITE / entry, site / entry)
    bytecode = folder / "bytecode"
    for own, kept in ((site, SITE), (CHECKOUT, CHECKOUT), (stdlib := Path(os.__file__).parent, stdlib)):
        if sys.pycache_prefix:  # the same files, of which the tests' own Python keeps the bytecode
            place = bytecode / own.relative_to("/")
            place.parent.mkdir(parents=True, exist_ok=True)
            place.symlink_to(Path(sys.pycache_prefix) / kept.relative_to("/"))

    def rig(*words, code=0):
        env = {"PATH": os.defpath, "HOME": str(folder), "PYTHONPYCACHEPREFIX": str(bytecode)}
        env["NUMBA_CACHE_DIR"] = str(cache_root() / cache_key())
        command = [str(home / "bin" / "python"), "-P", "-m", "rig_nodes", *words]
        done = subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True, timeout=300)
        assert done.returncode == code, done.stdout + done.stderr
        return done.stdout + done.stderr

    return rig


def core_of(wheel):
    """The names of the packages that a wheel requires without an extra."""
    with zipfile.ZipFile(wheel) as archive:
        (metadata,) = (archive.read(name).decode() for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
    lines = [line.partition(": ")[2] for line in metadata.splitlines() if line.startswith("Requires-Dist")]
    return [PLAIN.match(line)[0] for line in lines if "extra ==" not in line]


def test_the_wheel_holds_the_whole_package(wheel):
    """What a run of the wheel finds is what a run of the checkout finds; tests/release/fresh_root.py --core runs the wheel."""
    assert wheel.name.endswith("-py3-none-any.whl")
    with zipfile.ZipFile(wheel) as archive:
        held = {name for name in archive.namelist() if name.startswith("rig_nodes/")}
    package = CHECKOUT / "rig_nodes"
    there = {str(path.relative_to(package)) for path in files_below(package / "rig_nodes")}
    assert there - held == set() and held - there == set()


def files_below(folder):
    """Files of a folder and of folders that it links to, without what Python leaves there."""
    for where, folders, names in os.walk(folder, followlinks=True):
        folders[:] = [name for name in folders if name != "__pycache__"]
        yield from (Path(where, name) for name in names)


def test_a_run_without_ros_has_the_bytes_of_one_with_it(core, tmp_path):
    core("simulate", "demo", "--out", str(tmp_path / "core"))
    assert main(["simulate", "demo", "--out", str(tmp_path / "whole")]) == 0
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
        pytest.param(["replay", "x"], "rig: rig replay needs ROS 2 Jazzy", marks=pytest.mark.campaign),
        (["simulate", "demo", "--controller", "ros:mine"], "rig: controller ros:mine needs ROS 2 Jazzy"),
        (
            ["view", str(CHECKOUT / "bags" / "sample")],
            "rig: the Python package rerun is not installed; pip install 'rig_nodes[view]'",
        ),
        (
            ["simulate", "demo", "--controller", "modbus:5020"],
            "rig: the Python package pymodbus is not installed; pip install 'rig_no",
        ),
        pytest.param(
            ["simulate", "demo", "--controller", "can:vcan0"],
            "rig: the Python package cantools is not installed; pip install 'rig_no",
            marks=pytest.mark.campaign,
        ),
        (
            ["export", "mf4", str(CHECKOUT / "bags" / "sample"), "--out", "a.mf4"],
            "rig: the Python package asammdf is not installed",
        ),
    ],
)
def test_what_is_missing_is_one_sentence(core, words, sentence):
    said = core(*words, code=2)
    assert said.splitlines()[-1].startswith(sentence) and "Traceback" not in said


def test_a_verb_for_a_running_rig_says_that_none_runs(core):
    """In a domain of its own: rigs of other tests run on this host at the same time."""
    with allocate() as free:
        assert core("status", "--domain", str(free.number), code=2).startswith(f"rig: no rig runs in ROS domain {free.number}; ")


def test_the_doctor_says_what_is_missing_and_finds_no_fault(core):
    said = core("doctor")
    assert "ROS 2 is not installed" in said and "FAIL" not in said.upper().split()
