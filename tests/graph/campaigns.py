# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Helpers of the campaigns: their length, progress, all that a run has on the machine, and verbs that read what it leaves.

RIG_CAMPAIGN_PART=0.1 makes a campaign a tenth as long, to try it.
"""

import contextlib
import os
import select
import signal
import time
from pathlib import Path

from running_graph import PATIENCE

from rig_nodes.cli.main import main

PART = float(os.environ.get("RIG_CAMPAIGN_PART", "1"))  # of the whole length
SHARED_MEMORY = Path("/dev/shm")
INODES = {"unix": 6, "udp": 9, "udp6": 9, "tcp": 9, "tcp6": 9}  # tables of sockets, and where a row has the inode


def part_of(whole: int) -> int:
    """Returns how many of something a campaign makes."""
    return max(1, round(PART * whole))


def show(capture, text: str) -> None:
    """Prints a line while pytest captures what is printed."""
    with capture.disabled():
        print(f"\n{text}", end="", flush=True)


def read_by_verbs(folder: Path, made: Path, capsys) -> None:
    """Has verbs read what a run has left, and asserts that each answers as it should; ``made`` is a new folder for theirs."""
    made.mkdir()
    for verb in (
        ["report", str(folder)],
        *(["bag", work, str(folder)] for work in ("info", "check", "hash")),
        ["bag", "recover", str(folder), "--out", str(made / "recovered")],
        ["export", "csv", str(folder), "-o", str(made / "run.csv")],
    ):
        assert main(verb) in (0, 1, 2, 3), verb
        said = capsys.readouterr()
        assert "Traceback" not in said.out + said.err, (verb, said.err)


def line_of_the_end(output: str) -> str:
    """Returns the one sentence with which a run that was disturbed ends, its last line."""
    lines = output.splitlines()
    assert "Traceback" not in output and [line for line in lines if line.startswith("rig: ")] == lines[-1:], output
    return lines[-1]


def family(pid: int) -> list[int]:
    """Returns a process and all that descend from it."""
    found = [pid]
    for path in Path(f"/proc/{pid}/task").glob("*/children"):
        with contextlib.suppress(OSError):  # the thread has ended
            for child in path.read_text(encoding="ascii").split():
                found += family(int(child))
    return found


def size_of(pid: int) -> tuple[float, int]:
    """Returns memory [MB] and open files of a process."""
    resident = Path(f"/proc/{pid}/status").read_text().partition("VmRSS:")[2].split()[0]
    return float(resident) / 1024, len(list(Path(f"/proc/{pid}/fd").iterdir()))


def server_of(children: dict[str, int]) -> int:
    """Returns the process from which the processes of a graph are forked."""
    return int(Path(f"/proc/{children['container']}/status").read_text().partition("PPid:")[2].split()[0])


class Left:
    """All that a run has on this machine now, for a later look at what is left of it: processes, sockets, shared memory."""

    def __init__(self, pid: int):
        self.pids = family(pid)
        self._ends, self._sockets, self._memory = [], set(), set(SHARED_MEMORY.iterdir())
        for one in self.pids:
            with contextlib.suppress(OSError):  # it has ended
                self._ends.append(os.pidfd_open(one))
                for link in Path(f"/proc/{one}/fd").iterdir():
                    with contextlib.suppress(OSError):
                        self._sockets.add(os.readlink(link).removeprefix("socket:[").removesuffix("]"))
                self._memory -= {Path(name) for name in _mapped(one) if name.startswith(f"{SHARED_MEMORY}/")}

    def check(self) -> None:
        """Waits until all processes have ended, and asserts that nothing else is there either."""
        for end in self._ends:
            ready, _, _ = select.select([end], [], [], PATIENCE)
            os.close(end)
            assert ready, f"a process of the run is still there: {self.pids}"
        there = set()
        for table, place in INODES.items():
            rows = Path(f"/proc/net/{table}").read_text().splitlines()[1:]
            there |= {row.split()[place] for row in rows}
        assert not self._sockets & there, "sockets of the run"
        # other programs may have made some meanwhile, and use them
        new = {str(path) for path in set(SHARED_MEMORY.iterdir()) - self._memory}
        for pid in (path.name for path in Path("/proc").glob("[0-9]*") if new):
            new -= _mapped(pid)
        assert not new, "shared memory that nobody uses"


def _mapped(pid: int | str) -> set[str]:
    """Returns the files that a process has mapped or open."""
    found = set()
    with contextlib.suppress(OSError):  # it has ended
        found = {row.split(maxsplit=5)[-1] for row in Path(f"/proc/{pid}/maps").read_text().splitlines()}
        for link in Path(f"/proc/{pid}/fd").iterdir():
            with contextlib.suppress(OSError):
                found.add(os.readlink(link))
    return found


def kill(pid: int) -> bool:
    """Kills a process, and returns whether it was still there."""
    try:
        os.kill(pid, signal.SIGKILL)
    except ProcessLookupError:
        return False
    return True


def length_of(run) -> float:
    """Returns for how long [s] an undisturbed rig goes on once its nodes are connected."""
    run.until("all nodes are connected")
    began, container = time.monotonic(), os.pidfd_open(run.children()["container"])
    select.select([container], [], [])
    length = time.monotonic() - began
    os.close(container)
    code, output = run.end()
    assert code in (0, 3), output
    return length
