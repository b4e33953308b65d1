# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Compiles on two cores when nothing is kept yet; called by testbench.rig_base.

One compilation is one thread of Python. The driveline's general step takes half of all the time of the first rig, and the
engine needs it only to move: a second process compiles it into the same cache meanwhile.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def compiling_in_parallel(driven: bool) -> Iterator[bool]:
    """While the block runs, another process compiles the driveline's general or driven step, if it is not kept yet; True if so.

    If that one fails, whoever needs the step compiles it, later and as ever.
    """
    kept = Path(os.environ["NUMBA_CACHE_DIR"]) / f"{'driven' if driven else 'general'}_step.compiled"
    if kept.exists():
        yield False
        return
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    command = [
        sys.executable,
        "-c",
        "import gc; gc.disable(); "  # a twentieth of its time
        f"from rig_nodes.engine.general_step import addresses; addresses({driven})",
    ]
    other = subprocess.Popen(command, env=env, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        yield True
        other.wait()
        if other.returncode == 0 and kept.parent.is_dir():
            kept.touch()
    finally:
        other.kill()
        other.wait()
