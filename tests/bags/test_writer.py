# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bags as other tools see them, and what remains of one when its writer is ended by force."""

import re
import subprocess
import sys
from collections import Counter, defaultdict

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.records import Chunk, DataEnd
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability, QosHistory, QosReliability
from rosbags.rosbag2 import Reader

from rig_nodes.bags.cdr import encoder
from rig_nodes.bags.definitions import installed
from rig_nodes.bags.metadata import PROFILES
from rig_nodes.bags.reader import Bag
from rig_nodes.bags.writer import BagWriter, Column, Layout
from rig_nodes.base.errors import RigError
from rig_nodes.nodes.qos import publisher_profile
from rig_nodes.rig.configuration import load_rig
from rig_nodes.rig.signal_catalogue import QOS

CATALOGUE = load_rig("hydmag").catalogue

MEASUREMENT = "rig_msgs/msg/Measurement"


def measurement(ns, seq, value=0.0):
    return encoder(MEASUREMENT).encode(ns, seq, value)


def test_ros2_bag_reindex_takes_the_file_for_a_piece_of_the_bag(run):
    # the whole name must match the pattern of rosbag2_cpp's reindexer
    assert [bool(re.fullmatch(r".+_(\d+)\.([a-zA-Z0-9])+", path.name)) for path in run.glob("*.mcap")] == [True]


def test_the_same_calls_give_the_same_bytes(write_run, tmp_path):
    for name in ("a", "b"):
        write_run(tmp_path / name)
    for file in ("run_0.mcap", "metadata.yaml"):
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()


def test_mcap_validates_all_checksums_and_finds_every_message(run, messages):
    with open(run / "run_0.mcap", "rb") as file:
        records = list(StreamReader(file, validate_crcs=True, emit_chunks=True).records)
    chunks = [r for r in records if isinstance(r, Chunk)]
    assert len(chunks) == 4 and all(chunk.uncompressed_crc for chunk in chunks)
    (end,) = [r for r in records if isinstance(r, DataEnd)]
    assert end.data_section_crc
    with open(run / "run_0.mcap", "rb") as file:
        found = [
            (channel.topic, message.log_time, message.data)
            for _, channel, message in make_reader(file, validate_crcs=True).iter_messages(log_time_order=False)
        ]
    assert found == messages(0.35)


def plain(node, value):
    """Returns numbers, strings, lists and dicts of a message, whichever program decoded it."""
    if node.kind == "message":
        return {name: plain(member, getattr(value, name)) for name, member in node.fields}
    if node.kind in ("array", "sequence"):
        return [plain(node.item, item) for item in value]
    return value


def test_mcap_ros2_support_and_rosbags_agree_on_every_value(run, messages):
    trees = {topic: installed(entry.ros_type).tree for topic, entry in CATALOGUE.topics.items()}
    with open(run / "run_0.mcap", "rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        foxglove = [
            (channel.topic, message.log_time, plain(trees[channel.topic], decoded))
            for _, channel, message, decoded in reader.iter_decoded_messages(log_time_order=False)
        ]
    with AnyReader([run]) as reader:
        ternaris = [(c.topic, ns, plain(trees[c.topic], reader.deserialize(data, c.msgtype))) for c, ns, data in reader.messages()]
    bag = Bag(run)
    ours = [(topic, ns, plain(trees[topic], message)) for topic in bag.counts for ns, message in bag.messages(topic)]
    assert len(foxglove) == len(messages(0.35))

    def order(rows):
        return sorted(rows, key=lambda row: (row[0], row[1]))

    assert order(foxglove) == order(ternaris) == order(ours)


