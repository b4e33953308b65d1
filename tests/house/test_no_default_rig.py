# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Only a command line that names no rig has a default one; below it a rig is given, or what is not known is said."""

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[2] / "rig_nodes" / "rig_nodes"
NAME, RIG = "DEFAULT_RIG", "hydmag"
COMMAND_LINES = ("cli/", "nodes/process.py")
ALLOWED = {
    NAME: (*COMMAND_LINES, "base/names.py"),  # where it is defined
    # the old form of a bag was that rig's only, and so is the environment that gymnasium knows by a name
    RIG: (*COMMAND_LINES, "base/names.py", "rigs/", "bags/old_form.py", "environments.py"),
}


def found_in(source: str) -> set[str]:
    """Returns which of the default's name and the rig's name are in the code; docstrings and comments are not code."""
    if NAME not in source and RIG not in source:
        return set()
    tree, found = ast.parse(source), set()
    docs = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docs and RIG in node.value:
            found.add(RIG)
        if NAME in (getattr(node, "id", ""), getattr(node, "attr", "")) or (isinstance(node, ast.alias) and node.name == NAME):
            found.add(NAME)
    return found


def test_no_room_below_the_command_lines_has_a_default_rig():
    for path in sorted(PACKAGE.rglob("*.py")):
        place = path.relative_to(PACKAGE).as_posix()
        names = {name for name in found_in(path.read_text(encoding="utf-8")) if not place.startswith(ALLOWED[name])}
        assert not names, f"{place} has {', '.join(names)}; its caller gives the rig"


@pytest.mark.parametrize(
    ("source", "names"),
    [
        ("from ..base.names import DEFAULT_RIG", {NAME}),
        ("def load(name=names.DEFAULT_RIG): ...", {NAME}),
        ("load_rig('hydmag')", {RIG}),
        ('"""The rig hydmag."""\nload_rig(name)  # hydmag', set()),
    ],
)
def test_a_default_rig_is_found(source, names):
    assert found_in(source) == names
