# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The rooms of rig_nodes and their order: pyproject.toml lists them, lowest first, and a room imports only from lower ones.

What others use of a room are the names in its __init__.pyi, which its __init__.py finds when they are asked for.
"""

import ast
import functools
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
# what the pages and templates name for users' own controllers
FOR_USERS = {"ControllerInfo", "ControllerOutputs"}
FILES = [path for path in sorted(PACKAGE.rglob("*.py")) if path.parent != PACKAGE]


def room_of(path: Path) -> str:
    """Returns the room of a file of the package."""
    return path.relative_to(PACKAGE).parts[0]


@functools.cache
def modules(source: str, path: Path) -> list[tuple[ast.ImportFrom | ast.Import, tuple[str, ...]]]:
    """Returns each import of a file from the package, anywhere and for whatever use, with the name of the module."""
    package = path.relative_to(PACKAGE.parent).parts[:-1] if path.is_relative_to(PACKAGE.parent) else ()
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else ()
            found.append((node, (*base, *(node.module.split(".") if node.module else ()))))
        elif isinstance(node, ast.Import):
            found += [(node, tuple(alias.name.split("."))) for alias in node.names]
    return [(node, name) for node, name in found if name[0] == "rig_nodes"]


def imported(source: str, path: Path) -> dict[str, int]:
    """Returns the folders of the package that a file imports or names for an import, with the first line of each."""
    tree, found = ast.parse(source), dict[str, int]()
    docs = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node, name in modules(source, path):
        for room in name[1:2] or [alias.name for alias in node.names]:
            found.setdefault(room, node.lineno)
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docs:
            for room in WRITTEN.findall(node.value):
                found.setdefault(room, node.lineno)
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


def past_the_door(source: str, path: Path) -> list[str]:
    """Returns the imports of a file from a module of another room instead of the room, as sentences."""
    return [
        f"{path.relative_to(ROOT)}:{node.lineno}: {'.'.join(name)} is inside {name[1]}; what others use is in its __init__.pyi"
        for node, name in modules(source, path)
        if len(name) > 2 and name[1] in {*ROOMS} - {room_of(path)}
    ]


def public(room: str) -> set[str]:
    """Returns the names that a room has for others."""
    tree = ast.parse((PACKAGE / room / "__init__.pyi").read_text(encoding="utf-8"))
    return {alias.name for node in tree.body if isinstance(node, ast.ImportFrom) for alias in node.names}


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


@pytest.mark.parametrize("room", [*ROOMS, RIGS])
def test_a_room_uses_only_the_public_names_of_others(room):
    files = [path for path in FILES if room_of(path) == room]
    assert [sentence for path in files for sentence in past_the_door(path.read_text(encoding="utf-8"), path)] == []


@pytest.mark.parametrize(
    "source",
    ["from ..rig.read import load_rig", "import rig_nodes.rig.read", "def late():\n    from rig_nodes.rig.read import load_rig"],
)
def test_an_import_past_the_door_is_found(source):
    assert len(past_the_door(source, PACKAGE / "runs" / "new.py")) == 1
    assert past_the_door("from ..rig import load_rig\nfrom .plan import plan_of", PACKAGE / "runs" / "new.py") == []


def test_every_public_name_is_used_by_another_room_or_by_users():
    used: dict[str, set[str]] = {room: set() for room in ROOMS}
    checkout = PACKAGE.parents[1]
    outside = [*(PACKAGE.parent / "launch").glob("*.py"), *(checkout / "docs").glob("*.py")]
    for path in [*PACKAGE.rglob("*.py"), *outside]:
        own = path.relative_to(PACKAGE).parts[0] if path.is_relative_to(PACKAGE) else ""
        for node, name in modules(path.read_text(encoding="utf-8"), path):
            if len(name) == 2 and name[1] in {*ROOMS} - {own} and isinstance(node, ast.ImportFrom):
                used[name[1]] |= {alias.name for alias in node.names}
    used["controllers"] |= FOR_USERS
    doors = [room for room in ROOMS if (PACKAGE / room / "__init__.pyi").exists()]
    assert {room: public(room) - used[room] for room in doors} == {room: set() for room in doors}


def test_the_driveline_is_a_library_of_its_own():
    """It needs no rig, no ROS and no YAML."""
    code = "import sys, rig_nodes.driveline.run, rig_nodes.driveline.vibration; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    rooms = {name.split(".")[1] for name in loaded if name.startswith("rig_nodes.")} & {*ROOMS, RIGS}
    assert rooms == {"base", "driveline"} and not {"rclpy", "ruamel", "ruamel.yaml"} & set(loaded)
