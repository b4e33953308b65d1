# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Every example in the docstrings of the Python API runs and prints what it shows."""

import copy
import doctest
import functools
import importlib
from pathlib import Path

import pytest

import rig_nodes

PACKAGE = Path(rig_nodes.__file__).parent
MODULES = sorted(path.stem for path in (PACKAGE / "api").glob("*.py") if ">>> " in path.read_text(encoding="utf-8"))


def examples() -> list[doctest.DocTest]:
    found = []
    for name in MODULES:
        module = importlib.import_module(f"rig_nodes.api.{name}")
        found += [one for one in doctest.DocTestFinder().find(module, extraglobs={"rig_nodes": rig_nodes}) if one.examples]
    return found


@pytest.fixture(autouse=True, scope="module")
def _demo_is_simulated_once():
    """Half of the examples begin with the same run; each gets a copy of it, as if it had simulated it."""
    simulate = rig_nodes.Rig.simulate
    demo = functools.cache(lambda rig, **named: simulate(rig_nodes.load(rig), "demo", **named))

    def simulated(rig, *given, **named):
        if given == ("demo",) and not rig.settings:
            return copy.deepcopy(demo(rig.name, **named))
        return simulate(rig, *given, **named)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rig_nodes.Rig, "simulate", simulated)
        yield


@pytest.mark.parametrize("example", examples(), ids=lambda example: example.name.removeprefix("rig_nodes.api."))
def test_an_example_shows_what_it_prints(example, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    said = []
    flags = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS
    result = doctest.DocTestRunner(optionflags=flags).run(example, out=said.append)
    assert result.failed == 0, "".join(said)
