# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Three pages with twenty signals each for half an hour: nothing grows, and the rig is as punctual as without them.

`./rig test -m campaign tests/panel/test_soak.py -s` prints the figures.
"""

import json
import os
import re
import signal
import subprocess
import sys
import time
from contextlib import ExitStack, closing
from pathlib import Path

import numpy as np
import pytest
import ticking
from browser import NEEDED, Browser
from started_panel import READY, Panel

pytestmark = [pytest.mark.against_the_clock, pytest.mark.campaign, NEEDED]
WITHOUT, WITH, STOPPED, FIRST = 5, 30, 10, 5  # minutes: no page, three pages, one of them stopped, until nothing grows any more
SPAN = 10  # minutes in which nothing grows by more than MOST
MOST = 1.0  # MB
SECONDS = 60  # at which memory is looked at before each row
ROWS = [
    ["n_wej", "n_wyj", "M_wej", "M_wyj", "motor_torque"],
    ["p1", "p2", "p_p", "I_zr_p1", "I_zr_p2"],
    ["s1_slip", "s2_slip", "s1_torque", "s2_torque", "load_torque"],
    ["I_set_zr_p1", "I_set_zr_p2", "s1_capacity", "s2_capacity", "T_oil"],
]


def memory(pid: int) -> float:
    """Returns the memory that a process holds [MB]: resident and its own, without pages of files that it has merely touched."""
    held = re.search(r"^RssAnon:\s+(\d+) kB", Path(f"/proc/{pid}/status").read_text(), re.MULTILINE)
    return int(held[1]) * 1024 / 1e6


def heap(page: Browser) -> float:
    """Returns what the scripts of a page use [MB] once nothing is kept that could be freed."""
    page.call("HeapProfiler.collectGarbage")
    return page.call("Runtime.getHeapUsage")["usedSize"] / 1e6


def with_descendants(pid: int) -> list[int]:
    """Returns a process and all that it and its children have started."""
    children = [int(one) for task in Path(f"/proc/{pid}/task").iterdir() for one in (task / "children").read_text().split()]
    return [pid, *(one for child in children for one in with_descendants(child))]


def watched(panel: Panel, pages: list[Browser], minutes: int) -> list[list[float]]:
    """Returns for each minute the server's memory and the pages' heaps [MB] without what is in use for a moment only.

    A heap is looked at behind a collection of garbage; of the server's memory, which rises and falls by up to 5 MB and its least
    of a minute by 2 MB, a line through all minutes counts.
    """
    rows = []
    for _ in range(minutes + 1):
        held = []
        for _ in range(SECONDS):
            held.append(memory(panel.process.pid))
            time.sleep(1.0)  # time is the condition of this test
        rows.append([min(held), *map(heap, pages)])
    return rows


def growth(rows: list[list[float]]) -> list[float]:
    """Returns by how much each column grows at most within SPAN minutes."""
    return [max(b - a for a, b in zip(column, column[SPAN:])) for column in zip(*rows)]


def risen(column: list[float]) -> float:
    """Returns by how much a line through all values of a column, one of each minute, rises in SPAN minutes."""
    return SPAN * float(np.polyfit(np.arange(len(column)), column, 1)[0])


class Machine:
    """What the machine alone makes late while a rig runs, on the core where this is most."""

    def __init__(self) -> None:
        commands = ([sys.executable, "-P", ticking.__file__, str(core)] for core in os.sched_getaffinity(0))
        self._watches = [subprocess.Popen(one, stdin=subprocess.PIPE, stdout=subprocess.PIPE) for one in commands]

    def close(self) -> None:
        """Ends the watching, after which ``late`` is the number of late ticks."""
        self.late = max(int(watch.communicate()[0]) for watch in self._watches)


def punctual(folder: Path) -> dict:
    """Returns what the report of the run that a page has started says of its punctuality."""
    (path,) = folder.glob("runs/*/report.json")
    return json.loads(path.read_text())["run"]


def test_three_pages_for_half_an_hour_cost_the_rig_nothing_and_grow_nowhere(tmp_path, capsys):
    alone, beside = tmp_path / "alone", tmp_path / "beside"
    alone.mkdir()
    beside.mkdir()
    with closing(Machine()) as quiet, closing(Panel(alone, "hydmag")) as panel:
        with closing(Browser(panel.url)) as page:
            page.until(READY, 200)
        time.sleep(60.0 * WITHOUT)
    with closing(Machine()) as busy, closing(Panel(beside, "hydmag")) as panel, ExitStack() as stack:
        pages = [stack.enter_context(closing(Browser(panel.url))) for _ in range(3)]
        for page in pages:
            page.until(READY, 200)
            page.js(f"localStorage.setItem('rig-charts hydmag', '{json.dumps(ROWS)}')")
            page.call("Page.reload")
            page.until(f"document.querySelectorAll('.chip').length === {sum(map(len, ROWS))}")
        time.sleep(60.0 * FIRST)
        rows = watched(panel, pages, WITH - FIRST)
        grown = [risen([row[0] for row in rows]), *growth(rows)[1:]]
        processes = with_descendants(pages[0].process.pid)
        for pid in processes:
            os.kill(pid, signal.SIGSTOP)
        try:
            others = watched(panel, pages[1:], STOPPED)
        finally:
            for pid in processes:
                os.kill(pid, signal.SIGCONT)
        grown_beside = [risen([row[0] for row in others]), *growth(others)[1:]]
        first = "document.querySelector('.chip .value').textContent"
        pages[0].until(READY, 60)
        pages[0].until(f"Number.isFinite(Number({first}))", 60)
        troubles = [page.troubles for page in pages]
    without, found = punctual(alone), punctual(beside)
    with capsys.disabled():
        print(f"\n{WITH} min: server {rows[0][0]:.1f} to {rows[-1][0]:.1f} MB, heaps {rows[0][1:]} to {rows[-1][1:]} MB")
        print(f"server each minute [MB]: {', '.join(f'{row[0]:.1f}' for row in (*rows, *others))}")
        print(f"most growth in {SPAN} min [MB]: {grown}, with a page that stands still {grown_beside}")
        for name, one, machine in (("without", without, quiet), ("with", found, busy)):
            late = f"{one['overruns']} of {one['ticks']} ticks late, {machine.late} by the machine alone"
            print(f"{name} pages: lateness {one['lateness_ms']}, {late}")
    assert troubles == [[], [], []]
    assert all(one < MOST for one in (*grown, *grown_beside))
    assert found["lateness_ms"]["p99"] < 1.5 * without["lateness_ms"]["p99"]
    own = [max(0, one["overruns"] - machine.late) / one["ticks"] for one, machine in ((without, quiet), (found, busy))]
    assert own[1] <= own[0] + 1e-4
