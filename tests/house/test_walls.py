# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The rooms of rig_nodes and their order: pyproject.toml lists them, lowest first, and a room imports only from lower ones."""

import ast
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "rig_nodes" / "rig_nodes"
ROOMS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["rig"]["rooms"]
RIGS = "rigs"  # data; where a rig needs Python it may use every room, and no room may know it
WRITTEN = re.compile(r"rig_nodes\.(\w+)\.\w")  # a module named in a string, for import_module or a process's command line
FILES = [path for path in sorted(PACKAGE.rglob("*.py")) if path.parent != PACKAGE]


def room_of(path: Path) -> str:
    """Returns the room of a file of the package."""
    return path.relative_to(PACKAGE).parts[0]


def imported(source: str, path: Path) -> dict[str, int]:
    """Returns the folders of the package that a file imports, anywhere and for whatever use, with the first line of each."""
    package = ("rig_nodes", *path.relative_to(PACKAGE).parts[:-1])
    tree, found = ast.parse(source), dict[str, int]()
    docs = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        names = []
        if isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else ()
            module = (*base, *(node.module.split(".") if node.module else ()))
            names = [module] if len(module) > 1 else [(*module, alias.name) for alias in node.names]
        elif isinstance(node, ast.Import):
            names = [tuple(alias.name.split(".")) for alias in node.names]
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docs:
            names = [("rig_nodes", room) for room in WRITTEN.findall(node.value)]
        for name in names:
            if name[0] == "rig_nodes" and len(name) > 1:
                found.setdefault(name[1], node.lineno)
    return found


def upward(source: str, path: Path) -> list[str]:
    """Returns the imports of a file from rooms above its own or from a rig's folder, as sentences."""
    room = room_of(path)
    lower = ROOMS[: ROOMS.index(room)]
    return [
        f"{path.relative_to(ROOT)}:{line}: {room} may not import {name}; below it are {', '.join(lower) or 'no rooms'}"
        for name, line in imported(source, path).items()
        if name in {*ROOMS, RIGS} - {room, *lower}
    ]


def test_every_folder_is_a_room():
    assert {room_of(path) for path in FILES} == {*ROOMS, RIGS}


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_imports_only_from_lower_ones(room):
    files = [path for path in FILES if room_of(path) == room]
    assert [sentence for path in files for sentence in upward(path.read_text(encoding="utf-8"), path)] == []


@pytest.mark.parametrize(
    "source",
    [
        "from ..cli import main",
        "from ..cli.main import main",
        "from rig_nodes.cli.main import main",
        "import rig_nodes.cli.main",
        "from .. import cli",
        "def late():\n    from ..cli import main",
        "if TYPE_CHECKING:\n    from ..cli.main import Parser",
        "import_module('rig_nodes.cli.main')",
        "from ..rigs.hydmag import calculations",
    ],
)
def test_an_import_upward_of_any_kind_is_found(source):
    (sentence,) = upward(source, PACKAGE / "plant" / "new.py")
    assert re.search(
        r"^rig_nodes/rig_nodes/plant/new\.py:[12]: plant may not import (cli|rigs); below it are base, driveline$", sentence
    )
    assert upward("from ..driveline import run\n'see rig_nodes.cli.main'", PACKAGE / "plant" / "new.py") == []


def test_the_driveline_is_a_library_of_its_own():
    """It needs no rig, no ROS and no YAML."""
    code = "import sys, rig_nodes.driveline.run, rig_nodes.driveline.modes; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    rooms = {name.split(".")[1] for name in loaded if name.startswith("rig_nodes.")}
    assert rooms == {"base", "driveline"} and not {"rclpy", "ruamel", "ruamel.yaml"} & set(loaded)
