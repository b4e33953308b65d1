# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The rig's FMUs of both versions, built once."""

import sys
from pathlib import Path

import pytest

from rig_nodes.controllers.c.library import INCLUDE
from rig_nodes.controllers.fmi.importer import Fmu
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.fmu.build import build_controller_fmu, build_rig_fmu

sys.path.insert(0, str(Path(__file__).parent))  # for test_state.py


@pytest.fixture(scope="session")
def rig_fmu(tmp_path_factory):
    """Returns the path of the rig's FMU of a version of FMI."""
    folder, built = tmp_path_factory.mktemp("fmu"), {}

    def get(fmi=2):
        if fmi not in built:
            built[fmi] = folder / f"hydmag{fmi}.fmu"
            build_rig_fmu(built[fmi], "hydmag", fmi=fmi)
        return built[fmi]

    return get


@pytest.fixture(scope="session")
def controller_fmu(tmp_path_factory):
    """Returns the path of the reference controller as an FMU of a version of FMI, in a folder of its own."""
    built, flags = {}, ["-O0"]  # in half the time of -O2; tests/controllers/test_fmu.py compares bits

    def get(fmi):
        if fmi not in built:
            built[fmi] = tmp_path_factory.mktemp("controller") / "alfa46.fmu"
            build_controller_fmu([INCLUDE.parent / "examples" / "alfa46.c"], built[fmi], load_rig("hydmag"), fmi, flags)
        return built[fmi]

    return get


@pytest.fixture(scope="session")
def _instances(rig_fmu):
    """One instance of each version, which the tests share, because starting one takes a second."""
    made = {}
    yield made
    for instance in made.values():
        instance.close()


@pytest.fixture(params=[2, 3], ids=["FMI 2.0", "FMI 3.0"])
def fmu(request, rig_fmu, _instances):
    """An instance of the rig's FMU of each version, in its initial state."""
    if request.param not in _instances:
        _instances[request.param] = Fmu(rig_fmu(request.param))
    _instances[request.param].reset()
    return _instances[request.param]


@pytest.fixture
def fmu2(rig_fmu, _instances):
    """An instance of FMI 2.0, in its initial state."""
    if 2 not in _instances:
        _instances[2] = Fmu(rig_fmu())
    _instances[2].reset()
    return _instances[2]
