# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Compiles the gearbox's kernel on two cores when none of it is kept yet; called by testbench.rig.

One compilation is one thread of Python. The driveline's step takes half of all the time and needs nothing of the rest:
a second process compiles it into the same cache meanwhile, and whoever asks for it finds it there.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numba
from numba.core import types

from . import kernel
from .driveline_kernel import driveline_step
from .driveline_quiet import quiet_step

_STEP = ("minv", "w", "sh", "kc", "q", "cap", "loss", "v", "twist", "mode", "el", "shaft", "e_in", "events", "count",
         "work")
_QUIET = ("minv", "w", "q", "cap", "loss", "v", "mode", "el", "e_in", "work")


def _fields(names) -> list:
    line = numba.from_dtype(kernel.DRIVELINE)
    return [line.typeof(name) for name in names]


def compile_driveline() -> None:
    """The driveline's step as the kernel calls it, into the cache."""
    driveline_step.compile((types.float64, types.float64, *_fields(_STEP)))


def compile_beside(first) -> None:
    """Call ``first``, which compiles other parts; when nothing is kept yet, another process has the step by the end.

    If that one fails, this process compiles the step itself, later and as ever.
    """
    if any(Path(os.environ["NUMBA_CACHE_DIR"]).glob("plant_*/driveline_kernel.driveline_step-*.nbi")):
        first()
        return
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    command = [sys.executable, "-c", "import gc; gc.disable(); "  # a twentieth of its time
               "from rig_nodes.plant.first_start import compile_driveline; compile_driveline()"]
    other = subprocess.Popen(command, env=env, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        first()
        pair = types.UniTuple(types.int64, 2)
        quiet_step.compile((types.float64, *_fields(_QUIET), pair, pair))
        other.wait()
    finally:
        other.kill()
        other.wait()
