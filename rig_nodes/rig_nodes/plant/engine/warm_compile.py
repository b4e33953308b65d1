# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Compiles on two cores when the cache is empty; called by runs.rig_base.

A process compiles in one thread only. The driveline's general step takes half of the compile time of the first rig, and the engine
does not need it before its first step: a second process compiles it into the same cache in the meantime.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def compiling_in_parallel(driven: bool) -> Iterator[None]:
    """Let another process compile the driveline's general or driven step while the block runs, if it is not in the cache yet.

    If that process fails, the process that needs the step compiles it later, as usual.

    Parameters
    ----------
    driven : bool
        True for the driven step, False for the general one.
    """
    kept = Path(os.environ["NUMBA_CACHE_DIR"]) / f"{'driven' if driven else 'general'}_step.compiled"
    if kept.exists():
        yield
        return
    # at the second level the same code takes a tenth less time to compile, and the step is as fast
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path)), "NUMBA_OPT": os.environ.get("NUMBA_OPT", "2")}
    command = [sys.executable, "-c", f"from rig_nodes.plant.engine.general_step import addresses; addresses({driven})"]
    other = subprocess.Popen(command, env=env, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        yield
        other.wait()
        if other.returncode == 0 and kept.parent.is_dir():
            kept.touch()
    finally:
        other.kill()
        other.wait()
