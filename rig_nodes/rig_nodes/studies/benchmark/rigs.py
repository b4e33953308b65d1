# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Measures the speed of each installed rig with a sequence of its own, with the rows of the 10 kHz logger kept.

It is a part of ``rig bench``. The time is the processor time of one thread and includes the sequencer.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from ...base import RigError, installed, with_bases
from ...rig import load_rig
from ...runs import Rig, load_sequence, record

if TYPE_CHECKING:
    from collections.abc import Callable

SEQUENCE = "demo"


def own_sequence(rig: str) -> str | None:
    """Return the file of a rig's demo, or else of another sequence of its folder or of its base rigs; None when there is none."""
    for path, _ in with_bases(rig):
        found = {one.stem: str(one) for one in sorted((path.parent / "sequences").glob("*.yaml"))}
        if found:
            return found.get(SEQUENCE, next(iter(found.values())))
    return None


def bench_rigs(repeats: int = 5, tell: Callable[[str], object] = lambda text: None) -> dict:
    """Measure all installed rigs.

    Parameters
    ----------
    repeats : int
        Number of runs of each rig; the fastest counts.
    tell : callable
        Receives the name of each rig before it is measured.

    Returns
    -------
    dict
        Rig -> ``simulated_s``, ``real_time_factor`` and ``step_s``.

    Raises
    ------
    RigError
        When a run does not reach the end of its sequence.
    """
    out = {}
    for rig in installed("rigs"):
        tell(rig)
        sequence = own_sequence(rig)
        if sequence is None:
            continue
        config = load_rig(rig)
        Rig(config).advance_samples(1)  # compiles before the measurement
        best = simulated = 0.0
        for _ in range(repeats):
            loaded = load_sequence(sequence, None, rig)
            begin = time.thread_time()
            run = record(config, loaded)
            spent = time.thread_time() - begin
            if run.end["state"] != "ended":
                raise RigError(f"rig {rig}: {sequence} {run.end['state']}: {run.end['reason']}")
            simulated = run.recording.rows * run.recording.period
            best = max(best, simulated / spent)
        out[rig] = {"simulated_s": simulated, "real_time_factor": best, "step_s": config.kernel.step}
    return out
