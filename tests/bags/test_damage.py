# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Damaged and missing bags: one sentence with the place and the remedy, and recovery of the undamaged part."""

import io

import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

from rig_nodes.bags.cdr import encoder
from rig_nodes.bags.reader import Bag
from rig_nodes.bags.writer import BagWriter
from rig_nodes.base.errors import BagError


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """Bytes of a bag of three chunks with ten messages each."""
    folder = tmp_path_factory.mktemp("small")
    encode = encoder("rig_msgs/msg/Measurement").encode
    with BagWriter(folder, "run") as writer:
        for seq in range(30):
            ns = seq * 10_000_000
            writer.write("/motor/n_wej", "rig_msgs/msg/Measurement", encode(ns, seq, seq * 1.5), ns)
    return (folder / "run_0.mcap").read_bytes()


@pytest.fixture(scope="module")
def summary(small):
    """Returns the summary that mcap makes of it."""
    return make_reader(io.BytesIO(small)).get_summary()


def put(folder, data):
    """Writes a file with these bytes."""
    path = folder / "run_0.mcap"
    path.write_bytes(data)
    return path


def refused(path, **options):
    """Returns the sentence of the refusal when a bag is opened."""
    with pytest.raises(BagError) as caught:
        Bag(path, **options)
    sentence = str(caught.value)
    assert str(path) in sentence and "\n" not in sentence
    return sentence


@pytest.mark.parametrize("recover", [False, True])
@pytest.mark.parametrize(
    "data, says",
    [
        (b"", "is empty (0 bytes)"),
        (b"SQLite format 3\x00" + bytes(100), "is a bag of sqlite3; make one of MCAP of it"),
        (b"{}", "does not begin as an MCAP file at byte 0"),
        (bytes(5000), "does not begin as an MCAP file at byte 0"),
    ],
)
def test_files_that_are_no_bag(tmp_path, data, says, recover):
    assert says in refused(put(tmp_path, data), recover=recover)


def test_missing_files_and_folders(tmp_path):
    assert "there is no such file or folder" in refused(tmp_path / "run")
    assert "this one holds none" in refused(tmp_path)
    for name in ("a.mcap", "b.mcap"):
        (tmp_path / name).touch()
    assert "this one holds a.mcap, b.mcap" in refused(tmp_path)


def test_a_file_cut_anywhere_is_refused_and_recovered(tmp_path, small, summary):
    whole = [index.chunk_start_offset + index.chunk_length for index in summary.chunk_indexes]
    step = max(1, len(small) // 80)
    for length in {*range(1, len(small), step), *range(len(small) - 40, len(small)), *whole}:
        path = put(tmp_path, small[:length])
        sentence = refused(path)
        assert " at byte " in sentence and "recovery" in sentence, length
        bag = Bag(path, recover=True)
        assert sum(bag.counts.values()) == 10 * sum(end <= length for end in whole), length
        assert bag.recovered


def test_any_flipped_byte_is_noticed(tmp_path, small):
    step = max(1, len(small) // 500)
    for position in {*range(0, len(small), step), *range(100), *range(len(small) - 60, len(small))}:
        data = bytearray(small)
        data[position] ^= 0x41
        assert " at byte " in refused(put(tmp_path, bytes(data))), position


def test_recovery_passes_over_a_damaged_chunk(tmp_path, small, summary):
    middle = summary.chunk_indexes[1]
    data = bytearray(small)
    data[middle.chunk_start_offset + middle.chunk_length - 30] ^= 1
    path = put(tmp_path, bytes(data))
    sentence = refused(path)
    assert "a chunk" in sentence and f"at byte {middle.chunk_start_offset} of {len(small)}" in sentence
    bag = Bag(path, recover=True)
    values = [message.value for _, message in bag.messages("/motor/n_wej")]
    assert values == [seq * 1.5 for seq in [*range(10), *range(20, 30)]]
    assert bag.gaps() == {"/motor/n_wej": 10}
    assert bag.recovered.startswith("20 messages recovered up to 0.290 s (a chunk")
    assert any("lost 10 of 30" in p for p in bag.check())


def test_something_after_the_end_is_refused(tmp_path, small):
    assert "last magic bytes" in refused(put(tmp_path, small + b"\n"))


def foreign(folder, text=b"float64 value\n", encoding="ros2msg", data=bytes(12), name="some_msgs/msg/Value"):
    """A bag as another program might write it."""
    with open(folder / "run_0.mcap", "wb") as file:
        writer = Writer(file)
        writer.start("ros2", "other")
        channel = writer.register_channel("/x", "cdr", writer.register_schema(name, encoding, text))
        writer.add_message(channel, 0, data, 0)
        writer.finish()
    return Bag(folder)


@pytest.mark.parametrize(
    "arguments, says",
    [
        ({"text": b"this is no definition"}, "definition of some_msgs/msg/Value cannot be read"),
        ({"encoding": "protobuf"}, "/x is encoded as cdr/protobuf, expected cdr/ros2msg"),
        ({"data": b"\x00\x01\x00\x00\x01"}, "a message of /x cannot be decoded"),
    ],
)
def test_messages_that_cannot_be_decoded(tmp_path, arguments, says):
    bag = foreign(tmp_path, **arguments)
    assert bag.counts == {"/x": 1}
    with pytest.raises(BagError, match=says):
        list(bag.messages("/x"))
