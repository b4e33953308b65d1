# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Measures the growth of the cost with the length of a run, the number of clutches and the processes of a sweep (part ``scaling``).

Lengths and clutches are measured by processor time in this process; the sweep is measured by wall time, because it has
processes of its own.
"""

from __future__ import annotations

import resource
import tempfile
import time
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING

from ...bags import BagWriter
from ...rig import load_rig
from ...runs import BagOutputs, Rig, Workers
from ..sweep.plan import Plan, make_plan
from ..sweep.run import manifest_of, run_sweep
from ..sweep.store import Store
from .kernel import SAMPLES_PER_S, drive
from .machine import fastest
from .two_inertias import END, Ours

if TYPE_CHECKING:
    from collections.abc import Callable

LENGTH, PART = 100, 10  # simulated time [s] of the long run and of each of its parts
CLUTCHES = (1, 2, 4, 8, 16, 32)
MEMBERS, ROUNDS = 60, 3  # members of a sweep, and sweeps with each number of processes


def _memory() -> float:
    """Return the present memory of this process [MB]."""
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * resource.getpagesize() / 1e6


def by_length(name: str, tell: Callable[[str], object] = lambda text: None) -> list[dict]:
    """Return the cost per simulated second in each part of one run in gear under load: the median of the part's seconds."""
    rig = Rig(load_rig(name))
    drive(rig, lambda _phase, seconds: rig.advance(seconds))
    out = []
    for begin in range(0, LENGTH, PART):
        tell(f"kernel, {begin} to {begin + PART} s")
        spent = []
        for _ in range(PART):
            since = time.thread_time()
            rig.advance(1.0)
            spent.append(time.thread_time() - since)
        out.append(
            {
                "from_s": begin,
                "to_s": begin + PART,
                "ms_per_simulated_s": 1e3 * median(spent),
                "fastest_ms": 1e3 * min(spent),
                "memory_mb": _memory(),
            }
        )
    return out


def streaming(name: str, tell: Callable[[str], object] = lambda text: None) -> list[dict]:
    """Return the same cost for a run whose topics are all written to a bag on disk, as by ``simulate``."""
    rig = Rig(load_rig(name))
    out, size = [], 0
    with tempfile.TemporaryDirectory(prefix="rig-bench-") as folder, BagWriter(folder, "long") as bag:
        outputs = BagOutputs(bag, rig, {}, commands=True)

        def go(_phase: str, seconds: float) -> None:
            end = rig.sample + round(seconds * SAMPLES_PER_S)
            while rig.sample < end:
                outputs.boundary()
                rig.advance_samples(min(outputs.room, end - rig.sample))

        drive(rig, go)
        for begin in range(0, LENGTH, 2 * PART):
            tell(f"into a bag, {begin} to {begin + 2 * PART} s")
            since = time.thread_time()
            go("", 2 * PART)
            spent, before, size = time.thread_time() - since, size, bag.path.stat().st_size
            out.append(
                {
                    "from_s": begin,
                    "to_s": begin + 2 * PART,
                    "ms_per_simulated_s": 1e3 * spent / (2 * PART),
                    "memory_mb": _memory(),
                    "bag_mb_per_simulated_s": (size - before) / 2e6 / PART,
                }
            )
    return out


def by_clutches(tell: Callable[[str], object] = lambda text: None) -> list[dict]:
    """Return the cost of a row of bodies with a clutch between each two neighbours, which all close at once; the step is 100 us."""
    out = []
    for clutches in CLUTCHES:
        tell(f"{clutches} clutches")
        line, step = Ours(clutches), 1e-4
        spent = fastest(lambda line=line, step=step: line.run(step), 0.25, least=2)
        out.append({"clutches": clutches, "ns_per_step": 1e9 * spent.cpu * step / END, "real_time_factor": END / spent.cpu})
    return out


def by_members(rig: str, tell: Callable[[str], object] = lambda text: None) -> list[dict]:
    """Return members per second of a sweep over ``demo`` with its table, the best of several, for one and for two processes."""
    best: dict[int, dict] = {}
    for number in range(ROUNDS):
        for processes in (1, 2):
            tell(f"sweep of {MEMBERS} members, {processes} process{'es' * (processes > 1)}, {number + 1} of {ROUNDS}")
            found = _sweep(rig, processes)
            if processes not in best or found["members_per_s"] > best[processes]["members_per_s"]:
                best[processes] = found
    return list(best.values())


def _sweep(rig: str, processes: int) -> dict:
    """Measure one sweep from its first member to the written table, with everything compiled; a single process is this process."""
    vary = {"alfa46.t12": "-250 ms .. -150 ms"}
    plan, first = make_plan(Plan("demo", rig, samples=MEMBERS), vary), make_plan(Plan("demo", rig, samples=4 * processes), vary)
    with tempfile.TemporaryDirectory(prefix="rig-bench-") as folder, Workers(processes) as workers:
        with Store(Path(folder) / "first", manifest_of(first, False)) as store:
            run_sweep(first, store, workers.stream)
        with Store(Path(folder) / "sweep", manifest_of(plan, False)) as store:
            began, cpu = time.perf_counter(), time.process_time()
            run_sweep(plan, store, workers.stream)
            store.write_results(plan)
            wall, cpu = time.perf_counter() - began, time.process_time() - cpu
    return {"processes": processes, "members_per_s": MEMBERS / wall, "parent_cpu_s": cpu}


def bench_scaling(rig: str, tell: Callable[[str], object] = lambda text: None) -> dict:
    """Return the measurements of this module on a rig, and the largest memory of this process [MB]."""
    out = {
        "length": by_length(rig, tell),
        "streaming": streaming(rig, tell),
        "clutches": by_clutches(tell),
        "sweep": by_members(rig, tell),
    }
    return out | {"most_memory_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6}
