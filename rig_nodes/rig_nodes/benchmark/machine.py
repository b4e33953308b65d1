"""What was measured on: processor, cores, versions; and the two clocks. Used by the other modules of this package."""

from __future__ import annotations

import os
import platform
import subprocess
import time
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version
from typing import NamedTuple

PACKAGES = ("numpy", "numba", "llvmlite", "scipy")
PEERS = ("scipy", "pathsim", "mujoco", "drake")


def machine() -> dict[str, str | int | float]:
    """Processor, cores that may be used, versions, and how many others waited for them at the beginning."""
    cpu = platform.processor() or platform.machine()
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as info:
            cpu = next((line.split(":", 1)[1].strip() for line in info if line.startswith("model name")), cpu)
    except OSError:
        pass  # not Linux: what Python knows has to do
    return {"cpu": cpu, "cores": len(os.sched_getaffinity(0)), "load": round(os.getloadavg()[0], 2),
            "system": f"{platform.system()} {platform.release()}", "python": platform.python_version(),
            **{name: version(name) for name in PACKAGES}}


def installed(name: str) -> str | None:
    """Version of a peer, None when it is not there."""
    try:
        return version(name)
    except PackageNotFoundError:
        return None


class Spent(NamedTuple):
    """wall: clock on the wall [s]; cpu: time of the processor in this process, or in its children [s]."""

    wall: float
    cpu: float


def fastest(action: Callable[[], object], budget: float = 0.25, least: int = 3, most: int = 200) -> Spent:
    """The fastest of some calls, each by itself: as many as the budget [s] allows, after one that is not counted."""
    action()
    best, begun, calls = Spent(float("inf"), float("inf")), time.perf_counter(), 0
    while calls < least or (calls < most and time.perf_counter() - begun < budget):
        wall, cpu = time.perf_counter(), time.thread_time()
        action()
        best = Spent(min(best.wall, time.perf_counter() - wall), min(best.cpu, time.thread_time() - cpu))
        calls += 1
    return best


def run(command: list[str], env: dict[str, str] | None = None, timeout: float = 300.0) -> tuple[int, str, Spent]:
    """Exit code, what it said and time of a program with all its children; it is killed after ``timeout`` [s]."""
    before, begun = os.times(), time.perf_counter()
    done = subprocess.run(command, env={**os.environ, **(env or {})}, capture_output=True, text=True, timeout=timeout,
                          check=False)
    wall, after = time.perf_counter() - begun, os.times()
    cpu = after.children_user + after.children_system - before.children_user - before.children_system
    return done.returncode, done.stdout + done.stderr, Spent(wall, cpu)
