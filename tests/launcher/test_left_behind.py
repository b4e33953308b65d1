# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a failed test or fixture has started is ended before the next test; what a fixture has started goes on for its tests."""

import subprocess
import sys
from pathlib import Path

CONFTEST = Path(__file__).resolve().parents[1] / "conftest.py"
STARTS = """
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

FORKS = "import subprocess, sys; print(subprocess.Popen(['sleep', '600']).pid, flush=True); sys.stdin.read()"
started = {}


def start(name):
    process = subprocess.Popen([sys.executable, "-c", FORKS], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    started[name] = process, int(process.stdout.readline())
    return process


def gone(name):
    process, child = started[name]
    until = time.monotonic() + 10
    while "State:\\tZ" not in status(child) and time.monotonic() < until:
        time.sleep(0.01)  # a killed process has not yet ended
    return process.wait(10) == -9 and "State:\\tZ" in status(child)


def status(pid):
    try:
        return Path(f"/proc/{pid}/status").read_text()
    except FileNotFoundError:
        return "State:\\tZ"


@pytest.fixture(scope="module")
def kept():
    process = start("kept")
    yield process
    process.kill()
    os.kill(started["kept"][1], 9)


@pytest.fixture
def broken():
    start("broken")
    raise ValueError


def test_fails(kept):
    start("fails")
    assert False


def test_is_not_begun(broken): pass


def test_looks(kept):
    assert gone("fails") and gone("broken") and kept.poll() is None
"""


def test_what_a_failure_leaves_is_ended(tmp_path):
    (tmp_path / "conftest.py").write_text(CONFTEST.read_text(encoding="utf-8"))
    (tmp_path / "test_one.py").write_text(STARTS)
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-v", "-p", "no:cacheprovider", str(tmp_path)],
        text=True,
        capture_output=True,
        timeout=50,
        cwd=tmp_path,
    )
    assert "test_fails FAILED" in done.stdout and "test_is_not_begun ERROR" in done.stdout, done.stdout
    assert "test_looks PASSED" in done.stdout, done.stdout
