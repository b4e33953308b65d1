# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What others do to a bag while it is written is noticed with the next chunk, in one sentence; what is there is sealed."""

import os
import shutil

import pytest

from rig_nodes.bags import Bag, BagWriter
from rig_nodes.bags import writer as of_writer
from rig_nodes.bags.cdr import encoder
from rig_nodes.base import DiskFull, RigError

TOPIC, TYPE = "/motor/n_wej", "rig_msgs/msg/Measurement"
AT = 2000  # ms at which it happens


def written(folder, act):
    """Write 5 s of messages, with an act of others in between; return (the sentence, its type, ms at which it came)."""
    encode = encoder(TYPE).encode
    writer = BagWriter(folder, "run")
    with pytest.raises(RigError) as refused:
        for ms in range(5000):
            if ms == AT:
                act()
            writer.write(TOPIC, TYPE, encode(ms * 1_000_000, ms, 0.1), ms * 1_000_000)
    for again in (writer.flush, lambda: writer.write(TOPIC, TYPE, encode(0, 0, 0.0), 0)):
        with pytest.raises(RigError) as same:
            again()
        assert str(same.value) == str(refused.value) and type(same.value) is type(refused.value)
    writer.close()
    return str(refused.value), type(refused.value), ms


def test_a_removed_file_or_folder_is_noticed(tmp_path):
    for number, act in enumerate((lambda folder: os.remove(folder / "run_0.mcap"), shutil.rmtree)):
        folder = tmp_path / str(number)
        sentence, _, ms = written(folder, lambda act=act, folder=folder: act(folder))
        assert "run_0.mcap was removed while it was recorded" in sentence and ms <= AT + 100


def test_a_folder_that_is_renamed_keeps_a_whole_bag(tmp_path):
    sentence, _, ms = written(tmp_path / "run", lambda: (tmp_path / "run").rename(tmp_path / "other"))
    assert "it or its folder was renamed or moved" in sentence and ms <= AT + 100
    bag = Bag(tmp_path / "other")
    assert bag.counts[TOPIC] >= AT and bag.end == {"state": "failed", "reason": sentence}
    assert not (tmp_path / "run").exists()


def test_another_file_in_its_place_is_noticed(tmp_path):
    path = tmp_path / "run_0.mcap"

    def act():
        path.rename(tmp_path / "mine.mcap")
        path.write_bytes(b"others")

    sentence, _, _ = written(tmp_path, act)
    assert "is not at its place any more" in sentence
    assert path.read_bytes() == b"others" and Bag(tmp_path / "mine.mcap").counts[TOPIC] >= AT


def test_a_file_that_is_cut_is_noticed_and_its_beginning_can_be_read(tmp_path):
    sentence, _, ms = written(tmp_path, lambda: os.truncate(tmp_path / "run_0.mcap", 3000))
    assert "was cut from outside to 3000 bytes" in sentence and ms <= AT + 100
    assert (tmp_path / "run_0.mcap").stat().st_size == 3000
    assert Bag(tmp_path, recover=True).counts[TOPIC] == 100


def test_a_disk_that_is_nearly_full_ends_the_bag_in_order_before(tmp_path, monkeypatch):
    real = os.fstatvfs

    def nearly_full(descriptor):
        found = list(real(descriptor))
        found[4] = 100_000 // found[1]  # f_bavail
        return os.statvfs_result(found)

    sentence, kind, _ = written(tmp_path, lambda: monkeypatch.setattr(of_writer.os, "fstatvfs", nearly_full))
    assert kind is DiskFull and "was ended in order at 1.999 s" in sentence and "before the disk is full" in sentence
    bag = Bag(tmp_path)
    assert bag.counts[TOPIC] >= AT and bag.end == {"state": "failed", "reason": sentence}
