# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The imports between the folders of rig_nodes: pyproject.toml lists which folder may import which."""

import ast
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "rig_nodes" / "rig_nodes"
WALLS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["rig"]["walls"]
FLOOR = set(WALLS["everybody"])  # modules outside the folders that every folder may import


def room_of(path: Path) -> str:
    """Returns the folder of a file below the package, or the name of a module outside the folders."""
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


FILES = sorted(PACKAGE.rglob("*.py"))
ROOMS = {room_of(path) for path in FILES}


def imported(source: str, path: Path) -> dict[str, int]:
    """Returns folders and modules of the package that a file imports anywhere, and the first line of each."""
    package = ("rig_nodes", *path.relative_to(PACKAGE).parts[:-1])
    found: dict[str, int] = {}
    for node in ast.walk(ast.parse(source)):
        names = []
        if isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else ()
            module = (*base, *(node.module.split(".") if node.module else ()))
            names = [module] if len(module) > 1 else [(*module, alias.name) for alias in node.names]
        elif isinstance(node, ast.Import):
            names = [tuple(alias.name.split(".")) for alias in node.names]
        for name in names:
            if name[0] == "rig_nodes" and len(name) > 1:
                found.setdefault(name[1], node.lineno)
    return found


def through_walls(source: str, path: Path) -> list[str]:
    """Returns the imports of a file that its folder may not have, as sentences."""
    room, own = room_of(path), set(WALLS.get(room_of(path), ()))
    return [
        f"{path.relative_to(ROOT)}:{line}: {room} may not import {name}; it may import {', '.join(sorted(own)) or 'nothing'}"
        for name, line in imported(source, path).items()
        if name in ROOMS - own - FLOOR - {room}
    ]


@pytest.mark.parametrize("room", sorted(ROOMS))
def test_a_room_imports_only_what_it_may(room):
    files = [path for path in FILES if room_of(path) == room]
    assert [wall for path in files for wall in through_walls(path.read_text(encoding="utf-8"), path)] == []


def test_an_import_through_a_wall_is_found():
    path = PACKAGE / "plant" / "new.py"
    for source in (
        "from ..cli import main",
        "from rig_nodes.cli.main import main",
        "import rig_nodes.cli.main",
        "from .. import cli",
    ):
        (sentence,) = through_walls(source, path)
        assert sentence.startswith("rig_nodes/rig_nodes/plant/new.py:1: plant may not import cli")


def test_no_permission_is_left_over():
    for room, allowed in WALLS.items():
        if room != "everybody":
            files = [path for path in FILES if room_of(path) == room]
            used = {name for path in files for name in imported(path.read_text(encoding="utf-8"), path)}
            assert set(allowed) <= used, f"{room} does not import {set(allowed) - used}"
