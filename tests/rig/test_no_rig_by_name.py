# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""No file of the package contains a clutch, valve, gear or signal of a certain rig; programs take them from the description."""

import ast
import re
from pathlib import Path

import pytest

import rig_nodes
from rig_nodes.base.names import installed
from rig_nodes.rig.configuration import load_rig

ROOT = Path(rig_nodes.__file__).parent
RIGS = ("rigs/", "rig/template/")  # the folders of rigs: those that are installed, and the one that `rig new` writes
OLD = "bags/old_form.py"  # reads a form of bag that held one rig's names
PICTURES, COMPILED = {".svg", ".png"}, "__pycache__"


def names_of_rigs() -> set[str]:
    """Returns names of clutches, valves, their signals, transducers and changes of gear of all installed rigs, except words with
    other meanings.
    """
    out = set()
    for name in installed("rigs"):
        config = load_rig(name)
        for device in (*config.structure.clutches, *config.structure.valves):
            out |= {device.name, device.called, *(one for one in config.catalogue.signals if one.startswith(f"{device.key}_"))}
        out |= {one.name for one in config.structure.transducers}
        if config.structure.gears:
            out |= {way for way in config.transmission.ways() if re.search("[A-Z]", way)}
    return {name for name in out if (len(name) > 1 and not name.islower()) or "_" in name or name in ("p1", "p2")} - {
        "n_in",
        "n_out",
    }


def words_of(path: Path) -> list[tuple[int, str]]:
    """Returns (line, text) of every string and identifier in a Python file's code except docstrings, else of every line."""
    source = path.read_text(encoding="utf-8")
    if path.suffix != ".py":
        return list(enumerate(source.splitlines(), 1))
    tree = ast.parse(source)
    docs = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)}
    out = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docs:
            out.append((node.lineno, node.value))
        elif isinstance(node, ast.Attribute):
            out.append((node.lineno, node.attr))
        elif isinstance(node, ast.Name):
            out.append((node.lineno, node.id))
        elif isinstance(node, ast.arg):
            out.append((node.lineno, node.arg))
        elif isinstance(node, ast.keyword) and node.arg:
            out.append((node.value.lineno, node.arg))
    return out


@pytest.fixture(scope="module")
def pattern():
    # Names are found as a part of a longer key too: "n_wyj_min_rpm" names one laboratory's meter. P1 is a point of a profile.
    names = sorted(map(re.escape, names_of_rigs()), key=len, reverse=True)
    long, short = ("|".join(name for name in names if (len(name) > 2) is wanted) for wanted in (True, False))
    return re.compile(rf"(?<![^\W_])((?i:{long})|{short})(?![^\W_])")


def test_no_file_names_a_clutch_valve_gear_or_signal_of_a_rig(pattern):
    found = []
    for path in sorted(one for one in ROOT.rglob("*") if one.is_file()):
        place = path.relative_to(ROOT).as_posix()
        if not place.startswith((*RIGS, OLD)) and path.suffix not in PICTURES and COMPILED not in path.parts:
            found += [f"{place}:{line}: {match[0]}" for line, text in words_of(path) for match in pattern.finditer(text)]
    assert found == []


@pytest.mark.parametrize(
    "name, text",
    [
        ("new.py", 'PRESSURE = "p1"'),
        ("new.py", "def speed(n_wej): ..."),
        ("new.py", "row['M_wej_mean_nm']"),
        ("new.py", "way = 'I-II'"),
        ("new.yaml", "output_1:  # ZR-P1"),
        ("new.h", "double clutch_s1;"),
    ],
)
def test_a_name_of_a_rig_is_found_wherever_it_stands(pattern, name, text, tmp_path):
    path = tmp_path / name
    path.write_text(text)
    assert any(pattern.search(word) for _, word in words_of(path))
    (tmp_path / "docs.py").write_text('"""As M_wej of the laboratory."""\n# n_wej\n')
    assert not words_of(tmp_path / "docs.py")
