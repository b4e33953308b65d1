# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A process that gets no more memory from any moment of a run on: a sentence, and a bag that verbs read.

`./rig test -m campaign tests/graph/test_memory_at_its_limits.py` prints the figures.
"""

import contextlib
import random
import resource
import subprocess
import sys
import time
from pathlib import Path

import pytest
from campaigns import Left, length_of, line_of_the_end, part_of, read_by_verbs, show
from running_graph import SHORT, RigRun

pytestmark = [pytest.mark.against_the_clock, pytest.mark.campaign]

MOMENTS = 10
LAST = 0.8  # of the length of a run, before which the memory ends


def size_of(pid: int) -> int:
    """Returns the size of a process's address space [bytes]."""
    return 1024 * int(Path(f"/proc/{pid}/status").read_text().partition("VmSize:")[2].split()[0])


def check(code, output, folder, made, capsys):
    """Asserts that a command under a limit ended with one sentence, or had enough, and that verbs read what it left."""
    if code in (0, 3):  # 3: this machine did not keep time
        assert "Traceback" not in output and "did not reach the bag" not in output, output
    else:
        line_of_the_end(output)
        assert code == 1, output
    if list(folder.glob("*.mcap")):
        read_by_verbs(folder, made, capsys)


def simulate(folder):
    """Starts `rig simulate demo`."""
    command = [sys.executable, "-P", "-m", "rig_nodes", "simulate", "demo", "--out", str(folder)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


def test_simulate_that_gets_no_more_memory_ends_with_a_sentence(tmp_path, capsys):
    draw = random.Random("simulate")
    for number in range(part_of(MOMENTS)):
        folder = tmp_path / f"{number}"
        process = simulate(folder)
        while not list(folder.glob("*.mcap")) and process.poll() is None:
            time.sleep(0.001)  # until its bag is begun
        time.sleep(draw.uniform(0.0, 0.3))  # the moment is the condition of the test
        limit = bounded(process.pid, draw.choice((0, 1 << 20, 1 << 23)))
        output, _ = process.communicate(timeout=120)
        show(capsys, f"no more than {limit >> 20} MB: exit code {process.returncode}: {output.splitlines()[-1:]}")
        check(process.returncode, output, folder, tmp_path / f"{number}_made", capsys)


def bounded(pid: int, more: int) -> int:
    """Lets a process have only so much more address space [bytes] than it has; returns the limit."""
    limit = 0
    with contextlib.suppress(OSError, IndexError):  # it has ended meanwhile
        limit = size_of(pid) + more
        resource.prlimit(pid, resource.RLIMIT_AS, (limit, limit))
    return limit


@pytest.mark.parametrize("name", ["container", "alfa46", "sequencer", "recorder", "supervisor"])
def test_a_run_of_which_a_process_gets_no_more_memory_ends_with_a_sentence(tmp_path, name, capsys):
    draw, longest = random.Random(name), LAST * length_of(RigRun(tmp_path / "whole", sequence=SHORT))
    for number in range(part_of(MOMENTS)):
        run = RigRun(tmp_path / f"{number}", sequence=SHORT)
        run.until("all nodes are connected")
        time.sleep(draw.uniform(0.0, longest))  # the moment is the condition of the test
        left = Left(run.process.pid)
        pid = run.process.pid if name == "supervisor" else run.children()[name]
        limit = bounded(pid, draw.choice((0, 1 << 18, 1 << 22)))
        code, output = run.end()
        show(capsys, f"{name} has no more than {limit >> 20} MB: exit code {code}: {output.splitlines()[-1]}")
        left.check()
        check(code, output, run.folder, tmp_path / f"{number}_made", capsys)
