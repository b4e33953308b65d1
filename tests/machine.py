# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Whether this machine keeps time: a plugin of pytest, loaded by `rig test` for tests against the clock.

A process of its own, which shares no code with the rig, watches the clock at a priority above the rig's. A failure on a machine
that stands still, or is far slower than the rig needs, says nothing about the rig: it becomes "not judged", with what was measured,
and so does the rest of its file, whose tests often share one graph. Their names are left in pytest's cache.
"""

from __future__ import annotations

import json
import os
import select
import subprocess
import sys
import time
from contextlib import suppress

import pytest

PRIORITY = 50  # of the watch; the rig's processes have 9 and 10
PERIOD = 0.01  # s between two looks at the clock
WORK, WORKING = 20_000, 0.3  # numbers that are added in one piece of work, and s for which that goes on after a failure
# s for a piece of work on a machine of 2024, on which two cores are two thirds busy with HydmAG's graph and its page in real time
USUAL = 200e-6
SLOWER = 1.5  # factor from which on a machine is too slow for that
STILL = 0.05  # s; the rig goes to its safe state when a device is silent for 0.1 s
NOT_JUDGED = 80  # exit code of pytest, whose own end at 5: nothing failed, but some tests were not judged
NOTED = "rig/not_judged"  # in pytest's cache: each such file with the measured reason


def watch() -> None:
    """Look at the clock until the input ends.

    An empty line of it is answered by the longest lateness and the time of a work, any other one begins a new file.
    """
    with suppress(OSError):  # this user may have no real-time priority, and then neither has the rig
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    late = 0.0
    while True:
        began = time.monotonic()
        asked = select.select([sys.stdin], [], [], PERIOD)[0]
        if asked:
            line = sys.stdin.readline()
            if not line:
                return
            if line.strip():
                late = 0.0
            print(json.dumps([late, 0.0 if line.strip() else working()]), flush=True)
            continue
        late = max(late, time.monotonic() - began - PERIOD)


def working() -> float:
    """Return the mean time [s] of a piece of work, of those that fit into WORKING."""
    began, pieces = time.monotonic(), 0
    while time.monotonic() < began + WORKING:
        sum(range(WORK))
        pieces += 1
    return (time.monotonic() - began) / pieces


def unfit(late: float, took: float) -> str:
    """Return why tests cannot be judged, from the longest lateness [s] and the time of a piece of work [s]; or nothing."""
    if late > STILL:
        return f"this machine stood still for {late * 1e3:.0f} ms at real-time priority; {STILL * 1e3:.0f} ms are fit for a rig"
    if took > SLOWER * USUAL:
        return f"this machine is {took / USUAL:.1f} times slower than a usual one; {SLOWER:g} times are fit for a rig"
    return ""


class Watched:
    """The plugin of one session of pytest."""

    def __init__(self, cache: pytest.Cache | None) -> None:
        self._process = subprocess.Popen([sys.executable, "-P", __file__], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self._cache, self._file = cache, ""
        self._not_judged: dict[str, str] = {}  # reasons by file

    def measured(self, file: str = "") -> tuple[float, float]:
        """Return the longest lateness [s] in the present file and the mean time of a piece of work [s]; or begin a new file."""
        assert self._process.stdin is not None and self._process.stdout is not None
        self._process.stdin.write(f"{file}\n")
        self._process.stdin.flush()
        late, took = json.loads(self._process.stdout.readline())
        return late, took

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_setup(self, item: pytest.Item) -> None:
        """Begin to watch for a file, or leave out what follows in a file that could not be judged."""
        file = item.nodeid.split("::")[0]
        if file != self._file:
            self._file = file
            self.measured(file)
        elif file in self._not_judged:
            pytest.skip(f"not judged: {self._not_judged[file]}")

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self, item: pytest.Item):
        """Make a failure that the machine may have caused one that is not judged."""
        report = yield
        if report.failed and (why := unfit(*self.measured())):
            self._not_judged.setdefault(self._file, why)
            report.outcome = "skipped"
            report.longrepr = (str(item.path), (item.location[1] or 0) + 1, f"not judged: {why}")
        return report

    def pytest_sessionfinish(self, session: pytest.Session, exitstatus: int) -> None:
        """Note what was not judged, and say it by the exit code where nothing failed."""
        self._process.communicate()
        if self._cache is not None:
            self._cache.set(NOTED, self._not_judged)
        if exitstatus == pytest.ExitCode.OK and self._not_judged:
            session.exitstatus = NOT_JUDGED


def pytest_configure(config: pytest.Config) -> None:
    """Begin to watch."""
    config.pluginmanager.register(Watched(config.cache))


if __name__ == "__main__":
    watch()
