# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A recording in several files, packed or not, with pauses, of the last seconds or of some topics: one run to every reader."""

import argparse
from collections import Counter

import pytest
from rosbags.highlevel import AnyReader

from rig_nodes.bags.opened import OpenedBags
from rig_nodes.bags.reader import Bag
from rig_nodes.bags.recording import BagRecording
from rig_nodes.bags.writer import BagWriter, Layout
from rig_nodes.base.config import load_yaml
from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import main
from rig_nodes.nodes.processes.recording_options import add_options, words
from rig_nodes.nodes.processes.result import join_pieces, lost_messages
from rig_nodes.rig.configuration import load_rig

CATALOGUE = load_rig("hydmag").catalogue

S = 1_000_000_000
LENGTH = 0.95


@pytest.fixture(scope="module")
def rows(messages):
    return messages(LENGTH)


@pytest.fixture(scope="module")
def whole(rows, tmp_path_factory):
    """The run in one file."""
    return Bag(record(tmp_path_factory.mktemp("whole"), rows, Layout()).folder)


def record(folder, rows, layout, act=lambda recording, time: None, close=True, **choice):
    """Writes rows as the recorder does; ``act`` is called before each message. Returns the writer."""
    topics = CATALOGUE.topics
    writer = BagWriter(folder, "run", layout=layout)
    recording = BagRecording(writer, **choice)
    for topic, time, data in rows:
        act(recording, time)
        recording.take(topic, topics[topic].ros_type, data, time, topics[topic].qos)
    if close:
        recording.close()
    return writer


@pytest.mark.parametrize(
    "layout, files",
    [
        (Layout(length=300_000_000), [f"run_{n}.mcap" for n in range(4)]),
        (Layout(size=60_000), None),
        (Layout(length=400_000_000, packing="file"), [f"run_{n}.mcap.zstd" for n in range(3)]),
        (Layout(packing="none"), ["run_0.mcap"]),
    ],
    ids=["by time", "by size", "packed as files", "not packed"],
)
def test_files_of_a_split_recording_are_one_run_to_every_reader(layout, files, rows, whole, tmp_path, capsys):
    record(tmp_path, rows, layout)
    there = sorted(path.name for path in tmp_path.glob("*.mcap*"))
    assert there == files if files else 2 < len(there) < 20
    if layout.size:
        assert all(60_000 < path.stat().st_size < 400_000 for path in list(tmp_path.glob("*.mcap"))[:-1])
    bag = Bag(tmp_path)
    assert bag.timeline() == whole.timeline() and bag.check() == []
    assert bag.canonical_hash() == whole.canonical_hash()
    pieces = list(Bag.pieces(tmp_path, 60_000))
    assert sum((Counter(piece.counts) for piece in pieces), Counter()) == whole.counts
    assert [list(piece.logger().channels) for piece in pieces if piece.counts.get("/instruments/hmg4000")]
    with OpenedBags([tmp_path]) as opened:
        assert [(time, *message) for time, message in opened.timeline(opened.types)] == whole.timeline()
        assert opened.bag(["/rig/run_info"]).run_info() == whole.run_info()
    assert main(["bag", "check", str(tmp_path)]) == 0 and "whole" in capsys.readouterr().out
    information = load_yaml(tmp_path / "metadata.yaml")["rosbag2_bagfile_information"]
    assert information["relative_file_paths"] == [file["path"] for file in information["files"]] == there
    assert sum(file["message_count"] for file in information["files"]) == information["message_count"] == len(rows)
    assert information["compression_mode"] == ("FILE" if layout.packing == "file" else "")
    with AnyReader([tmp_path]) as reader:
        assert [(time, c.topic, bytes(data)) for c, time, data in reader.messages()] == sorted(
            ((time, topic, data) for time, topic, data in whole.timeline()), key=lambda row: row[0]
        )


def test_a_file_that_is_missing_of_several_is_named_and_its_messages_count_as_lost(rows, tmp_path, capsys):
    record(tmp_path, rows, Layout(length=300_000_000))
    (tmp_path / "run_1.mcap").unlink()
    assert main(["bag", "check", str(tmp_path)]) == 3
    error = capsys.readouterr().err
    assert "run_1.mcap is missing" in error and "messages are lost" in error
    assert Bag(tmp_path).gaps()["/motor/state"] == 60
    (tmp_path / "other.mcap").write_bytes(b"")
    with pytest.raises(RigError, match=r"holds one bag of \.mcap files, this one holds other.mcap, run_0.mcap"):
        Bag(tmp_path)


def test_files_of_a_killed_recorder_are_joined_and_those_of_an_ended_one_stay(rows, whole, tmp_path):
    record(tmp_path / "ended", rows, Layout(length=300_000_000))
    join_pieces(tmp_path / "ended")
    assert len(list((tmp_path / "ended").glob("*.mcap"))) == 4
    writer = record(tmp_path / "killed", rows, Layout(length=300_000_000), close=False)
    writer.flush()
    join_pieces(tmp_path / "killed")
    assert [path.name for path in (tmp_path / "killed").glob("*.mcap")] == ["run_0.mcap"]
    joined = Bag(tmp_path / "killed")
    assert joined.counts == whole.counts
    assert all(joined.channel(topic) == whole.channel(topic) for topic in whole.counts), "also as each was offered"


