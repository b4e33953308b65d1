# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Compiles a rig's engine on two cores when none of it is kept yet; called by testbench.timed.

One compilation is one thread of Python. The driveline's step takes half of all the time and needs nothing of the rest:
a second process compiles it into the same cache meanwhile, and whoever asks for it finds it there.
"""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

import numba
import numpy as np
from numba.core import types

from ..plant.driveline_kernel import driveline_step
from .world import STEP, Sizes, driveline_dtype


def compile_driveline(sizes: str) -> None:
    """The driveline's step as the engine of a rig of these sizes (JSON) calls it, into the cache."""
    line = numba.from_dtype(driveline_dtype(Sizes(**json.loads(sizes))))
    driveline_step.compile((types.float64, types.float64, *map(line.typeof, STEP)))


def compile_beside(world: np.dtype, sizes: Sizes, first: Callable[[], object]) -> None:
    """Call ``first``, which compiles other parts; when nothing is kept yet for such a world, another process has the
    driveline's step by the end.

    If that one fails, this process compiles the step itself, later and as ever.
    """
    kept = Path(os.environ["NUMBA_CACHE_DIR"]) / f"{hashlib.sha256(str(world).encode()).hexdigest()[:16]}.compiled"
    if kept.exists():
        first()
        return
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    command = [sys.executable, "-c", "import gc, sys; gc.disable(); "  # a twentieth of its time
               "from rig_nodes.engine.first_start import compile_driveline; compile_driveline(sys.argv[1])",
               json.dumps(asdict(sizes))]
    other = subprocess.Popen(command, env=env, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        first()
        other.wait()
        if other.returncode == 0 and kept.parent.is_dir():
            kept.touch()
    finally:
        other.kill()
        other.wait()
