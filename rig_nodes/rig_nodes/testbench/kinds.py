# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The kinds of rigs, the gearbox's and the clutch bench, and what of each belongs together.

Used by whoever works with any of them: testbench.outputs, testbench.record, testbench.simulate and the nodes.
"""

from __future__ import annotations

from ..catalogue import GEARBOX
from .clutch_bench import ClutchBench
from .clutch_bench_configuration import KIND, ClutchBenchConfig
from .clutch_bench_topics import BenchStates
from .configuration import RigConfig
from .rig import Rig
from .topics import States

# kind of rig -> topic whose messages bring simulated time to the other processes
PACE = {GEARBOX: "/instruments/controller", KIND: "/hydraulic_motor/state"}
AnyConfig = RigConfig | ClutchBenchConfig
AnyRig = Rig | ClutchBench


def make_rig(config: AnyConfig, seed: int = 1) -> AnyRig:
    """The rig of a configuration, of its kind, with what controls it inside."""
    return Rig(config, seed) if config.kind == GEARBOX else ClutchBench(config, seed)


def states_of(rig: AnyRig) -> States | BenchStates:
    """What the topics of a rig say."""
    return States(rig) if isinstance(rig, Rig) else BenchStates(rig)
