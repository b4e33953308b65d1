# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Measures the speed of the compiled kernel: real-time factors and cost by phase of a run, with and without the logger's rows.

It is a part of ``rig bench``. The kernel runs in one thread; its time is processor time, so that other processes on the
machine affect it as little as possible.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from ...base import SAMPLE_NS
from ...plant import RPM
from ...rig import load_rig
from ...runs import CHUNK, Rig, Rows

if TYPE_CHECKING:
    from collections.abc import Callable

# variant -> settings of the rig, and whether the logger's rows are kept as in ``record``; the first is the usual variant
VARIANTS = {
    "10 kHz logging, averaged PWM": ({}, True),
    "no rows kept, averaged PWM": ({}, False),
    "no rows kept, averaged PWM, no trips": ({"trips.watched": "off"}, False),
    "no rows kept, true values (no transducers)": ({"effects.transducers": "off"}, False),
    "10 kHz logging, resolved PWM of 1 kHz": ({"effects.pwm_frequency": "1 kHz"}, True),
    "125 kHz logging (step 8 us), resolved PWM": ({"kernel.step": "8 us", "effects.pwm_frequency": "1 kHz"}, True),
}
SAMPLES_PER_S = 1_000_000_000 // SAMPLE_NS


class _Clock:
    """Advances a rig, keeps its rows if wanted, and records the cost: phase -> (steps, s)."""

    def __init__(self, rig: Rig, step: float, rows: bool) -> None:
        self.rig, self.spent, self._steps = rig, {}, round(SAMPLE_NS * 1e-9 / step)
        self._rows = Rows(rig, step) if rows else None

    def go(self, phase: str, seconds: float) -> None:
        samples = round(seconds * SAMPLES_PER_S)
        begin = time.thread_time()
        if self._rows is None:
            self.rig.advance_samples(samples)
        else:
            for done in range(0, samples, CHUNK):
                self.rig.advance_samples(min(CHUNK, samples - done))
                self._rows.take(self.rig.sample)
        spent = time.thread_time() - begin
        steps, before = self.spent.get(phase, (0, 0.0))
        self.spent[phase] = steps + samples * self._steps, before + spent


def drive(rig: Rig, go: Callable[[str, float], None]) -> None:
    """Run 12 s of a rig: oil supply on, gear I, 1500 rpm, load, an upshift and a downshift.

    Parameters
    ----------
    rig : Rig
        The rig.
    go : callable
        go(phase, seconds) advances the rig; the phases are standing, running and shifting.
    """
    rig.set("oil", 4e6, True)
    go("standing", 0.5)
    rig.order_gear(1)
    go("standing", 1.5)
    rig.set("motor", 1500.0 * RPM, True)
    go("running", 2.5)
    rig.set("load", 5e6, True)
    go("running", 1.5)
    rig.order_gear(2)
    go("shifting", 0.6)
    go("running", 2.4)
    rig.order_gear(1)
    go("shifting", 0.6)
    go("running", 2.4)


def variant(name: str, settings: dict[str, str], rows: bool, repeats: int) -> dict:
    """Measure one variant.

    Parameters
    ----------
    name : str
        The rig.
    settings : dict of str to str
        Settings of the rig.
    rows : bool
        Whether the logger's rows are kept.
    repeats : int
        Number of runs; for each phase the fastest counts.

    Returns
    -------
    dict
        Step [s], real-time factor of the whole run, and ns per step of each phase.
    """
    config = load_rig(name, settings)
    step = config.kernel.step
    Rig(config).advance_samples(1)  # compiles before the measurement
    best: dict[str, tuple[int, float]] = {}
    for _ in range(repeats):
        clock = _Clock(Rig(config), step, rows)
        drive(clock.rig, clock.go)
        best = {phase: min(spent, best.get(phase, spent), key=lambda pair: pair[1]) for phase, spent in clock.spent.items()}
    total_steps, total = sum(s for s, _ in best.values()), sum(t for _, t in best.values())
    return {
        "step_s": step,
        "real_time_factor": total_steps * step / total,
        "ns_per_step": {phase: 1e9 * t / s for phase, (s, t) in best.items()} | {"all": 1e9 * total / total_steps},
    }


def bench_kernel(rig: str, repeats: int = 5, tell: Callable[[str], object] = lambda text: None) -> dict:
    """Return the result of every variant on a rig, by its name."""
    out = {}
    for name, (settings, rows) in VARIANTS.items():
        tell(name)
        out[name] = variant(rig, settings, rows, repeats)
    return out
