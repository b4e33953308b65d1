# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A rig for tests, and a way to bring it into a steady state."""

import math
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.rig import Rig

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "benchmarks"))  # cut_errors.py

RPM = math.pi / 30.0


@pytest.fixture(scope="session")
def config():
    return load_rig("hydmag")


@pytest.fixture(scope="session")
def noiseless():
    """Makes a configuration whose channels show the true values from one with transducers."""

    def make(config):
        return config.replaced(effects=replace(config.effects, transducers=False))

    return make


@pytest.fixture(scope="session")
def steady_rig(config):
    """Makes a rig that runs settled in a gear at a motor speed [rpm] with a relief setting [Pa]."""

    def make(gear: int, rpm: float, relief: float, seed: int = 1) -> Rig:
        rig = Rig(config, seed)
        rig.set("oil", 4e6, True)
        rig.advance(0.3)
        rig.order_gear(gear)
        rig.advance(1.0)
        rig.set("motor", rpm * RPM, True)
        rig.set("load", relief, True)
        rig.advance(round(rpm / 750.0) + 6.0)
        return rig

    return make
