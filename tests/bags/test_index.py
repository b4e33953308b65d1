# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A bag that is read as its messages are requested: the same messages in the same order from every writer, in little memory."""

import json
import subprocess
import sys

import pytest
from mcap.writer import CompressionType, Writer

from rig_nodes.bags.index import BagIndex
from rig_nodes.bags.opened import OpenedBags
from rig_nodes.bags.reader import Bag
from rig_nodes.cli.main import main

MS = 1_000_000
LOGGER = "/instruments/hmg4000"


def all_of(path, begin=0):
    with OpenedBags([path]) as index:
        return [(time, topic, data) for time, (topic, data) in index.timeline(list(index.types), begin)], index.damage


def written_by_others(path, rows, **options):
    """Writes a bag of rows (topic, time, data) in the order of the file, with chunks of about 400 bytes."""
    with open(path, "wb") as file:
        writer = Writer(file, **{"chunk_size": 400, **options})
        writer.start("ros2", "another")
        schema, channels = writer.register_schema("std_msgs/msg/Bool", "ros2msg", b"bool data\n"), {}
        for topic, time, data in rows:
            if topic not in channels:
                channels[topic] = writer.register_channel(topic, "cdr", schema)
            writer.add_message(channels[topic], time, data, time)
        writer.finish()


def overlapping():
    """Two recorders' buffers, written one after the other, and messages that arrive 300 ms late."""
    rows = []
    for block in range(10):
        for topic, late in (("/fast", 0), ("/late", 300), ("/fast", 5)):
            rows += [
                (topic, max(0, block * 100 + ms - late) * MS + 10**18, b"\0\1\0\0" + bytes([block, ms % 256, late % 256]))
                for ms in range(0, 100, 10)
            ]
    return rows


OTHERS = {
    "chunks that overlap": {},
    "without compression": {"compression": CompressionType.NONE},
    "lz4": {"compression": CompressionType.LZ4},
    "without chunks": {"use_chunking": False},
    "without statistics": {"use_statistics": False},
    "without summary": {"use_statistics": False, "use_summary_offsets": False, "repeat_channels": False, "repeat_schemas": False},
    "without indices": {"index_types": 0},
    "without checksums": {"enable_crcs": False},
}


@pytest.mark.parametrize("options", OTHERS.values(), ids=OTHERS)
def test_messages_come_complete_and_in_order_of_time_whoever_wrote_the_bag(tmp_path, options):
    rows = overlapping()
    if "index_types" in options:
        from mcap.writer import IndexType

        options = {"index_types": IndexType.NONE}
    written_by_others(tmp_path / "bag.mcap", rows, **options)
    expected = sorted(((time, topic, data) for topic, time, data in rows), key=lambda row: row[0])
    found, damage = all_of(tmp_path)
    assert found == expected and not damage
    begin = 10**18 + 555 * MS
    assert all_of(tmp_path, begin)[0] == [row for row in expected if row[0] >= begin]
    with OpenedBags([tmp_path]) as index:
        assert index.counts == {"/fast": 200, "/late": 100} and (index.first, index.last) == (expected[0][0], expected[-1][0])
        late = [time for time, _ in index.timeline({"/late"}, end=begin)]
        assert late == [row[0] for row in expected if row[1] == "/late" and row[0] < begin]


def test_it_agrees_with_the_bag_read_as_a_whole(run):
    bag = Bag(run)
    found, damage = all_of(run)
    assert found == bag.timeline() and not damage
    with OpenedBags([run]) as index:
        assert (index.counts, index.types) == (bag.counts, bag.types)
        some = index.bag(["/controller/events", "/sequencer/events", "/rig/run_info"])
        assert some.events() == bag.events() and some.run_info() == bag.run_info()


def test_pieces_hold_together_what_the_bag_holds(run):
    pieces = list(Bag.pieces(run, 60_000))
    whole = Bag(run)
    assert len(pieces) > 2 and sum(piece.counts["/motor/state"] for piece in pieces) == whole.counts["/motor/state"]
    rows = [row for piece in pieces if piece.counts[LOGGER] for row in piece.logger().channels["p1"]]
    assert rows == list(whole.logger().channels["p1"])


