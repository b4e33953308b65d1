# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Processes of campaigns: forked from a server that loads beside its caller, and one sentence when none can be started."""

import os
import signal
import subprocess
import sys
import threading
import time
from multiprocessing import forkserver

import pytest

from rig_nodes.base.errors import RigError
from rig_nodes.runs.workers import Workers


def loaded(_item):
    """Returns the worker's parent, and whether the plant is loaded before the first use."""
    return os.getppid(), "rig_nodes.plant.engine.loop" in sys.modules


def test_they_are_forked_from_one_server_that_has_the_plant():
    with Workers(2) as workers:
        answers = set(workers.map(loaded, range(8)))
    assert len(answers) == 1 and answers.pop()[1]
    with Workers(2) as again:
        parents = {parent for parent, _ in again.map(loaded, range(4))}
    assert len(parents) == 1 and os.getpid() not in parents


def test_a_verb_can_start_the_server_before_it_loads_a_compiler():
    code = "import sys, rig_nodes.runs.workers; print({'numba', 'numpy'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout.strip() == "set()"


def test_a_server_that_cannot_be_started_is_said_in_a_sentence(monkeypatch):
    def refused():
        raise OSError("AF_UNIX path too long")  # as with a long TMPDIR, where newer Pythons use /tmp

    monkeypatch.setattr(forkserver, "ensure_running", refused)
    with pytest.raises(RigError, match=r"one job needs none \(--jobs 1, .*\) \(AF_UNIX path too long; .*\)$"):
        Workers(2).__enter__()


def slow(_item):
    """Works far longer than a user waits."""
    time.sleep(60.0)


def test_an_interrupt_ends_the_items_that_have_begun():
    with pytest.raises(KeyboardInterrupt), Workers(2) as workers:
        pids = workers.pids()
        threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
        began = time.monotonic()
        workers.map(slow, range(4))
    assert time.monotonic() - began < 3.0
    assert not any(os.path.exists(f"/proc/{pid}") for pid in pids)


def test_an_interrupt_while_one_starts_waits_for_it():
    code = (
        "import signal; from multiprocessing import forkserver; from rig_nodes.runs.workers import Workers; "
        "signal.signal(signal.SIGINT, signal.default_int_handler); "  # in a background job it is ignored
        "forked = forkserver.connect_to_new_process; "
        "forkserver.connect_to_new_process = lambda fds: (forked(fds), signal.raise_signal(signal.SIGINT))[0]; "
        "Workers(2).__enter__()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert "KeyboardInterrupt" in done.stderr and "EOFError" not in done.stderr
