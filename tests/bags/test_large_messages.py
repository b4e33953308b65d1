# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the writer takes the reader reads: large messages have chunks of their own, larger ones are refused when they come."""

import struct
import subprocess
import sys

import pytest
from mcap.reader import make_reader

from rig_nodes.bags import limits
from rig_nodes.bags.reader import Bag
from rig_nodes.bags.recording import BagRecording
from rig_nodes.bags.writer import LARGEST, BagWriter, MessageRefused
from rig_nodes.cli.main import main

FLOAT, BYTES = "std_msgs/msg/Float64", "std_msgs/msg/UInt8MultiArray"
MB = 10**6


def value(number):
    return b"\0\1\0\0" + struct.pack("<d", number)


def array(size, content=b"\0"):
    return b"\0\1\0\0" + struct.pack("<III", 0, 0, size) + content * size


def bag_of(folder, *large):
    """Writes 30 small messages and, among them, large ones at 0.1 s each."""
    with BagWriter(folder, "run") as writer:
        for number in range(30):
            writer.write("/x", FLOAT, value(number), number * 10**7)
            if number in range(10, 10 + len(large)):
                writer.write("/big", BYTES, large[number - 10], number * 10**7)


def test_messages_of_20_and_120_mb_are_whole_and_copied_with_those_beside_them(tmp_path, capfd):
    bag_of(tmp_path / "run", array(20 * MB), array(120 * MB, b"\x01"))
    assert main(["bag", "check", str(tmp_path / "run")]) == 0
    assert "whole, 32 messages" in capfd.readouterr().out
    assert main(["bag", "cut", str(tmp_path / "run"), "--from", "0.05", "--to", "0.2", "--out", str(tmp_path / "cut")]) == 0
    copied = dict(Bag(tmp_path / "cut").counts)
    assert copied == {"/x": 15, "/big": 2}
    assert [len(data) for _, data in Bag(tmp_path / "cut").raw("/big")] == [20 * MB + 16, 120 * MB + 16]


def test_a_large_message_has_a_chunk_of_its_own_so_that_it_costs_no_other(tmp_path):
    bag_of(tmp_path, array(5 * MB))
    with open(tmp_path / "run_0.mcap", "rb") as file:
        chunks = make_reader(file).get_summary().chunk_indexes
    (large,) = [chunk for chunk in chunks if chunk.uncompressed_size > 5 * MB]
    assert large.message_start_time == large.message_end_time and len(large.message_index_offsets) == 1
    assert sum(len(chunk.message_index_offsets) for chunk in chunks if chunk is not large) == len(chunks) - 1


def test_what_packs_too_well_to_be_trusted_is_stored_as_it_is(tmp_path):
    with BagWriter(tmp_path, "run") as writer:
        for number in range(8):
            writer.write("/big", BYTES, array(10 * MB), number * 10**8)
    assert Bag(tmp_path).check() == []
    assert (tmp_path / "run_0.mcap").stat().st_size * limits.EXPANSION > 80 * MB


def test_a_message_above_the_limit_is_refused_and_counted_and_the_bag_stays_whole(tmp_path):
    with BagWriter(tmp_path, "run") as writer:
        recording = BagRecording(writer)
        recording.take("/x", FLOAT, value(1), 10**7, "measurement")
        recording.take("/big", BYTES, memoryview(bytes(LARGEST + 1)), 10**7, "measurement")
        recording.take("/x", FLOAT, value(2), 2**62, "measurement")
        recording.take("/x", FLOAT, value(3), 10**7, "measurement")
        with pytest.raises(MessageRefused, match=f"/big: a message of {LARGEST + 1} bytes; at most {LARGEST} are recorded"):
            writer.write("/big", BYTES, memoryview(bytes(LARGEST + 1)), 0)
    assert recording.refused == {"/big": 1, "/x": 1}
    assert Bag(tmp_path).counts == {"/x": 2} and Bag(tmp_path).check() == []


MEMORY = """
import resource, struct, sys
from pathlib import Path
from rig_nodes.bags.writer import BagWriter

before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
with BagWriter(sys.argv[1], "run") as writer:
    for number in range(12):
        data = b"\\0\\1\\0\\0" + struct.pack("<III", 0, 0, 40_000_000) + bytes(40_000_000)
        writer.write("/big", "std_msgs/msg/UInt8MultiArray", data, number)
print((resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024)
"""


def test_large_messages_wait_for_the_disk_in_bounded_memory(tmp_path):
    done = subprocess.run([sys.executable, "-c", MEMORY, str(tmp_path)], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert float(done.stdout) < 350, "MB for messages of 480 MB"
