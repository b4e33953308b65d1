# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The rig's clock in real time: an absolute schedule of samples, and how late its ticks start.

The rig container uses it, and alfa46, recorder and sequencer for their priority. Simulated time follows the wall clock and is
never skipped.
"""

from __future__ import annotations

import ctypes
import gc
import os
import sys
import threading
import time
from array import array
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

PR_SET_TIMERSLACK = 29
SENDS_AGAIN = "dds.asyn"  # begin of the names of the threads of Fast DDS that do
# The clock of the rig comes first, then samples and commands, then what is recorded of them, then the steps of a sequence.
STEPS, RECORDING, MESSAGES, CLOCK = 8, 9, 10, 11
# Catching up runs at most this much faster than real time, so that the shift controller can still answer.
CATCH_UP = 4
# A rig that is further behind real time than this has lost time: the newest valve command may be that old before the
# rig trips, so no controller in real time could have answered meanwhile. Healthy runs on two cores that a dozen other
# programs wanted too were up to 82 ms behind.
BEHIND_NS = 100_000_000
# A gap of this length between two samples is no lateness of a busy machine: the rig stood still, as by SIGSTOP or a suspended
# machine, and a real one would have gone on without its controller. The schedule stands while the machine is suspended; the clock
# of the gap does not.
STOOD_NS = 1_000_000_000


def prefer(priority: int, thread: int = 0) -> bool:
    """Make a thread run before others, as far as that is allowed.

    Parameters
    ----------
    priority : int
        Real-time priority.
    thread : int
        Id of the thread; 0 for this thread.

    Returns
    -------
    bool
        True when it got real-time priority, which takes root or an rtprio limit.
    """
    try:
        # threads that it starts later begin without
        os.sched_setscheduler(thread, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(priority))
        return True
    except OSError:
        return False


def prefer_process(priority: int) -> None:
    """Call :func:`prefer` for the threads of this process, once its nodes are set up, and for those of DDS except one group.

    If it were called earlier, the work of starting would delay another rig on this machine. The threads that send messages again
    to a slow subscriber (``dds.asyn``, idle otherwise) keep their priority: with the rig's they took the time that the
    subscriber lacked, so that it became slower still, until two cores were full.
    """
    for thread in os.listdir("/proc/self/task"):
        try:
            name = Path(f"/proc/self/task/{thread}/comm").read_text()
        except OSError:  # it has ended
            continue
        if not name.startswith(SENDS_AGAIN):
            prefer(priority, int(thread))


def take_core(number: int) -> None:
    """Bind this thread to one core of the processor: container 0, controller 1, and others where rigs share a machine.

    In lockstep the two wake each other for every sample, and the scheduler would put both on one core, where each answer
    waits until its sender is displaced. It has no effect with fewer than two cores.
    """
    cores = sorted(os.sched_getaffinity(0))
    if len(cores) > 1:
        domain = int(os.environ.get("ROS_DOMAIN_ID") or 0)
        os.sched_setaffinity(0, {cores[(2 * domain + number) % len(cores)]})


def stand_back() -> None:
    """Lower the priority, so that this thread does not displace the one that has just given it something to do."""
    os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), 10)


class RealTime:
    """Calls ``step()`` once per period at the times of an absolute schedule.

    Parameters
    ----------
    period_ns : int
        Time between two steps [ns].
    per_tick : int
        Number of steps in a tick.

    Attributes
    ----------
    lateness_ns : array of int
        Start of each tick after its time in the schedule [ns].
    """

    def __init__(self, period_ns: int, per_tick: int) -> None:
        self.period_ns, self.per_tick = period_ns, per_tick
        self.lateness_ns = array("q")
        self.overruns = 0
        self.times_behind = 0
        self.real_time_priority = False

    def run(self, step: Callable[[], None], stop: Callable[[], bool], stood: Callable[[float], None]) -> None:
        """Step until ``stop()`` is true at the start of a tick, so that no tick is cut.

        Parameters
        ----------
        step : callable
            Does one sample.
        stop : callable
            Returns whether to end.
        stood : callable
            It is called with the time [s] for which the rig stood still, before the next sample.
        """
        gc.collect()
        gc.freeze()  # objects made at the start are never scanned again, so that collections stay far below a sample
        self.real_time_priority = prefer(CLOCK)
        ctypes.CDLL(None).prctl(PR_SET_TIMERSLACK, 1000, 0, 0, 0)  # ns; 50 us otherwise
        sys.setswitchinterval(0.0002)
        period, per_tick, tick_ns = self.period_ns, self.per_tick, self.period_ns * self.per_tick
        clock, sleep = time.monotonic_ns, time.sleep
        since_boot = partial(time.clock_gettime_ns, time.CLOCK_BOOTTIME)
        due, count, last, behind = clock(), 0, 0, False
        awake = since_boot()
        while True:
            now = clock()
            start = max(due, last + period // CATCH_UP)
            if now < start:
                sleep((start - now) * 1e-9)
                now = clock()
            before, awake = awake, since_boot()
            if count and awake - before > STOOD_NS:
                stood((awake - before) * 1e-9)
            last = now
            if count % per_tick == 0:
                if stop():
                    return
                late = now - due
                self.lateness_ns.append(late)
                if late > tick_ns:
                    self.overruns += 1
                if (late > BEHIND_NS) != behind:
                    behind = not behind
                    self.times_behind += behind
            step()
            count += 1
            due += period

    def summary(self) -> dict:
        """Return ticks, overruns, lateness [ms] and lost time in the form of the report."""
        late = np.frombuffer(self.lateness_ns, np.int64) * 1e-6 if self.lateness_ns else np.zeros(1)
        p50, p99 = np.percentile(late, (50, 99))
        return {
            "ticks": len(self.lateness_ns),
            "overruns": self.overruns,
            "lateness_ms": {"p50": float(p50), "p99": float(p99), "max": float(late.max())},
            "behind": {"limit_s": BEHIND_NS * 1e-9, "times": self.times_behind, "longest_s": float(late.max()) * 1e-3},
        }
