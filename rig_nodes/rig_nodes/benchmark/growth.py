"""How the cost grows: with the length of a run, the number of clutches, the members of a sweep. Part ``scaling``.

Lengths and clutches by processor time in this process; the sweep by the clock on the wall, for its processes.
"""

from __future__ import annotations

import resource
import tempfile
import time
from pathlib import Path
from statistics import median

from ..bags.writer import BagWriter
from ..catalogue import catalogue
from ..testbench.configuration import load_rig
from ..testbench.outputs import Outputs
from ..testbench.rig import Rig
from .kernel import SAMPLES_PER_S, drive
from .machine import fastest, timed_rig
from .two_inertias import END, Ours

LENGTH, PART = 100, 10  # simulated s of the long run, of each part of it that is compared
CLUTCHES = (1, 2, 4, 8, 16)
MEMBERS = (4, 64)  # of two sweeps: the difference is free of what the start costs


def _memory() -> float:
    """Memory of this process now [MB]."""
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * resource.getpagesize() / 1e6


def by_length(tell=lambda text: None) -> list[dict]:
    """Cost per simulated second of each part of one run in gear under load; the median second of the part."""
    rig = Rig(load_rig("hydmag"))
    drive(rig, lambda _phase, seconds: rig.advance(seconds))
    out = []
    for begin in range(0, LENGTH, PART):
        tell(f"kernel, {begin} to {begin + PART} s")
        spent = []
        for _ in range(PART):
            since = time.thread_time()
            rig.advance(1.0)
            spent.append(time.thread_time() - since)
        out.append({"from_s": begin, "to_s": begin + PART, "ms_per_simulated_s": 1e3 * median(spent),
                    "fastest_ms": 1e3 * min(spent), "memory_mb": _memory()})
    return out


def streaming(tell=lambda text: None) -> list[dict]:
    """The same into a bag, as ``simulate`` writes it: all topics, on disk."""
    rig = Rig(load_rig("hydmag"))
    outputs = Outputs(rig, {}, commands=True)
    types = {name: topic.ros_type for name, topic in catalogue().all_topics.items()}
    out, size = [], 0
    with tempfile.TemporaryDirectory(prefix="rig-bench-") as folder, BagWriter(folder, "long") as bag:

        def go(_phase: str, seconds: float) -> None:
            for _ in range(round(seconds * SAMPLES_PER_S)):
                for topic, stamp, data in outputs.due():
                    bag.write(topic, types[topic], data, stamp)
                rig.advance_samples(1)

        drive(rig, go)
        for begin in range(0, LENGTH, 2 * PART):
            tell(f"into a bag, {begin} to {begin + 2 * PART} s")
            since = time.thread_time()
            go("", 2 * PART)
            spent, before, size = time.thread_time() - since, size, bag.path.stat().st_size
            out.append({"from_s": begin, "to_s": begin + 2 * PART, "ms_per_simulated_s": 1e3 * spent / (2 * PART),
                        "memory_mb": _memory(), "bag_mb_per_simulated_s": (size - before) / 2e6 / PART})
    return out


def by_clutches(tell=lambda text: None) -> list[dict]:
    """A row of bodies with a clutch between each two, all closing at once, at a step of 100 us."""
    out = []
    for clutches in CLUTCHES:
        tell(f"{clutches} clutches")
        line, step = Ours(clutches), 1e-4
        spent = fastest(lambda line=line: line.run(step), 0.25, least=2)
        out.append({"clutches": clutches, "ns_per_step": 1e9 * spent.cpu * step / END,
                    "real_time_factor": END / spent.cpu})
    return out


def by_members(tell=lambda text: None) -> list[dict]:
    """Members of a sweep over ``demo`` per second, metrics included, with one and two processes."""
    out = []
    with tempfile.TemporaryDirectory(prefix="rig-bench-") as folder:
        for jobs in (1, 2):
            walls = []
            for members in MEMBERS:
                tell(f"sweep of {members} members, {jobs} process{'es' * (jobs > 1)}")
                out_folder = str(Path(folder) / f"{jobs}-{members}")
                arguments = ["--samples", str(members), "--jobs", str(jobs), "--out", out_folder]
                walls.append(timed_rig(["sweep", "demo", "--vary", "alfa46.t12=-250 ms .. -150 ms", *arguments]).wall)
            more = walls[1] - walls[0]  # not above zero when somebody else had the machine while the small one ran
            out.append({"processes": jobs, "start_s": walls[0],
                        "members_per_s": (MEMBERS[1] - MEMBERS[0]) / more if more > 0.0 else None})
    return out


def bench_scaling(tell=lambda text: None) -> dict:
    """All of it, and the most memory that this process had [MB]."""
    out = {"length": by_length(tell), "streaming": streaming(tell), "clutches": by_clutches(tell),
           "sweep": by_members(tell)}
    return out | {"most_memory_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6}
