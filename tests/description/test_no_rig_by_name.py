# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""No program contains the name of a clutch, valve, gear or signal of a certain rig; it takes them from the description."""

import ast
import re
from pathlib import Path

import rig_nodes
from rig_nodes.base.names import installed
from rig_nodes.rig.configuration import load_rig

ROOT = Path(rig_nodes.__file__).parent
# Code that evaluates the laboratory's printed pages and tests, the rigs' folders, and examples for users
OF_THE_LABORATORY = (
    "rigs/",
    "studies/validation/",
    "cli/calibrate.py",
    "rig/conditions.py",
    "controllers/examples/",
    "analysis/annex_a.py",
    "analysis/slip_tests.py",
    "analysis/press_bench.py",
    "analysis/coast_down.py",
    "plant/friction/bench.py",
    "bags/old_form.py",
)


def names_of_rigs() -> set[str]:
    """Returns names of clutches, valves, their signals and transducers of all installed rigs, except words with other meanings."""
    out = set()
    for name in installed("rigs"):
        config = load_rig(name)
        for device in (*config.structure.clutches, *config.structure.valves):
            out |= {device.name, device.called, *(one for one in config.catalogue.signals if one.startswith(f"{device.key}_"))}
        out |= {one.name for one in config.structure.transducers}
    return {name for name in out if (len(name) > 1 and not name.islower()) or "_" in name or name in ("p1", "p2")} - {
        "n_in",
        "n_out",
    }


def words_of(path: Path) -> list[tuple[int, str]]:
    """Returns (line, text) of every string in the code except docstrings, and of every attribute and keyword."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    docs = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)}
    out = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docs:
            out.append((node.lineno, node.value))
        elif isinstance(node, ast.Attribute):
            out.append((node.lineno, node.attr))
        elif isinstance(node, ast.keyword) and node.arg:
            out.append((node.value.lineno, node.arg))
    return out


def test_no_program_names_a_clutch_valve_or_signal_of_a_rig():
    # Names are found as a part of a longer key too: "n_wyj_min_rpm" names one laboratory's meter. P1 is a point of a profile.
    names = sorted(map(re.escape, names_of_rigs()), key=len, reverse=True)
    long, short = ("|".join(name for name in names if (len(name) > 2) is wanted) for wanted in (True, False))
    pattern = re.compile(rf"(?<![^\W_])((?i:{long})|{short})(?![^\W_])")
    found = []
    for path in sorted(ROOT.rglob("*.py")):
        place = path.relative_to(ROOT).as_posix()
        if not place.startswith(OF_THE_LABORATORY):
            found += [f"{place}:{line}: {match[0]}" for line, text in words_of(path) for match in pattern.finditer(text)]
    assert found == []
