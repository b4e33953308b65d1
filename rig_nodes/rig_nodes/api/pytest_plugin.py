# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The plugin of pytest: fixtures ``rig``, ``run`` and ``bag``, chosen by the marker ``rig``, options or the ini file.

pytest loads it by an entry point in every project of the environment, so it imports nothing before a fixture is used.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import pytest

import rig_nodes

from ..base import RigError

if TYPE_CHECKING:
    from collections.abc import Callable

T = TypeVar("T")

# what can be chosen: the name in the marker, beside that of the option and of the ini file
NAMES = {"name": "rig", "sequence": "rig_sequence", "seed": "rig_seed", "settings": "rig_set", "bag": "rig_bag"}
HELP = {
    "name": "rig of the fixtures rig and run: a name, a folder or a file",
    "sequence": "sequence of the fixture run (demo by default)",
    "seed": "seed of the fixture run (1 by default)",
    "settings": "NAME=VALUE, a setting of the rig; more than one is allowed",
    "bag": "folder or bag of the fixture bag",
}
ONLY_MARKED = ("controller", "level", "parameters")  # of Rig.simulate
RUNS = pytest.StashKey[dict]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options and their names in the ini file."""
    group = parser.getgroup("rig", "virtual powertrain test rig")
    for key, name in NAMES.items():
        several = key == "settings"
        group.addoption(f"--{name.replace('_', '-')}", dest=name, action="append" if several else "store", help=HELP[key])
        parser.addini(name, HELP[key], type="linelist" if several else "string", default=[] if several else None)


def pytest_configure(config: pytest.Config) -> None:
    """Name the marker, and keep the runs of the session."""
    config.addinivalue_line(
        "markers",
        f"rig({', '.join(f'{name}=' for name in (*NAMES, *ONLY_MARKED))}): what the fixtures rig, run and bag are made of",
    )
    config.stash[RUNS] = {}


def _settings(texts: list[str]) -> dict[str, str]:
    pairs = [text.partition("=") for text in texts]
    if wrong := next((text for text, sign, _ in pairs if not sign), None):
        pytest.fail(f"setting '{wrong}': expected NAME=VALUE, e.g. alfa46.t12=-200 ms", pytrace=False)
    return {name.strip(): value.strip() for name, _, value in pairs}


def _chosen(request: pytest.FixtureRequest) -> dict[str, Any]:
    """Return what was chosen: by the nearest marker, else on the command line, else in the ini file; settings add up."""
    config, out = request.config, {}
    base = config.inipath.parent if config.inipath else config.rootpath
    for key, name in NAMES.items():
        given, written = config.getoption(name), config.getini(name)
        if key == "settings":
            out[key] = {**_settings(written), **_settings(given or [])}
        elif given or written:
            out[key] = base / written if key == "bag" and not given else given or written
    for marker in reversed(list(request.node.iter_markers("rig"))):
        known = [*NAMES, *ONLY_MARKED]
        if len(marker.args) > 1 or (wrong := [name for name in marker.kwargs if name not in known]):
            what = f"has no {wrong[0]}" if len(marker.args) < 2 else "takes one name"
            pytest.fail(f"the marker rig {what}; it takes {', '.join(known)}", pytrace=False)
        marked = dict(zip(("name",), marker.args)) | marker.kwargs
        if "bag" in marked:
            marked["bag"] = request.path.parent / marked["bag"]
        out |= marked | {"settings": {**out["settings"], **marked.get("settings", {})}}
    return out


def _made(make: Callable[[], T]) -> T:
    """Return what a fixture makes, or fail with the sentence alone: within ``except`` pytest would print it twice."""
    try:
        return make()
    except RigError as error:
        said = str(error)
    pytest.fail(said, pytrace=False)


@pytest.fixture
def rig(request: pytest.FixtureRequest) -> rig_nodes.Rig:
    """The rig that was chosen, with its settings."""
    chosen = _chosen(request)
    if "name" not in chosen:
        pytest.fail("no rig is named; give --rig NAME, rig = NAME in the ini file, or @pytest.mark.rig(NAME)", pytrace=False)
    return _made(lambda: rig_nodes.load(chosen["name"], **chosen["settings"]))


@pytest.fixture
def run(request: pytest.FixtureRequest, rig: rig_nodes.Rig) -> rig_nodes.Run:
    """A simulated run of the rig; tests with the same choice share it."""
    chosen, runs = _chosen(request), request.config.stash[RUNS]
    asked = {"sequence": chosen.get("sequence", "demo"), **{name: chosen[name] for name in ONLY_MARKED if name in chosen}}
    seed = str(chosen.get("seed", 1))
    if not re.fullmatch(r"-?\d+", seed):
        pytest.fail(f"seed is '{seed}', expected a whole number", pytrace=False)
    key = repr((rig.source, sorted(rig.settings.items()), seed, asked))
    if key not in runs:
        runs[key] = _made(lambda: rig.simulate(**asked, seed=int(seed)))
    return runs[key]


@pytest.fixture
def bag(request: pytest.FixtureRequest) -> rig_nodes.Run:
    """The recorded run that was chosen."""
    chosen = _chosen(request)
    if "bag" not in chosen:
        pytest.fail(
            "no bag is named; give --rig-bag PATH, rig_bag = PATH in the ini file, or @pytest.mark.rig(bag=PATH)", pytrace=False
        )
    return _made(lambda: rig_nodes.open(Path(chosen["bag"])))
