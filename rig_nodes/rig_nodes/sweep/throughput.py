"""How many members of a sweep a second some processes finish, with what the parent costs: for benchmarks.

Used by tests/benchmarks/sweep_throughput.py, and open to ``rig bench``.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

from ..testbench.workers import Workers
from .plan import make_plan
from .run import manifest_of, run_sweep
from .store import Store


def sweep_throughput(workers: int, members: int = 60, sequence: str = "demo") -> dict[str, float]:
    """A sweep of ``members`` runs on so many processes, all of them warm; 1: the members run in this one.

    Counted from the first member given to the table written: seconds, members_per_second, and parent_cpu_seconds, what
    this process computed itself. On an idle machine members_per_second of two over one is the gain of the second core.
    """
    plan = make_plan(sequence, {"alfa46.t12": "-250 ms .. -150 ms"}, samples=members)
    first = make_plan(sequence, {"alfa46.t12": "-250 ms .. -150 ms"}, samples=4 * workers)
    with tempfile.TemporaryDirectory() as folder, Workers(workers) as processes:
        with Store(Path(folder) / "first", manifest_of(first, False)) as store:
            run_sweep(first, store, processes.stream)
        with Store(Path(folder) / "sweep", manifest_of(plan, False)) as store:
            began, cpu = time.perf_counter(), time.process_time()
            run_sweep(plan, store, processes.stream)
            store.write_results(plan)
            seconds, cpu = time.perf_counter() - began, time.process_time() - cpu
    return {"workers": workers, "members": members, "seconds": seconds, "members_per_second": members / seconds,
            "parent_cpu_seconds": cpu}
