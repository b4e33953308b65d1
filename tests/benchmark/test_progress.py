# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""While a rig is compiled, the terminal shows that the work continues, and the time since its start."""

import io
import re
import sys
import threading

import pytest

from rig_nodes.base import progress
from rig_nodes.cli.main import main


class Terminal(io.StringIO):
    """A terminal that reports when so many lines of a text were written to it."""

    def __init__(self, text, times):
        super().__init__()
        self._text, self._times, self.shown = text, times, threading.Event()

    def isatty(self):
        return True

    def write(self, text):
        written = super().write(text)
        if self.getvalue().count(self._text) >= self._times:
            self.shown.set()
        return written


def test_a_long_wait_shows_its_seconds_and_a_short_one_nothing(monkeypatch):
    terminal = Terminal("compiling", 3)
    monkeypatch.setattr(sys, "stderr", terminal)
    with progress.waiting("compiling"):
        pass
    assert not terminal.getvalue(), "within a breath there is nothing to tell"
    monkeypatch.setattr(progress, "PATIENCE", 0.0)
    with progress.waiting("compiling"):
        assert terminal.shown.wait(30.0), "the line is renewed while the block runs"
    seconds = [int(found) for found in re.findall(r"compiling, 00:(\d\d)", terminal.getvalue())]
    assert seconds == sorted(seconds) and seconds[-1] >= 1
    assert terminal.getvalue().endswith("\n"), "what follows stands on a line of its own"


@pytest.mark.parametrize("patience, shown", [(0.0, True), (60.0, False)])
def test_a_simulation_says_that_it_starts_until_time_goes_on(tmp_path, monkeypatch, patience, shown):
    terminal = Terminal(progress.STARTING, 1)
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setattr(progress, "PATIENCE", patience)
    assert main(["simulate", "sample", "--out", str(tmp_path / "run")]) == 0
    assert (progress.STARTING in terminal.getvalue()) is shown
