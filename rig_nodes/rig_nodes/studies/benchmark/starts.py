# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Measures whole commands: ``simulate demo`` before and after compilation, help, report, and the node graph in lockstep.

These are the parts demo and graph of ``rig bench``. Each command is a separate program; its wall time and its processor
time are measured.
"""

from __future__ import annotations

import json
import tempfile
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from .machine import timed_rig

if TYPE_CHECKING:
    from collections.abc import Callable


def bench_demo(repeats: int = 5, tell: Callable[[str], object] = lambda text: None) -> dict:
    """Measure simulate demo with nothing compiled and with everything compiled, the report of its bag, and the help."""
    out = {}
    with tempfile.TemporaryDirectory(prefix="rig-bench-") as folder:
        env, runs = {"NUMBA_CACHE_DIR": str(Path(folder) / "cache")}, Path(folder)
        tell("simulate demo, nothing compiled yet")
        out["simulate demo, first run"] = timed_rig(["simulate", "demo", "--out", str(runs / "cold")], env)._asdict()
        for name, arguments in (
            ("simulate demo, warm", ["simulate", "demo", "--out"]),
            ("report of that run", ["report", str(runs / "cold")]),
            ("help", ["--help"]),
        ):
            tell(name)
            spent = [
                timed_rig([*arguments, str(runs / f"warm{k}")] if arguments[-1] == "--out" else arguments, env)
                for k in range(repeats)
            ]
            out[name] = {"wall": min(s.wall for s in spent), "cpu": min(s.cpu for s in spent)}
    return out


def bench_graph(repeats: int = 3, tell: Callable[[str], object] = lambda text: None) -> dict | str:
    """Return the real-time factor of the lockstep graph on demo in each repeat; or one line on a missing package."""
    if find_spec("rclpy") is None:
        return "rclpy is not installed"
    factors = []
    with tempfile.TemporaryDirectory(prefix="rig-bench-") as folder:
        for k in range(repeats):
            tell(f"run demo --speed max, {k + 1} of {repeats}")
            timed_rig(["run", "demo", "--speed", "max", "--out", str(Path(folder) / str(k))])
            report = json.loads((Path(folder) / str(k) / "report.json").read_text(encoding="utf-8"))
            factors.append(report["run"]["speed_factor"])
    return {"real_time_factors": factors, "best": max(factors)}
