# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The plugin of pytest: fixtures ``rig``, ``run`` and ``bag``, chosen by the marker ``rig``, options or the ini file.

pytest loads it by an entry point in every project of the environment, so it imports nothing before a fixture is used.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
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
    "name": "rig of the fixtures: a name, a folder or a file",
    "sequence": "sequence of the fixture run (demo by default)",
    "seed": "seed of the fixture run (1 by default)",
    "settings": "NAME=VALUE, a setting of the rig; more than one is allowed",
    "bag": "folder, bag or logger's file of the fixture bag",
}
OF_RUN = ("controller", "level", "delay", "parameters")  # of Rig.simulate, in the marker alone
OF_FILE = ("profile", "orders", "period")  # of rig_nodes.open for a logger's file, in the marker alone
MARKED = (*NAMES, *OF_RUN, *OF_FILE)
FILES = ("name", "sequence", "profile")  # that may name a file
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
    named = ", ".join(f"{name}=" for name in MARKED)
    config.addinivalue_line("markers", f"rig({named}): what the fixtures rig, run and bag are made of")
    config.stash[RUNS] = {}


def _settings(texts: list[str]) -> dict[str, str]:
    pairs = [text.partition("=") for text in texts]
    if wrong := next((text for text, sign, _ in pairs if not sign), None):
        pytest.fail(f"setting '{wrong}': expected NAME=VALUE, e.g. alfa46.t12=-200 ms", pytrace=False)
    return {name.strip(): value.strip() for name, _, value in pairs}


def _marked(marker: pytest.Mark) -> dict[str, Any]:
    """Return what a marker chooses."""
    if len(marker.args) > 1 or (wrong := [name for name in marker.kwargs if name not in MARKED]):
        what = f"has no {wrong[0]}" if len(marker.args) < 2 else "takes one name"
        pytest.fail(f"the marker rig {what}; it takes {', '.join(MARKED)}", pytrace=False)
    chosen = dict(zip(("name",), marker.args)) | marker.kwargs
    if not isinstance(chosen.get("settings", {}), Mapping):
        pytest.fail(f"settings is {chosen['settings']!r}, expected a dict of names and values", pytrace=False)
    return chosen


def _placed(key: str, value: Any, file: Path) -> Any:
    """Return what was chosen; a file that it names is taken relative to the folder of the file in which it is chosen."""
    from ..base import RIG_FILE, beside

    if key == "bag":
        return file.parent / value
    if key not in FILES or not isinstance(value, str | Path):
        return value
    folder = file.parent / value
    return str(folder) if key == "name" and (folder / RIG_FILE).is_file() else beside(file, value)


def _chosen(request: pytest.FixtureRequest) -> dict[str, Any]:
    """Return what was chosen: by the nearest marker, else on the command line, else in the ini file.

    Settings of all three add up where they are for the same rig: those beside another rig's name are left out.
    """
    config = request.config
    lines = {key: (config.getini(name), config.getoption(name)) for key, name in NAMES.items()}
    written, given = ({key: both[k] for key, both in lines.items() if both[k]} for k in (0, 1))
    sources = [(config.inipath or config.rootpath / "ini", written), (config.invocation_params.dir / "command line", given)]
    for _, one in sources:
        one["settings"] = _settings(one.get("settings", []))
    sources += [(request.path, _marked(marker)) for marker in reversed(list(request.node.iter_markers("rig")))]
    out: dict[str, Any] = {}
    settings = []  # with the rig for which they are, None where none was named yet
    for file, one in sources:
        out |= {key: _placed(key, value, file) for key, value in one.items() if key != "settings"}
        settings.append((out.get("name"), one.get("settings", {})))
    of_rig = [values for rig, values in settings if rig in (None, out.get("name"))]
    return out | {"settings": {name: value for values in of_rig for name, value in values.items()}}


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
    asked = {"sequence": chosen.get("sequence", "demo"), **{name: chosen[name] for name in OF_RUN if name in chosen}}
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

    def opened() -> rig_nodes.Run:
        from ..bags import is_loggers_file

        more = {name: chosen[name] for name in OF_FILE if name in chosen}
        if "name" in chosen and is_loggers_file(str(chosen["bag"])):
            more["rig"] = rig_nodes.load(chosen["name"], **chosen["settings"])
        return rig_nodes.open(chosen["bag"], **more)

    return _made(opened)