def test_a_plain_file_beside_its_packed_one_counts_once(rows, whole, tmp_path):
    record(tmp_path, rows, Layout(packing="file"))
    record(tmp_path / "plain", rows, Layout())
    (tmp_path / "plain" / "run_0.mcap").rename(tmp_path / "run_0.mcap")  # killed between packing and removing
    assert Bag(tmp_path).counts == whole.counts
    with OpenedBags([tmp_path]) as opened:
        assert opened.counts == whole.counts


def test_the_last_seconds_are_written_on_demand_and_at_the_end_and_the_rest_is_no_loss(rows, whole, tmp_path, capsys):
    asked = []

    def act(recording, time):
        if time >= S // 2 and not asked:
            asked.append(time)
            recording.snapshot()

    writer = record(tmp_path, rows, Layout(), act, keep=S // 5)
    bag = Bag(tmp_path)
    held = [time for time, topic, _ in bag.timeline(["/motor/state"])]
    step = 5_000_000
    assert held == [*range(300_000_000, S // 2, step), *range(held[40], int(LENGTH * S), step)]
    assert int((LENGTH - 0.21) * S) < held[40] < int((LENGTH - 0.19) * S) and held[39] < S // 2
    assert bag.counts["/rig/run_info"] == whole.counts["/rig/run_info"] and bag.run_info() == whole.run_info()
    assert not lost_messages(bag, {"container": {"published": whole.counts}, "recorder": {"left_out": left_out_of(tmp_path)}})
    assert main(["bag", "check", str(tmp_path)]) == 0 and "whole" in capsys.readouterr().out
    assert sum(writer.counts.values()) + sum(left_out_of(tmp_path).values()) == len(rows)


def left_out_of(folder):
    with OpenedBags([folder]) as opened:
        return dict(opened.left_out)


def test_a_pause_leaves_out_all_but_what_describes_the_run_and_a_real_loss_still_shows(rows, whole, tmp_path, capsys):
    def act(recording, time):
        recording.paused = time < 100_000_000 or 300_000_000 <= time < 400_000_000 or time >= 900_000_000

    record(tmp_path / "paused", rows, Layout(), act, paused=True)
    bag, left_out = Bag(tmp_path / "paused"), left_out_of(tmp_path / "paused")
    # the pause at the end leaves no gap in the numbers
    assert left_out["/motor/state"] == 50 and bag.counts["/motor/state"] == whole.counts["/motor/state"] - 50
    assert bag.run_info() and "/rig/run_info" not in left_out
    assert main(["bag", "check", str(tmp_path / "paused")]) == 0
    published = Counter(whole.counts) + Counter({"/motor/state": 2})
    facts = {"container": {"published": published}, "recorder": {"left_out": left_out}}
    assert lost_messages(bag, facts) == {"/motor/state": 2}
    less = [row for row in rows if row[0] != "/motor/state" or not 450_000_000 <= row[1] < 500_000_000]
    record(tmp_path / "less", less, Layout(), act, paused=True)
    capsys.readouterr()
    assert main(["bag", "check", str(tmp_path / "less")]) == 3
    assert "/motor/state lost 10 messages" in capsys.readouterr().err


def test_of_the_rigs_own_topics_those_are_stored_that_were_chosen(rows, whole, tmp_path):
    record(tmp_path, rows, Layout(), takes=lambda topic: topic == "/motor/state")
    bag = Bag(tmp_path)
    chosen = {topic for topic in bag.counts if CATALOGUE.topics[topic].qos != "latched"}
    assert chosen == {"/motor/state"} and bag.counts["/motor/state"] == whole.counts["/motor/state"] and bag.run_info()


def test_options_of_a_run_reach_the_recorder_and_wrong_ones_are_refused(capsys):
    parser = argparse.ArgumentParser()
    add_options(parser)
    line = ["--own-topics", "/motor/.*", "--max-bag-size", "200000", "--max-bag-duration", "60.0", "--compression-mode", "file"]
    line += ["--keep-last", "30.0", "--start-paused"]
    assert words(parser.parse_args([])) == () and words(parser.parse_args(line)) == tuple(line)
    with pytest.raises(RigError, match="--own-topics"):
        words(parser.parse_args(["--own-topics", "("]))
    for wrong, why in (
        ("--max-bag-size=1", "100000 or more"),
        ("--keep-last=0", "0.5 or more"),
        ("--max-bag-duration=x", "seconds"),
    ):
        with pytest.raises(SystemExit):
            parser.parse_args([wrong])
        assert why in capsys.readouterr().err
