# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The rig's writer of MCAP files compared with that of the library: the same calls give the same bytes."""

import io
import threading
import tracemalloc

import pytest
import zstandard
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from rig_nodes.bags.mcap_writer import McapWriter
from rig_nodes.bags.pieces import pack

CHUNK_BYTES = 20_000  # so small that one chunk is closed because of its size


def test_the_bytes_are_those_of_the_mcap_library(messages):
    rows = messages(0.4)
    topics = sorted({topic for topic, _, _ in rows})
    theirs, ours = io.BytesIO(), io.BytesIO()
    library = Writer(theirs, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD, enable_crcs=True, enable_data_crcs=True)
    library.start(profile="ros2", library="a test")
    writer = McapWriter(ours, "ros2", "a test", CHUNK_BYTES)
    for one in (library, writer):
        schema = one.register_schema("a/msg/Type", "ros2msg", b"float64 value")
        channels = {topic: one.register_channel(topic, "cdr", schema, {"topic": topic}) for topic in topics}
        for number, (topic, stamp, data) in enumerate(rows):
            # some of them out of the order of time
            stamp += 3_000_000 if number % 7 == 0 else 0
            if one is writer:
                one.add_message(channels[topic], stamp, data, number)
            else:
                one.add_message(channels[topic], stamp, data, stamp, number)
            if number % 150 == 0:
                one.flush()
        one.flush()
        one.flush()  # with nothing to write
        one.add_metadata("rosbag2", {"serialized_metadata": "text"})
        one.finish()
    assert len(ours.getvalue()) > 10 * 1000 and ours.getvalue() == theirs.getvalue()


def test_a_file_without_a_message_is_the_librarys_too():
    theirs, ours = io.BytesIO(), io.BytesIO()
    library = Writer(theirs, compression=CompressionType.ZSTD, enable_data_crcs=True)
    library.start(profile="ros2", library="a test")
    library.finish()
    McapWriter(ours, "ros2", "a test", CHUNK_BYTES).finish()
    assert ours.getvalue() == theirs.getvalue()


def test_a_compressor_without_memory_is_a_lack_of_memory(monkeypatch, tmp_path):
    """The command line has one sentence for that, and a traceback for what it does not know."""

    class Full:
        def compress(self, content):
            raise zstandard.ZstdError("cannot compress: Allocation error : not enough memory")

        def copy_stream(self, source, sink, size):
            self.compress(source)

    monkeypatch.setattr(zstandard, "ZstdCompressor", Full)
    writer = McapWriter(io.BytesIO(), "ros2", "a test", CHUNK_BYTES)
    channel = writer.register_channel("/topic", "cdr", writer.register_schema("a/msg/Type", "ros2msg", b"float64 value"), {})
    writer.add_message(channel, 0, b"data", 0)
    with pytest.raises(MemoryError, match="not enough memory"):
        writer.finish()
    (tmp_path / "a.mcap").write_bytes(b"whole")
    with pytest.raises(MemoryError):
        pack(tmp_path / "a.mcap")
    assert [one.read_bytes() for one in tmp_path.iterdir()] == [b"whole"]


def test_all_threads_have_started_before_the_file_has_a_byte():
    """Python waits for ever for a thread that gets no memory while it starts."""
    threads = []

    class File(io.BytesIO):
        def write(self, data):
            threads.append(set(threading.enumerate()))
            return super().write(data)

    before = set(threading.enumerate())
    writer = McapWriter(File(), "ros2", "a test", CHUNK_BYTES)
    channel = writer.register_channel("/topic", "cdr", writer.register_schema("a/msg/Type", "ros2msg", b"float64 value"), {})
    for number in range(5):
        writer.add_message(channel, number, bytes(CHUNK_BYTES), number)
    writer.finish()
    packers = [there - before for there in threads]
    assert len(packers[0]) == 1 and all(there <= packers[0] for there in packers)


def test_a_long_file_has_its_whole_index_and_the_writer_keeps_little_of_it(tmp_path):
    channels, chunks = range(1, 51), 600
    with open(tmp_path / "long.mcap", "wb") as file:
        writer = McapWriter(file, "ros2", "a test", 1 << 20)
        schema = writer.register_schema("a/msg/Type", "ros2msg", b"float64 value")
        for channel in channels:
            writer.register_channel(f"/topic_{channel}", "cdr", schema, {})
        tracemalloc.start()
        for chunk in range(chunks):
            for channel in channels:
                writer.add_message(channel, 100_000_000 * chunk + channel, b"12345678", chunk)
            writer.flush()
            if chunk == chunks // 3:
                before, _ = tracemalloc.get_traced_memory()
        grown = tracemalloc.get_traced_memory()[0] - before
        tracemalloc.stop()
        writer.finish()
    with open(tmp_path / "long.mcap", "rb") as file:
        index = make_reader(file).get_summary().chunk_indexes
    assert [one.message_start_time for one in index] == [100_000_000 * chunk + 1 for chunk in range(chunks)]
    assert {len(one.message_index_offsets) for one in index} == {len(channels)}
    assert grown < 0.5 * chunks * 2 / 3 * 10 * len(channels), "of an entry of 10 bytes per chunk and channel"
