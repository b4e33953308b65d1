# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rig bag` on the sample bag and on its copies by other programs: pieces, packed files, sqlite3, damage."""

import errno
import os
import re
from pathlib import Path

import pytest
import yaml
import zstandard
from mcap.reader import make_reader
from mcap.writer import CompressionType
from mcap.writer import Writer as LibraryWriter
from rosbags.highlevel import AnyReader
from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.rosbag2 import CompressionFormat, CompressionMode, Reader, StoragePlugin
from rosbags.rosbag2 import Writer as RosbagsWriter
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from rig_nodes.bags.reader import Bag
from rig_nodes.bags.writer import BagWriter
from rig_nodes.base.errors import BagError
from rig_nodes.cli.main import main

SAMPLE = Path(__file__).parents[2] / "bags" / "sample"
FILE = SAMPLE / "sample_0.mcap"
BRIEF = Path(__file__).parents[1] / "graph" / "brief.yaml"


@pytest.fixture(scope="module")
def sample():
    return Bag(SAMPLE)


@pytest.fixture(scope="module")
def others(sample, tmp_path_factory):
    """The sample as other programs store it: in one large chunk, in pieces, in a packed file, in sqlite3."""
    folder = tmp_path_factory.mktemp("others")
    rows = sample.timeline()

    def library(name, rows):
        path = folder / name
        path.parent.mkdir(exist_ok=True)
        with open(path, "wb") as file:
            writer = LibraryWriter(file, compression=CompressionType.LZ4, chunk_size=1 << 24)
            writer.start(profile="ros2")
            channels = {}
            for topic, kind in sample.types.items():
                _, text, about = sample.channel(topic)
                schema = writer.register_schema(kind, "ros2msg", text.encode())
                channels[topic] = writer.register_channel(topic, "cdr", schema, about)
            for time, topic, data in rows:
                writer.add_message(channels[topic], time, data, time)
            writer.finish()
        return path

    half = len(rows) // 2
    whole = library("whole.mcap", rows)
    library("pieces/a_0.mcap", rows[:half])
    library("pieces/a_1.mcap", rows[half:])
    packed = folder / "packed_0.mcap.zstd"
    packed.write_bytes(zstandard.compress(FILE.read_bytes()))
    store = get_typestore(Stores.ROS2_JAZZY)
    for topic, kind in sample.types.items():
        store.register(
            {
                name: definition
                for name, definition in get_types_from_msg(sample.channel(topic)[1], kind).items()
                if name not in store.fielddefs
            }
        )
    with RosbagsWriter(folder / "sqlite", version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        topics = {topic: writer.add_connection(topic, kind, typestore=store) for topic, kind in sample.types.items()}
        for time, topic, data in rows:
            writer.write(topics[topic], time, data)
    return [FILE, whole, folder / "pieces", packed, folder / "sqlite"]


def rig_bag(capfd, *arguments):
    code = main(["bag", *map(str, arguments)])
    captured = capfd.readouterr()
    return code, captured.out, captured.err


def test_the_same_content_has_one_hash_however_it_is_stored_and_other_content_another(others, capfd, tmp_path):
    code, out, err = rig_bag(capfd, "hash", *others)
    assert (code, err) == (0, "")
    assert len(out.splitlines()) == 5 and len({line.split()[0] for line in out.splitlines()}) == 1, out
    assert rig_bag(capfd, "cut", SAMPLE, "--to", 1, "--out", tmp_path / "cut")[0] == 0
    assert rig_bag(capfd, "hash", tmp_path / "cut")[1].split()[0] != out.split()[0]


def test_info_and_check_count_every_message_of_every_form(others, sample, capfd):
    held = sum(sample.counts.values())
    code, out, _ = rig_bag(capfd, "info", *others)
    assert code == 0 and out.count(f"{held} messages, ") == len(others)
    assert len(re.findall(r"/motor/state +rig_msgs/msg/MotorState +" + str(sample.counts["/motor/state"]), out)) == len(others)
    code, out, err = rig_bag(capfd, "check", *others)
    assert code == 0 and out.count(f"whole, {held} messages of {len(sample.counts)} topics") == len(others), err


LATCHED = ("/rig/run_info", "/instruments/channels", "/instruments/controller_record")


def test_two_halves_merged_again_are_the_bag_and_other_readers_open_it(sample, capfd, tmp_path):
    assert rig_bag(capfd, "cut", SAMPLE, "--from", 1, "--out", tmp_path / "late")[0] == 0
    assert rig_bag(capfd, "cut", SAMPLE, "--to", 1, "--out", tmp_path / "early")[0] == 0
    code, out, _ = rig_bag(capfd, "merge", tmp_path / "late", tmp_path / "early", "--out", tmp_path / "again")
    assert code == 0 and f"{sum(sample.counts.values())} messages" in out
    hashes = rig_bag(capfd, "hash", SAMPLE, tmp_path / "again")[1].split()
    assert hashes[0] == hashes[2]
    with open(tmp_path / "again" / "again_0.mcap", "rb") as file:
        times = [message.log_time for _, _, message in make_reader(file, validate_crcs=True).iter_messages()]
    assert times == [time for time, _, _ in sample.timeline()]
    with AnyReader([tmp_path / "again"]) as reader:
        assert {name: topic.msgcount for name, topic in reader.topics.items()} == sample.counts
    assert Bag(tmp_path / "early").counts["/motor/state"] == 200
    early, late = ({topic: bag.counts[topic] for topic in LATCHED} for bag in (Bag(tmp_path / "early"), Bag(tmp_path / "late")))
    assert early == late == dict.fromkeys(LATCHED, 1), "a part of a run says what its rig is"
    assert rig_bag(capfd, "check", tmp_path / "late")[0] == 0


def test_what_merged_bags_hold_alike_is_written_once_and_counted(sample, capfd, tmp_path):
    assert rig_bag(capfd, "cut", SAMPLE, "--to", 1.5, "--out", tmp_path / "early")[0] == 0
    assert rig_bag(capfd, "cut", SAMPLE, "--from", 1, "--out", tmp_path / "late")[0] == 0
    both = sum(sum(Bag(tmp_path / name).counts.values()) for name in ("early", "late"))
    for bags, count in ((["early", "late"], both), ([SAMPLE, SAMPLE], 2 * sum(sample.counts.values()))):
        out = tmp_path / f"from {count}"
        code, _, err = rig_bag(capfd, "merge", *(tmp_path / bag for bag in bags), "--out", out)
        assert code == 0 and f"{count - sum(sample.counts.values())} messages that were there twice are written once" in err
        assert Bag(out).canonical_hash() == sample.canonical_hash()
        assert rig_bag(capfd, "check", out)[0] == 0


def test_what_one_of_the_merged_bags_holds_twice_stays_twice(capfd, tmp_path):
    """Users' messages of one log time may be alike, for the time of a run stands between two of its ticks."""
    for name, count in (("a", 2), ("b", 1)):
        with BagWriter(tmp_path / name, name, topics={}) as bag:
            bag.describe("/lamp", "my_pkg/msg/Lamp", "cdr/ros2msg", "bool on\n", {})
            for _ in range(count):
                bag.write("/lamp", "my_pkg/msg/Lamp", b"\0\1\0\0\1", 10**9)
    code, out, err = rig_bag(capfd, "merge", tmp_path / "a", tmp_path / "b", "--out", tmp_path / "both")
    assert code == 0 and "2 messages of 1 topics written" in out and "1 messages that were there twice" in err


def offered_in(folder):
    """Returns the profiles of every topic by a bag's metadata.yaml and by its files."""
    information = yaml.safe_load((folder / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    topics = [entry["topic_metadata"] for entry in information["topics_with_message_count"]]
    in_files = {}
    for path in folder.glob("*.mcap"):
        with open(path, "rb") as file:
            for channel in make_reader(file).get_summary().channels.values():
                in_files[channel.topic] = yaml.safe_load(channel.metadata.get("offered_qos_profiles", "[]"))
    return {topic["name"]: topic["offered_qos_profiles"] for topic in topics}, in_files


def read_with_rosbags(folder):
    """Returns the profiles by topic and the messages that rosbags finds, which looks for channels by their profiles too."""
    with Reader(folder) as reader:
        offered = {one.topic: one.ext.offered_qos_profiles for one in reader.connections}
        return offered, sorted((time, one.topic, bytes(data)) for one, time, data in reader.messages())


def test_metadata_and_channels_of_a_run_and_of_its_copies_name_the_same_profiles(run, capfd, tmp_path):
    assert main(["simulate", str(BRIEF), "--out", str(tmp_path / "simulated")]) == 0
    for source, verbs in ((run, ("recover", "cut", "merge")), (tmp_path / "simulated", ("recover",))):
        named, in_files = offered_in(source)
        assert named == in_files and named["/controller/command"][0]["deadline"] == {"sec": 0, "nsec": 100_000_000}
        read = read_with_rosbags(source)
        for verb in verbs:
            copy = tmp_path / verb / source.name
            assert rig_bag(capfd, verb, source, "--out", copy)[0] == 0
            assert offered_in(copy) == (named, in_files)
            assert read_with_rosbags(copy) == read


ODD = Qos(
    QosHistory.KEEP_ALL,
    7,
    QosReliability.BEST_EFFORT,
    QosDurability.TRANSIENT_LOCAL,
    QosTime(3, 5),
    QosTime(2147483647, 4294967295),
    QosLiveliness.MANUAL_BY_TOPIC,
    QosTime(0, 0),
    True,
)


@pytest.mark.parametrize("mode", [None, CompressionMode.MESSAGE], ids=["plain", "messages packed"])
@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3], ids=["mcap", "sqlite3"])
def test_a_copy_of_a_foreign_bag_keeps_its_profiles_and_its_messages_are_unpacked(storage, mode, capfd, tmp_path):
    source, store = tmp_path / "source", get_typestore(Stores.ROS2_JAZZY)
    writer = RosbagsWriter(source, version=9, storage_plugin=storage)
    if mode is not None:
        writer.set_compression(mode, CompressionFormat.ZSTD)
    texts = [store.serialize_cdr(store.types["std_msgs/msg/String"](f"text {n}"), "std_msgs/msg/String") for n in range(50)]
    with writer:
        for topic, profiles in {"/odd": [ODD, ODD._replace(depth=1)], "/none": []}.items():
            connection = writer.add_connection(topic, "std_msgs/msg/String", typestore=store, offered_qos_profiles=profiles)
            for number, text in enumerate(texts):
                writer.write(connection, 10**18 + number, text)
    assert rig_bag(capfd, "check", source)[0] == 0
    for path in (source, *(tmp_path / verb for verb in ("recover", "cut", "merge"))):
        assert path == source or rig_bag(capfd, path.name, source, "--out", path)[0] == 0
        offered, rows = read_with_rosbags(path)
        assert offered == {"/odd": [ODD, ODD._replace(depth=1)], "/none": []}
        assert rows == sorted((10**18 + number, topic, bytes(text)) for number, text in enumerate(texts) for topic in offered)
        if path != source:
            named, in_files = offered_in(path)
            assert named == in_files
            assert [bytes(data) for _, data in Bag(path).raw("/odd")] == [bytes(text) for text in texts]
    if storage is StoragePlugin.MCAP:
        assert [data for _, data in Bag(source).raw("/odd")] == [bytes(text) for text in texts]


def test_topics_are_cut_by_name_by_pattern_and_by_exclusion(capfd, tmp_path):
    arguments = ["--topics", "/motor/state", "--regex", "/clutch.*", "--exclude-regex", ".*command.*", "--from", 0.5, "--to", 1]
    assert rig_bag(capfd, "cut", SAMPLE, *arguments, "--out", tmp_path / "cut")[0] == 0
    bag = Bag(tmp_path / "cut")
    assert "/motor/state" in bag.counts and len(bag.counts) > 1
    assert all(topic == "/motor/state" or topic.startswith("/clutch") for topic in bag.counts)
    times = [time for time, _, _ in bag.timeline()]
    assert min(times) == 500_000_000 and max(times) < 10**9


def test_a_damaged_chunk_is_left_out_and_its_messages_are_counted(sample, capfd, tmp_path):
    data = bytearray(FILE.read_bytes())
    with open(FILE, "rb") as file:
        chunk = make_reader(file).get_summary().chunk_indexes[7]
    data[chunk.chunk_start_offset + chunk.chunk_length // 2] ^= 1
    damaged = tmp_path / "damaged.mcap"
    damaged.write_bytes(data)
    code, out, err = rig_bag(capfd, "recover", damaged, "--out", tmp_path / "saved")
    kept, lost = int(re.search(r"(\d+) messages of", out)[1]), int(re.search(r"(\d+) messages are lost", err)[1])
    assert code == 3 and lost > 100 and kept + lost == sum(sample.counts.values())
    assert rig_bag(capfd, "check", damaged)[0] == 3 == rig_bag(capfd, "hash", damaged)[0]
    saved = Bag(tmp_path / "saved")
    assert sum(saved.counts.values()) == kept
    assert set(saved.timeline()) < set(sample.timeline())


def test_a_cut_off_bag_is_recovered_and_metadata_beside_it_tells_what_is_lost(sample, capfd, tmp_path):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "sample_0.mcap").write_bytes(FILE.read_bytes()[: FILE.stat().st_size // 2])
    code, _, err = rig_bag(capfd, "check", tmp_path / "run")
    assert code == 3 and "the number of lost messages is not known" in err
    (tmp_path / "run" / "metadata.yaml").write_bytes((SAMPLE / "metadata.yaml").read_bytes())
    code, out, err = rig_bag(capfd, "recover", tmp_path / "run", "--out", tmp_path / "saved")
    kept, lost = int(re.search(r"(\d+) messages of", out)[1]), int(re.search(r"(\d+) messages are lost", err)[1])
    assert code == 3 and kept > 1000 and kept + lost == sum(sample.counts.values())


@pytest.mark.parametrize(
    "arguments, sentence",
    [
        (["check", __file__], "does not begin as an MCAP file"),
        (["info", "no_such_bag"], "no_such_bag: there is no such file or folder"),
        (["hash", Path(__file__).parent], "holds no bag"),
        (["cut", SAMPLE, "--topics", "/motor/m_we", "--out", "OUT"], "did you mean '/motor/m_wej'"),
        (["cut", SAMPLE, "--topics", ",", "--out", "OUT"], "--topics names none"),
        (["cut", SAMPLE, "--from", "9", "--out", "OUT"], "nothing lies between them; the bag is"),
        (["cut", SAMPLE, "--regex", "/nothing", "--out", "OUT"], "leave no topic of the bag"),
        (["merge", SAMPLE, "--out", SAMPLE], "is there already"),
    ],
)
def test_what_fails_is_one_sentence_and_leaves_nothing(arguments, sentence, capfd, tmp_path):
    out = tmp_path / "out"
    code, _, err = rig_bag(capfd, *(out if text == "OUT" else text for text in arguments))
    assert code == 1 and sentence in err and err.count("\n") == 1, err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["broken.db3", "broken_0.mcap.zstd"])
def test_a_broken_file_of_another_form_is_one_sentence(name, capfd, tmp_path):
    (tmp_path / name).write_bytes(b"nothing of the kind" * 100)
    code, _, err = rig_bag(capfd, "check", tmp_path / name)
    assert code == 1 and "cannot be" in err and err.count("\n") == 1, err


@pytest.mark.parametrize("work", ["info", "recover"])
def test_a_path_that_the_system_refuses_is_one_sentence(work, capfd, tmp_path):
    long = "a" * 300
    arguments = [work, long] if work == "info" else [work, SAMPLE, "--out", tmp_path / long]
    code, _, err = rig_bag(capfd, *arguments)
    assert code == 1 and "(File name too long)" in err and err.count("\n") == 1, err
    assert not list(tmp_path.iterdir())


def test_a_folder_without_access_is_one_sentence(capfd, tmp_path, monkeypatch):
    def closed(self):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(self))

    monkeypatch.setattr(Path, "iterdir", closed)  # root has access to every folder
    code, _, err = rig_bag(capfd, "info", tmp_path)
    assert (code, err) == (1, f"rig: {tmp_path}: cannot be read (Permission denied)\n")


@pytest.mark.parametrize("first", ["no_such_bag", "a" * 300])
def test_after_a_bag_that_cannot_be_read_the_next_one_is_looked_at(first, capfd):
    code, out, err = rig_bag(capfd, "check", first, SAMPLE)
    assert code == 1 and f"{SAMPLE}: whole, " in out and err.startswith(f"rig: {first}: ") and err.count("\n") == 1


@pytest.fixture
def garbled(sample, tmp_path):
    """The sample with a message of /motor/state that is cut short, and without one of a topic that comes behind it."""
    path = tmp_path / "garbled.mcap"
    left_out = sample.timeline(["/load_pump/state"])[7]
    with open(path, "wb") as file:
        writer = LibraryWriter(file)
        writer.start("ros2", "another")
        numbers = {}
        for topic in ("/motor/state", *(topic for topic in sample.types if topic != "/motor/state")):
            _, text, about = sample.channel(topic)
            schema = writer.register_schema(sample.types[topic], "ros2msg", text.encode())
            numbers[topic] = writer.register_channel(topic, "cdr", schema, about)
        state = 0
        for row in sample.timeline():
            time, topic, data = row
            state += topic == "/motor/state"
            if row != left_out:
                data = data[:9] if (topic, state) == ("/motor/state", 5) else data
                writer.add_message(numbers[topic], time, data, time)
        writer.finish()
    return path


def test_a_message_that_cannot_be_decoded_is_named_and_hides_no_lost_one(garbled, sample, capfd, tmp_path):
    code, out, err = rig_bag(capfd, "check", garbled)
    assert code == 3 and out == ""
    assert "a message of /motor/state " in err and "/load_pump/state lost 1 messages" in err and "1 messages are lost" in err
    saved = tmp_path / "saved"
    assert rig_bag(capfd, "recover", garbled, "--out", saved)[0] == 0
    assert [len(data) for _, data in Bag(saved).raw("/motor/state")].count(9) == 1
    with pytest.raises(BagError, match="a message of /motor/state "):
        Bag(garbled).gaps()
    problems = Bag(garbled).check()
    assert any("a message of /motor/state " in one for one in problems)
    assert any(one.startswith("/load_pump/state lost 1 of ") for one in problems)


def test_recovery_leaves_messages_of_one_time_as_they_are_where_one_of_them_has_no_number(sample, capfd, tmp_path):
    path, rows = tmp_path / "twice.mcap", list(sample.raw("/motor/state"))[:3]
    sent = [rows[2][1], rows[0][1][:9], rows[1][1]]
    with open(path, "wb") as file:
        writer = LibraryWriter(file)
        writer.start("ros2", "another")
        for topic, messages in (("/rig/run_info", [data for _, data in sample.raw("/rig/run_info")]), ("/motor/state", sent)):
            _, text, about = sample.channel(topic)
            schema = writer.register_schema(sample.types[topic], "ros2msg", text.encode())
            number = writer.register_channel(topic, "cdr", schema, about)
            for data in messages:
                writer.add_message(number, 10**9, data, 10**9)
        writer.finish()
    code, _, err = rig_bag(capfd, "recover", path, "--out", tmp_path / "saved")
    assert "Traceback" not in err and code in (0, 3)
    assert [data for _, data in Bag(tmp_path / "saved").raw("/motor/state")] == sent