def test_a_cut_bag_is_read_as_far_as_it_goes_and_a_damaged_chunk_is_told_when_its_time_comes(run, tmp_path):
    data = (run / "run_0.mcap").read_bytes()
    path = tmp_path / "run_0.mcap"
    path.write_bytes(data[: len(data) // 2])
    found, damage = all_of(path)
    assert found == Bag(path, recover=True).timeline() and len(found) > 100
    assert len(damage) == 1 and " at byte " in damage[0]

    with OpenedBags([run]) as index:
        part = index.pieces[0]._parts[1]
    broken = bytearray(data)
    broken[part.start + 200] ^= 1
    path.write_bytes(broken)
    with OpenedBags([path]) as index:
        reports = []
        index.on_damage = reports.append
        times = [time for time, _ in index.timeline(list(index.types))]
        assert times == [time for time, _, _ in Bag(run).timeline() if not part.first <= time <= part.last]
        assert reports == index.damage and len(reports) == 1 and f"at byte {part.start}" in reports[0]


def test_a_hole_in_time_is_named_and_no_option_counts_it(tmp_path, capfd):
    day = 86_400 * 1000 * MS
    rows = [("/x", time, b"\0\1\0\0\1") for time in (0, 10 * MS, *(20_000 * day + ms * MS for ms in range(0, 1000, 10)))]
    for chunk_size in (100, 1 << 20):  # the hole lies between chunks, or within one
        path = tmp_path / f"{chunk_size}.mcap"
        written_by_others(path, rows, chunk_size=chunk_size)
        with OpenedBags([path]) as bags:
            assert bags.spans == [(0, 10 * MS), (20_000 * day, 20_000 * day + 990 * MS)]
            assert bags.length == 1000 * MS and bags.time_at(0.5) == 20_000 * day + 490 * MS
        assert main(["bag", "info", str(path)]) == 0
        said = capfd.readouterr()
        assert "102 messages, 1.000 s from 0.000 s" in said.out
        assert "no message between 0.010 s and 1728000000.000 s, 20000 days, which a replay jumps over" in said.err
        assert main(["bag", "cut", str(path), "--from", "0.5", "--to", "0.6", "--out", str(tmp_path / f"cut {chunk_size}")]) == 0
        assert Bag(tmp_path / f"cut {chunk_size}").counts == {"/x": 10}
        capfd.readouterr()


MEMORY = """
import json, sys
import numpy as np
from pathlib import Path
from rig_nodes.bags.cdr import encoder
from rig_nodes.bags.index import BagIndex
from rig_nodes.bags.opened import OpenedBags
from rig_nodes.bags.reader import Bag
from rig_nodes.bags.writer import BagWriter

def peak():
    found = [int(line.split()[1]) / 1024 for line in open("/proc/self/status") if line.startswith("VmHWM")]
    Path("/proc/self/clear_refs").write_text("5")
    return found[0]

values, encode = np.random.default_rng(1), encoder("rig_msgs/msg/SampleBlock").encode
with BagWriter(sys.argv[1], "run") as writer:
    for n in range(400):
        block = values.normal(size=(500, 20))
        writer.write("/x/block", "rig_msgs/msg/SampleBlock", encode(n * 10**7, n, n * 500, 1e-4, 500, 20, block), n * 10**7)
with OpenedBags([sys.argv[1]]) as index:
    sum(1 for _ in index.timeline(["/x/block"]))
peak()
before, held = peak(), 0
with OpenedBags([sys.argv[1]]) as index:
    held = sum(1 for _ in index.timeline(["/x/block"]))
replay = peak() - before
pieces = sum(piece.counts["/x/block"] for piece in Bag.pieces(sys.argv[1], 1 << 22))
print(json.dumps([held, replay, pieces, peak() - before, Path(sys.argv[1], "run_0.mcap").stat().st_size / 1e6]))
"""


def test_a_bag_of_30_mb_is_read_in_a_few(tmp_path):
    done = subprocess.run([sys.executable, "-c", MEMORY, str(tmp_path)], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    held, replay, pieces, piecewise, size = json.loads(done.stdout)
    assert held == pieces == 400 and size > 28
    assert replay < 6 and piecewise < 15, (replay, piecewise)  # MB more than the process had before


def test_a_whole_file_is_known_by_its_end_and_any_other_by_all_of_it(run, tmp_path):
    def digest(content):
        path = tmp_path / "run_0.mcap"
        path.write_bytes(content)
        with BagIndex(path) as index:
            return index.digest()

    whole = (run / "run_0.mcap").read_bytes()
    assert digest(whole) == digest(whole)
    other = bytearray(whole)
    other[-30] ^= 1  # in the checksum of the summary, which is then not read
    cut, cut_otherwise = whole[: len(whole) // 2], bytearray(whole[: len(whole) // 2])
    cut_otherwise[len(cut) - 10] ^= 1
    assert len({digest(content) for content in (whole, bytes(other), cut, bytes(cut_otherwise))}) == 4
    written_by_others(tmp_path / "a.mcap", overlapping(), enable_crcs=False)
    rows = overlapping()
    rows[5] = (*rows[5][:2], rows[5][2][:-1] + b"\xff")
    written_by_others(tmp_path / "b.mcap", rows, enable_crcs=False)
    assert digest((tmp_path / "a.mcap").read_bytes()) != digest((tmp_path / "b.mcap").read_bytes()), (
        "there is no checksum to rely on"
    )
