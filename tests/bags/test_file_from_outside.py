# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What others do to a bag while it is written is noticed with the next chunk, in one sentence; what is there is sealed."""

import contextlib
import os
import re
import shutil
import struct

import pytest

from rig_nodes.bags import Bag, BagWriter, growing_file
from rig_nodes.bags.cdr import encoder
from rig_nodes.bags.writer import Layout
from rig_nodes.base import DiskFull, RigError

TOPIC, TYPE = "/motor/n_wej", "rig_msgs/msg/Measurement"
AT = 2000  # ms at which it happens


def written(folder, act, layout=Layout()):
    """Write 5 s of messages, with an act of others in between; return (the sentence, its type, ms at which it came)."""
    encode = encoder(TYPE).encode
    writer = BagWriter(folder, "run", layout=layout)
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


def fill(disk):
    """Take all that is left of a disk, as another program may do at once."""
    with open(disk / "others", "ab", buffering=0) as file, contextlib.suppress(OSError):
        while True:
            file.write(bytes(4096))


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


def test_nothing_is_written_behind_a_cut_where_it_would_leave_a_hole(tmp_path, monkeypatch):
    """What comes before the next look at the file is as long as what was cut off."""
    monkeypatch.setattr("rig_nodes.bags.writer.CHUNK_BYTES", 1000)
    monkeypatch.setattr("rig_nodes.bags.writer.BUFFER", 1)
    encode, path, bag = encoder(TYPE).encode, tmp_path / "run_0.mcap", BagWriter(tmp_path, "run")
    with pytest.raises(RigError, match="was cut from outside to 3000 bytes"):
        for ms in range(300):
            if ms == 110:
                size = path.stat().st_size
                os.truncate(path, 3000)
            bag.write(TOPIC, TYPE, encode(ms * 1_000_000, ms, 0.1), ms * 1_000_000)
    assert ms == 200 and path.stat().st_size == 3000 < size
    bag.close()


def test_a_cut_after_the_last_look_is_noticed_when_the_bag_is_closed(tmp_path):
    encode, bag = encoder(TYPE).encode, BagWriter(tmp_path, "run")
    for ms in range(250):
        bag.write(TOPIC, TYPE, encode(ms * 1_000_000, ms, 0.1), ms * 1_000_000)
    os.truncate(tmp_path / "run_0.mcap", 3000)
    with pytest.raises(RigError, match="was cut from outside to 3000 bytes at 0.249 s"):
        bag.close()
    assert not (tmp_path / "metadata.yaml").exists(), "which is there only beside a finished bag"


def test_a_disk_that_is_nearly_full_and_keeps_no_room_ends_the_bag_in_order_before(tmp_path, monkeypatch):
    monkeypatch.setattr(growing_file, "_fallocate", lambda: None)
    real = os.fstatvfs

    def nearly_full(descriptor):
        found = list(real(descriptor))
        found[4] = 100_000 // found[1]  # f_bavail
        return os.statvfs_result(found)

    sentence, kind, _ = written(tmp_path, lambda: monkeypatch.setattr(growing_file.os, "fstatvfs", nearly_full))
    assert kind is DiskFull and "was ended in order at 1.999 s" in sentence and "before the disk is full" in sentence
    bag = Bag(tmp_path)
    assert bag.counts[TOPIC] >= AT and bag.end == {"state": "failed", "reason": sentence}


def test_a_folder_that_is_made_read_only_is_noticed_and_keeps_a_whole_bag(tmp_path, read_only):
    sentence, _, ms = written(tmp_path / "run", lambda: read_only(tmp_path / "run"))
    assert "takes no more files at 1.999 s: it or its disk was made read-only" in sentence and ms <= AT + 100
    bag = Bag(tmp_path / "run")
    assert bag.counts[TOPIC] >= AT and bag.end == {"state": "failed", "reason": sentence}


@pytest.mark.parametrize("packing", ["chunk", "file", "none"])
def test_a_disk_that_others_fill_at_once_is_named_with_what_is_readable(small_disk, packing):
    with small_disk(1024) as disk:
        sentence, kind, _ = written(disk / "run", lambda: fill(disk), Layout(packing=packing))
        assert kind is DiskFull and "run_0.mcap was ended in order" in sentence
        kept = float(re.search(r"([\d.]+) s", sentence)[1])
        assert kept >= (AT - 200) * 1e-3
        bag = Bag(disk / "run")
        assert 0 <= bag.counts[TOPIC] - (round(kept * 1e3) + 1) <= 100, "at least what the sentence says, at most a chunk more"
        assert sorted(path.name for path in (disk / "run").iterdir())[-1].startswith("run_0.mcap")
        left = os.statvfs(disk)
        assert left.f_bavail * left.f_frsize > 64 * 1024, "what was kept for the end and not used is there for the report"


def test_a_disk_without_room_for_the_end_of_a_bag_is_refused_before_a_file_is_left(small_disk):
    for size in range(4, 130, 6):
        with small_disk(size) as disk:
            try:
                sentence, kind, _ = written(disk / "run", lambda: None)
            except DiskFull as refused:
                assert "/run_0.mcap has room for " in str(refused) and not list((disk / "run").iterdir()), size
                opened = False
            else:
                assert kind is DiskFull and "was ended in order" in sentence and Bag(disk / "run").end["reason"] == sentence, size
                opened = True
    assert opened, "the largest has room"


@pytest.mark.parametrize("size", [1000, 1100, 1200])
def test_a_bag_of_large_messages_is_ended_in_order_before_the_disk_is_full(small_disk, size):
    """What comes between two looks at the disk is larger than the reserve."""
    with small_disk(size) as disk, pytest.raises(DiskFull) as refused:
        writer = BagWriter(disk / "run", "run")
        try:
            for k in range(100):
                data = struct.pack("<4sI", b"\x00\x01\x00\x00", 100_000) + os.urandom(100_000)
                writer.write("/camera/left", "std_msgs/msg/String", data, k * 50_000_000)
        finally:
            writer.close()
            bag = Bag(disk / "run")
            count = bag.counts["/camera/left"]
    assert f"was ended in order at {(count - 1) * 0.05:.3f} s, before the disk is full" in str(refused.value)
    assert count >= 6 and bag.end == {"state": "failed", "reason": str(refused.value)}