def test_metadata_is_rosbag2s_with_counts_hashes_and_quality_of_service(run, messages):
    counts = Counter(topic for topic, _, _ in messages(0.35))
    with Reader(run) as reader:
        assert (reader.message_count, reader.start_time) == (sum(counts.values()), 0)
        assert reader.duration == 349_000_001
        assert reader.ros_distro == "jazzy"
        connections = {c.topic: c for c in reader.connections}
    assert {topic: c.msgcount for topic, c in connections.items()} == counts
    for topic, connection in connections.items():
        assert connection.digest == installed(CATALOGUE.topics[topic].ros_type).type_hash
    (qos,) = connections["/instruments/channels"].ext.offered_qos_profiles
    assert (qos.durability, qos.depth) == (QosDurability.TRANSIENT_LOCAL, 1000)
    (qos,) = connections["/motor/state"].ext.offered_qos_profiles
    assert (qos.reliability, qos.history, qos.depth) == (QosReliability.RELIABLE, QosHistory.KEEP_LAST, 1000)
    (qos,) = connections["/controller/command"].ext.offered_qos_profiles
    assert (qos.deadline.sec, qos.deadline.nsec) == (0, 100_000_000)


@pytest.mark.parametrize("qos", QOS)
def test_a_bag_says_how_the_nodes_offer_their_topics(qos):
    stored, offered = PROFILES[qos], publisher_profile(qos)
    assert stored["depth"] == offered.depth
    for policy in ("history", "reliability", "durability"):
        assert stored[policy] == getattr(offered, policy).name.lower()
    deadline = stored["deadline"]["sec"] * 1_000_000_000 + stored["deadline"]["nsec"]
    assert deadline == (offered.deadline.nanoseconds or 2**63 - 1)


@pytest.mark.parametrize("layout", [Layout(), Layout(size=20_000), Layout(length=120_000_000), Layout(packing="none")])
def test_columns_are_stored_as_their_messages_one_by_one(messages, tmp_path, layout):
    rows = messages(0.35)
    types = {name: topic.ros_type for name, topic in CATALOGUE.topics.items()}
    with BagWriter(tmp_path / "each", "run", layout=layout) as bag:
        for topic, ns, data in rows:
            bag.write(topic, types[topic], data, ns)
    # two blocks; in each a column for each topic and size of its messages
    with BagWriter(tmp_path / "columns", "run", layout=layout) as bag:
        for begin, end in ((0, 700), (700, len(rows))):
            columns = defaultdict(list)
            for place in range(begin, end):
                columns[rows[place][0], len(rows[place][2])].append(place)
            bag.write_columns(
                [
                    Column(
                        topic,
                        np.array(places),
                        np.array([rows[place][1] for place in places]),
                        np.array([list(rows[place][2]) for place in places], np.uint8),
                    )
                    for (topic, _), places in columns.items()
                ]
            )
        assert bag.counts == Counter(topic for topic, _, _ in rows)
    files = sorted(path.name for path in (tmp_path / "each").iterdir())
    assert files == sorted(path.name for path in (tmp_path / "columns").iterdir())
    for name in files:
        assert (tmp_path / "columns" / name).read_bytes() == (tmp_path / "each" / name).read_bytes()


