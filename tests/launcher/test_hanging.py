# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A test that hangs fails and the next one runs; when it cannot be stopped, its place in the code is shown and pytest ends.

A test of a campaign has a longer limit.
"""

import subprocess
import sys
from pathlib import Path

CONFTEST = Path(__file__).resolve().parents[1] / "conftest.py"
HANGS = """
import signal
import threading

import pytest


def test_hangs(): threading.Event().wait(60)


def test_next(): pass


@pytest.mark.campaign
def test_of_a_campaign(): threading.Event().wait(1)


@pytest.mark.campaign
def test_hangs_in_a_campaign(): threading.Event().wait(60)


def test_hears_nothing():
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGUSR2})
    threading.Event().wait(60)
"""
LIMITS = (("LIMIT = 240.0", "0.5"), ("LIMIT_OF_CAMPAIGN = 4 * 3600.0", "2.0"), ("AT_LOWEST = 10", "1"), ("MORE = 60.0", "0.5"))


def test_a_test_that_hangs_is_ended(tmp_path):
    text = CONFTEST.read_text(encoding="utf-8")
    for limit, new in LIMITS:
        assert limit in text
        text = text.replace(limit, f"{limit.partition(' ')[0]} = {new}")
    (tmp_path / "conftest.py").write_text(text)
    (tmp_path / "test_one.py").write_text(HANGS)
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-v", "-p", "no:cacheprovider", str(tmp_path)],
        text=True,
        capture_output=True,
        timeout=50,
        cwd=tmp_path,
    )
    assert "test_hangs FAILED" in done.stdout and "test_next PASSED" in done.stdout
    assert "test_of_a_campaign PASSED" in done.stdout and "test_hangs_in_a_campaign FAILED" in done.stdout
    assert done.returncode == 1 and "Timeout (0:00:01)" in done.stderr and "in test_hears_nothing" in done.stderr
