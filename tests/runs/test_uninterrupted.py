# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""An interrupt during an operation that must be complete waits for its end: a message with its count, the bag's last lines."""

import signal

import pytest

from rig_nodes.bags import mcap_writer
from rig_nodes.bags.reader import Bag
from rig_nodes.base.uninterrupted import Uninterrupted
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.sequence import load_sequence
from rig_nodes.runs.simulation import simulate


class Interrupted:
    """A struct of the writer in which one call raises KeyboardInterrupt."""

    def __init__(self, original, call: int):
        self._original, self._left, self.size = original, call, original.size

    def pack(self, *values):
        self._left -= 1
        if self._left == 0:
            signal.raise_signal(signal.SIGINT)
        return self._original.pack(*values)


@pytest.mark.parametrize(
    "what, call", [("_CHUNK", 1), ("_CHUNK", 2), ("_PACKED", 1), ("_CHUNK_INDEX", 3), ("_INDICES", 1), ("_SIZES", 2)]
)
def test_a_bag_is_whole_wherever_it_comes(tmp_path, monkeypatch, what, call):
    monkeypatch.setattr(mcap_writer, what, Interrupted(getattr(mcap_writer, what), call))
    run = simulate(load_rig("hydmag"), load_sequence("sample"), tmp_path / "run")
    assert run["end"] == {"state": "interrupted", "reason": "interrupted by Ctrl-C"}
    assert Bag(tmp_path / "run").check() == []


def test_one_that_comes_while_the_bag_is_closed_waits_for_that(tmp_path, monkeypatch):
    monkeypatch.setattr(mcap_writer, "_FOOTER", Interrupted(mcap_writer._FOOTER, 1))
    with pytest.raises(KeyboardInterrupt):
        simulate(load_rig("hydmag"), load_sequence("sample"), tmp_path / "run")
    assert Bag(tmp_path / "run").check() == [] and (tmp_path / "run" / "metadata.yaml").exists()


def test_elsewhere_it_acts_at_once_and_afterwards_as_before():
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt), Uninterrupted():
        signal.raise_signal(signal.SIGINT)
        raise AssertionError("it did not act at once")
    assert signal.getsignal(signal.SIGINT) is before
