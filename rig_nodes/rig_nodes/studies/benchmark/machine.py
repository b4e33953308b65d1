# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Description of the measuring machine (processor, cores, versions), and the timing of calls and of programs.

The other modules of this package and the verb ``bench`` use it.
"""

from __future__ import annotations

import os
import platform
import subprocess
import sys
import time
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version
from typing import NamedTuple

from ...base import RigError

PACKAGES = ("numpy", "numba", "llvmlite", "scipy")
TIMEOUT = 600.0  # s; longest time of one program


def machine() -> dict[str, str | int | float]:
    """Return the processor, the usable cores, the versions, and the load: the number of processes that waited for the cores."""
    with open("/proc/cpuinfo", encoding="utf-8") as info:
        names = [line.split(":", 1)[1].strip() for line in info if line.startswith("model name")]
    return {
        "cpu": names[0] if names else platform.machine(),
        "cores": len(os.sched_getaffinity(0)),
        "load": round(os.getloadavg()[0], 2),
        "system": f"{platform.system()} {platform.release()}",
        "python": platform.python_version(),
        **{name: version(name) for name in PACKAGES},
    }


def installed(name: str) -> str | None:
    """Return the version of a peer, None when it is not installed."""
    try:
        return version(name)
    except PackageNotFoundError:
        return None


class Spent(NamedTuple):
    """Time of a call or a program.

    Parameters
    ----------
    wall : float
        Wall time [s].
    cpu : float
        Processor time of this process, or of its children [s].
    """

    wall: float
    cpu: float


def fastest(action: Callable[[], object], budget: float = 0.25, least: int = 3, most: int = 200) -> Spent:
    """Return the time of the fastest of several calls, after one that is not counted.

    Parameters
    ----------
    action : callable
        The call to time.
    budget : float
        Time for all calls [s].
    least, most : int
        Smallest and largest number of calls.

    Returns
    -------
    Spent
        The smallest wall time and the smallest processor time of one call.
    """
    action()
    best, begun, calls = Spent(float("inf"), float("inf")), time.perf_counter(), 0
    while calls < least or (calls < most and time.perf_counter() - begun < budget):
        wall, cpu = time.perf_counter(), time.thread_time()
        action()
        best = Spent(min(best.wall, time.perf_counter() - wall), min(best.cpu, time.thread_time() - cpu))
        calls += 1
    return best


def timed_rig(arguments: list[str], env: dict[str, str] | None = None) -> Spent:
    """Return the time of ``rig`` with these arguments, including the child processes for which it waits.

    Parameters
    ----------
    arguments : list of str
        Arguments of ``rig``.
    env : dict of str to str, or None
        Further variables of the environment.

    Returns
    -------
    Spent
        Wall time and processor time.

    Raises
    ------
    RigError
        When ``rig`` fails or takes more than 600 s.
    """
    before, begun = os.times(), time.perf_counter()
    try:
        done = subprocess.run(
            [sys.executable, "-P", "-m", "rig_nodes", *arguments],
            capture_output=True,
            env={**os.environ, **(env or {})},
            text=True,
            timeout=TIMEOUT,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise RigError(f"rig {' '.join(arguments)} took more than {TIMEOUT:.0f} s while it was measured") from None
    wall, after = time.perf_counter() - begun, os.times()
    if done.returncode:
        last_line = (done.stdout + done.stderr).strip().rpartition("\n")[2]
        raise RigError(f"rig {' '.join(arguments)} failed while it was measured: {last_line or 'it printed no message'}")
    return Spent(wall, after.children_user + after.children_system - before.children_user - before.children_system)