def test_no_chunk_spans_a_boundary_of_100_ms(run):
    with open(run / "run_0.mcap", "rb") as file:
        chunks = make_reader(file).get_summary().chunk_indexes
    assert [(c.message_start_time // 10**8, c.message_end_time // 10**8) for c in chunks] == [(0, 0), (1, 1), (2, 2), (3, 3)]


def test_file_tells_nothing_of_the_machine(run):
    with open(run / "run_0.mcap", "rb") as file:
        header = make_reader(file).get_header()
    assert header.profile == "ros2"
    assert header.library.startswith("rig_nodes ") and "mcap" not in header.library
    assert str(run).encode() not in (run / "run_0.mcap").read_bytes() + (run / "metadata.yaml").read_bytes()


def test_padding_of_the_transport_does_not_reach_the_bag(tmp_path):
    data = encoder("rig_msgs/msg/Setpoint").encode(0, 0, 1.5, True)
    with BagWriter(tmp_path, "run") as writer:
        writer.write("/motor/command", "rig_msgs/msg/Setpoint", data + b"\x00\x00\x00", 0)
    assert [d for _, d in Bag(tmp_path).raw("/motor/command")] == [data]


def test_misuse_is_refused_and_the_bag_goes_on(tmp_path):
    writer = BagWriter(tmp_path, "run")
    writer.write("/motor/n_wej", MEASUREMENT, measurement(0, 0), 0)
    with pytest.raises(RigError, match="/motor/n_wej holds rig_msgs/msg/Measurement"):
        writer.write("/motor/n_wej", "rig_msgs/msg/Setpoint", measurement(0, 1), 0)
    with pytest.raises(RigError, match="/motor/n_wej: 35 bytes are no .*Measurement, which has 36"):
        writer.write("/motor/n_wej", MEASUREMENT, measurement(0, 1)[:-1], 0)
    with pytest.raises(RigError, match="is there already"):
        BagWriter(tmp_path, "run")
    writer.write("/motor/n_wej", MEASUREMENT, measurement(1, 1), 1)
    writer.close()
    before = (tmp_path / "run_0.mcap").read_bytes()
    writer.close()
    assert (tmp_path / "run_0.mcap").read_bytes() == before
    with pytest.raises(RigError, match="is closed"):
        writer.write("/motor/n_wej", MEASUREMENT, measurement(2, 2), 2)
    assert writer.counts == Bag(tmp_path).counts == {"/motor/n_wej": 2}


def test_a_run_without_messages_is_a_bag(tmp_path):
    BagWriter(tmp_path, "run").close()
    assert Bag(tmp_path).counts == {}
    with Reader(tmp_path) as reader:
        assert reader.message_count == 0


KILLED = """
import sys
from rig_nodes.bags.cdr import encoder
from rig_nodes.bags.writer import BagWriter
encode = encoder("rig_msgs/msg/Measurement").encode
writer = BagWriter(sys.argv[1], "run")
for ms in range(60_000):
    writer.write("/motor/n_wej", "rig_msgs/msg/Measurement", encode(ms * 1_000_000, ms, 1.0), ms * 1_000_000)
    print(ms, flush=True)
"""


@pytest.mark.parametrize("after_ms", [250, 1080])
def test_a_killed_writer_loses_at_most_a_fifth_of_a_second(tmp_path, after_ms):
    child = subprocess.Popen([sys.executable, "-c", KILLED, str(tmp_path)], stdout=subprocess.PIPE, text=True)
    for line in child.stdout:
        if int(line) >= after_ms:
            child.kill()
            break
    lines = [line for line in child.stdout if line.endswith("\n")]
    assert child.wait(timeout=10) == -9
    last = int(lines[-1]) if lines else after_ms
    bag = Bag(tmp_path, recover=True)
    kept = [ns for ns, _ in bag.messages("/motor/n_wej")]
    assert kept == [ms * 1_000_000 for ms in range(len(kept))]
    assert last - len(kept) < 200
    assert bag.recovered.startswith(f"{len(kept)} messages recovered up to")


FULL_DISK = """
import resource, sys
TOPIC, TYPE = "/motor/n_wej", "rig_msgs/msg/Measurement"
from rig_nodes.bags.cdr import encoder
from rig_nodes.bags.reader import Bag
from rig_nodes.bags.writer import BagWriter
from rig_nodes.base.errors import RigError
resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))
encode = encoder("rig_msgs/msg/Measurement").encode
writer = BagWriter(sys.argv[1], "run")
try:
    for ms in range(60_000):
        writer.write(TOPIC, TYPE, encode(ms * 1_000_000, ms, ms * 0.1), ms * 1_000_000)
except RigError as error:
    print(ms, error)
for action in (lambda: writer.write(TOPIC, TYPE, encode(0, 0, 0.0), 0), writer.flush):
    try:
        action()
    except RigError as error:
        print("again", error)
writer.close()
"""


def test_a_full_disk_is_said_at_once_and_what_was_written_is_kept(tmp_path):
    done = subprocess.run([sys.executable, "-c", FULL_DISK, str(tmp_path)], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0 and not done.stderr
    first, *again = done.stdout.splitlines()
    ms, _, sentence = first.partition(" ")
    assert "cannot be written (File too large)" in sentence
    assert again == [f"again {sentence}"] * 2
    bag = Bag(tmp_path, recover=True)
    assert int(ms) - 200 <= bag.counts["/motor/n_wej"] <= int(ms)
    last = max(time for time, _ in bag.messages("/motor/n_wej")) / 1e9
    assert f"what was recorded up to {last:.3f} s stays readable" in sentence
    assert not (tmp_path / "metadata.yaml").exists()
