# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Channels and records that are not understood cost nothing else: they are named, kept as bytes, or counted one by one."""

import sqlite3
import struct
from pathlib import Path

import crafted
import pytest
import yaml
from mcap.reader import make_reader
from mcap.writer import Writer
from ruamel.yaml import YAML

from rig_nodes.bags.canonical import canonical_hash
from rig_nodes.bags.copy import check
from rig_nodes.bags.opened import OpenedBags
from rig_nodes.bags.pieces import read_metadata
from rig_nodes.bags.reader import Bag
from rig_nodes.base.errors import BagError
from rig_nodes.cli.main import main

SAMPLE = Path(__file__).parents[2] / "bags" / "sample"
FLOAT = b"\0\1\0\0" + struct.pack("<d", 1.5)
PROTOBUF = b"\x0a\xff\xfe\x00binary"
# topic -> message encoding, type, encoding and bytes of the definition (None: no definition at all), message
OTHERS = {
    "/json": ("json", None, b'{"a": 1}'),
    "/with_schema": ("json", ("Thing", "jsonschema", b"{}"), b'{"a": 2}'),
    "/protobuf": ("protobuf", ("a.B", "protobuf", PROTOBUF), b"\x08\x01"),
    "/ros1": ("ros1", ("std_msgs/String", "ros1msg", b"string data\n"), b"\x01\0\0\0a"),
    "/cdr_without": ("cdr", None, FLOAT),
    "/empty": ("cdr", ("my_pkg/msg/Ping", "ros2msg", b""), b"\0\1\0\0\0"),
    "/broken": ("cdr", ("a/msg/Broken", "ros2msg", b"class A: pass\n"), FLOAT),
}


def add_others(path, run):
    """Writes the messages of a run in one chunk together with those of OTHERS; returns the rows of these."""
    rows = []
    with open(path, "wb") as file:
        writer = Writer(file, chunk_size=1 << 24)
        writer.start("ros2", "rig_nodes test")
        numbers = {}
        for topic, kind in run.types.items():
            _, text, about = run.channel(topic)
            numbers[topic] = writer.register_channel(topic, "cdr", writer.register_schema(kind, "ros2msg", text.encode()), about)
        for topic, (encoding, schema, _) in OTHERS.items():
            numbers[topic] = writer.register_channel(topic, encoding, writer.register_schema(*schema) if schema else 0)
        for number, (time, topic, data) in enumerate(run.timeline()):
            writer.add_message(numbers[topic], time, data, time)
            if number in (10, 200):
                rows += [(time, other, data) for other, (_, _, data) in OTHERS.items()]
                for other, (_, _, data) in OTHERS.items():
                    writer.add_message(numbers[other], time, data, time)
        writer.finish()
    return rows


@pytest.fixture(scope="module")
def mixed(run, tmp_path_factory):
    """Returns the run's bag, a bag with the same messages and those of others, and the rows of these."""
    folder = tmp_path_factory.mktemp("mixed")
    return Bag(run), folder, add_others(folder / "run_0.mcap", Bag(run))


def test_every_message_of_the_rig_is_read_beside_channels_that_are_not_understood(mixed, capfd):
    own, path, rows = mixed
    bag = Bag(path)
    assert bag.timeline(list(own.types)) == own.timeline() and bag.check() == [] and bag.gaps() == {}
    assert bag.timeline(list(OTHERS)) == rows
    assert main(["bag", "check", str(path)]) == 0
    said = capfd.readouterr()
    assert f"whole, {sum(bag.counts.values())} messages" in said.out
    for topic, what in (("/json", "json, with no definition"), ("/protobuf", "protobuf, with a definition in protobuf")):
        assert f"{topic}: its messages are {what}; they are kept as bytes" in said.err


@pytest.mark.parametrize("verb", ["recover", "cut", "merge"])
def test_a_copy_keeps_them_with_their_definitions_byte_for_byte(verb, mixed, tmp_path, capfd):
    _, path, rows = mixed
    assert main(["bag", verb, str(path), "--out", str(tmp_path / "out")]) == 0
    with open(tmp_path / "out" / "out_0.mcap", "rb") as file:
        found = [
            (message.log_time, channel.topic, message.data)
            for _, channel, message in make_reader(file, validate_crcs=True).iter_messages()
            if channel.topic in OTHERS
        ]
    with open(tmp_path / "out" / "out_0.mcap", "rb") as file:
        summary = make_reader(file).get_summary()
    assert sorted(found) == sorted(rows)
    for channel in summary.channels.values():
        if channel.topic in OTHERS:
            encoding, schema, _ = OTHERS[channel.topic]
            held = summary.schemas.get(channel.schema_id)
            assert channel.message_encoding == encoding and (held and (held.name, held.encoding, held.data)) == schema


@pytest.mark.parametrize("verb", ["report", "view", "export"])
def test_verbs_decode_only_the_topics_that_they_need(verb, mixed, tmp_path, capfd):
    _, path, _ = mixed
    options = {"view": ["--no-open"], "export": ["csv", str(path), "-o", str(tmp_path / "run.csv")]}
    assert main([verb, *options["export"]] if verb == "export" else [verb, str(path), *options.get(verb, [])]) == 0
    said = capfd.readouterr()
    assert "Traceback" not in said.err
    if verb != "report":
        done = "shown" if verb == "view" else "exported"
        why = "its messages are json, with no definition"
        assert f"not {done}, as no signals of the rig come from them: /json ({why})" in said.err and "/empty" in said.err


def test_every_verb_says_that_a_bag_of_no_rig_records_none(tmp_path, capfd):
    path = tmp_path / "bag.mcap"
    ns = 1_700_000_000 * 10**9
    path.write_bytes(crafted.file(crafted.chunk(HEAD + crafted.message(ns=ns) * 3, first=ns, last=ns)))
    for verb in ("report", "compare", "view", "export"):
        options = {"compare": [str(path), str(SAMPLE)], "export": ["csv", str(path)], "view": [str(path), "--no-open"]}
        assert main([verb, *options.get(verb, [str(path)])]) == 2
        said = capfd.readouterr().err
        assert said.startswith(f"rig: {path}: its record of the rig cannot be used (ValueError: there is none"), verb
        assert said.count("cannot be used") == 1 and said.count("\n") == 1, said


def test_a_message_without_fields_is_read(mixed):
    assert len(list(Bag(mixed[1]).messages("/empty"))) == 2


HEAD = crafted.schema() + crafted.channel()
BAD_RECORDS = {
    "a message of no channel": (crafted.message(number=7) * 3, {"channel 7": 3}, "which is not described"),
    "a time after 2038": (crafted.message(ns=2**63 - 1) * 2, {"/x": 2}, "has the log time 9223372036854775807 ns"),
    "a message without its head": (crafted.record(5, b"\1\0"), {}, "a message is shorter than its own head"),
    "a record of another place": (crafted.record(15, bytes(4)), {}, "a record of kind 15 is among the messages"),
    "a message that rosbag2 packed and that is garbled": (
        crafted.message(b"\x28\xb5\x2f\xfd" + b"\xff" * 20) * 2,
        {"/x": 2},
        "a message of /x cannot be unpacked",
    ),
    "a garbled definition": (crafted.record(3, b"\x09\0\xff\xff\xff\xff"), {}, "a record is garbled"),
    "a channel of another topic": (crafted.channel(topic="/y"), {"channel 1": 1}, "channel 1 is given twice"),
    "metadata longer than their channel": (
        crafted.record(4, struct.pack("<HH", 2, 1) + crafted.text("/y") + crafted.text("cdr") + b"\xff\xff\xff\x7f"),
        {},
        "the metadata of the channel of /y are garbled",
    ),
    "a channel without its definition": (
        crafted.channel(2, "/y", of=9) + crafted.message(number=2),
        {},
        "topic /y names a message definition that is not there",
    ),
}


@pytest.mark.parametrize(
    "what, chunked", [*((what, True) for what in BAD_RECORDS), *((what, False) for what in BAD_RECORDS if "place" not in what)]
)
def test_a_bad_record_is_one_less_and_counted(what, chunked, tmp_path, capfd):
    record, lost, words = BAD_RECORDS[what]
    data = HEAD + crafted.message(b"first") + record + crafted.message(b"last")
    path = tmp_path / "bag.mcap"
    path.write_bytes(crafted.file(crafted.chunk(data) if chunked else data))
    with OpenedBags([path]) as bags:
        kept = check(bags)
        held = [message for _, (_, message) in bags.timeline({"/x"})]
    assert held[0] == b"first" and (held[-1] == b"last" or "channel 1" in lost)
    assert kept.lost == lost and any(words in sentence for sentence in kept.damage), kept
    assert [data for _, data in Bag(path, recover=True).raw("/x")] == held
    assert main(["bag", "recover", str(path), "--out", str(tmp_path / "out")]) == 3
    said = capfd.readouterr().err
    assert words in said and (not lost or f"{sum(lost.values())} messages are lost" in said)


def test_a_topic_of_two_types_is_two_channels_that_a_copy_keeps(tmp_path, capfd):
    path = tmp_path / "bag.mcap"
    second = crafted.schema(2, "a/msg/C", "int8 a\n") + crafted.channel(2, of=2)
    path.write_bytes(crafted.file(crafted.chunk(HEAD + crafted.message() + second + crafted.message(b"\0\1\0\0\5", number=2))))
    bag = Bag(path)
    assert bag.counts == {"/x": 1, "/x (a/msg/C)": 1} and next(bag.messages("/x (a/msg/C)"))[1].a == 5
    assert main(["bag", "recover", str(path), "--out", str(tmp_path / "out")]) == 0
    with open(tmp_path / "out" / "out_0.mcap", "rb") as file:
        found = {(schema.name, channel.topic) for schema, channel, _ in make_reader(file).iter_messages()}
    assert found == {("a/msg/B", "/x"), ("a/msg/C", "/x")}
    assert main(["bag", "check", str(tmp_path / "out")]) == 0 and Bag(tmp_path / "out").check() == []
    assert "whole, 2 messages" in capfd.readouterr().out
    text = (tmp_path / "out" / "metadata.yaml").read_text()
    (tmp_path / "out" / "metadata.yaml").write_text(text.replace("message_count: 1", "message_count: 4", 2))
    assert main(["bag", "check", str(tmp_path / "out")]) == 3 and "/x lost " in capfd.readouterr().err


def test_the_head_of_a_chunk_with_wrong_times_loses_no_message(tmp_path):
    data = HEAD + crafted.message(ns=10**9) + crafted.message(ns=2 * 10**9)
    for first, last, says in ((0, 0, False), (5, 1, False), (10**9, 2**62, False), (10**9, 10**9, True)):
        path = tmp_path / "bag.mcap"
        path.write_bytes(crafted.file(crafted.chunk(data, first=first, last=last)))
        with OpenedBags([path]) as bags:
            assert [time for time, _ in bags.timeline(bags.types)] == [10**9, 2 * 10**9], (first, last)
            assert bool(bags.damage) == says


def test_one_topic_of_sqlite3_without_a_definition_is_named_and_the_rest_read(tmp_path, capfd):
    store = sqlite3.connect(tmp_path / "bag.db3")
    store.execute(
        "CREATE TABLE topics (id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT, offered_qos_profiles TEXT)"
    )
    store.execute("CREATE TABLE messages (id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)")
    topics = [(1, "/x", "std_msgs/msg/Float64", "cdr", "- no profile: ["), (2, "/y", "my_pkg/msg/V", "cdr", "")]
    store.executemany("INSERT INTO topics VALUES (?, ?, ?, ?, ?)", topics)
    rows = [(1 + n % 2, 10**9 + n, FLOAT) for n in range(20)] + [(1, -5, FLOAT), (1, "noon", FLOAT), (9, 10**9, FLOAT)]
    store.executemany("INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)", rows)
    store.commit()
    store.close()
    assert main(["bag", "cut", str(tmp_path / "bag.db3"), "--topics", "/x", "--out", str(tmp_path / "x")]) == 3
    said = capfd.readouterr().err
    assert "/y: its messages are cdr, with no definition; they are kept as bytes" in said
    assert "2 messages of /x cannot be read" in said and "1 messages of topic 9, which is not described" in said
    assert "/x: its quality of service cannot be read" in said
    assert Bag(tmp_path / "x").counts == {"/x": 10}
    with OpenedBags([tmp_path / "bag.db3"]) as bags:
        assert sum(1 for _ in bags.timeline({"/y"})) == 10 and bags.types["/y"] == "my_pkg/msg/V"


@pytest.mark.parametrize("metadata", ["renamed", "garbled"])
def test_a_renamed_file_and_garbled_metadata_are_said_and_the_bag_is_whole(metadata, run, tmp_path, capfd):
    (tmp_path / "my_file.mcap").write_bytes((run / "run_0.mcap").read_bytes())
    text = (run / "metadata.yaml").read_text() if metadata == "renamed" else "rosbag2_bagfile_information: 7\n"
    (tmp_path / "metadata.yaml").write_text(text)
    assert main(["bag", "check", str(tmp_path)]) == 0
    said = capfd.readouterr()
    assert "whole" in said.out and ("my_file.mcap is read" if metadata == "renamed" else "the bag is read without it") in said.err


def test_a_logger_of_another_definition_is_one_sentence(tmp_path, capfd):
    definition = (
        "std_msgs/Header header\nuint64 seq\nstring remark\n"
        + crafted.section("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n")
        + crafted.section("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n")
    )
    data = b"\0\1\0\0" + bytes(8) + crafted.text(b"\0") + bytes(3) + bytes(8) + crafted.text(b"a\0")
    path = tmp_path / "bag.mcap"
    for topic, kind, read in (
        ("/instruments/hmg4000", "SampleBlock", lambda bag: bag._blocks("/instruments/hmg4000")),
        ("/rig/run_info", "RunInfo", Bag.run_info),
        ("/rig/events", "Event", Bag.events),
    ):
        described = crafted.schema(name=f"rig_msgs/msg/{kind}", definition=definition) + crafted.channel(topic=topic)
        path.write_bytes(crafted.file(crafted.chunk(described + crafted.message(data))))
        with pytest.raises(BagError, match=f"{topic} has no field "):
            read(Bag(path))
        assert main(["bag", "check", str(path)]) == 0, "nothing of the bag is lost"
        for verb in ("report", "view"):
            main([verb, str(path), *(["--no-open"] if verb == "view" else [])])
            assert "Traceback" not in "".join(capfd.readouterr())


def test_a_page_of_a_run_has_a_hash_also_of_what_cannot_be_understood(mixed, tmp_path, capfd):
    _, path, _ = mixed
    assert main(["report", str(path), "--html", str(tmp_path / "page.html")]) == 0, capfd.readouterr().err
    assert canonical_hash(path)["all"] == Bag(path).canonical_hash()["all"]
    capfd.readouterr()
    assert main(["bag", "hash", str(path)]) == 0
    assert capfd.readouterr().out.split()[0] in (tmp_path / "page.html").read_text(encoding="utf-8")
    hashes = []
    for data in (FLOAT, FLOAT[:-1] + b"\x40"):
        (tmp_path / "one.mcap").write_bytes(crafted.one("class A: pass\n", data))
        hashes.append(canonical_hash(tmp_path / "one.mcap")["/x"])
    assert hashes[0] != hashes[1], "its bytes count"


def test_a_garbled_message_of_the_rig_counts_for_the_hash_as_it_is(tmp_path):
    bag = Bag(SAMPLE)
    rows = list(bag.raw("/motor/state"))

    def written(name, place, data):
        with open(tmp_path / name, "wb") as file:
            writer = Writer(file, chunk_size=10_000)
            writer.start("ros2", "another")
            schema = writer.register_schema(bag.types["/motor/state"], "ros2msg", bag.channel("/motor/state")[1].encode())
            number = writer.register_channel("/motor/state", "cdr", schema)
            for at, (time, whole) in enumerate(rows):
                writer.add_message(number, time, data if at == place else whole, time)
            writer.finish()
        return tmp_path / name

    hashes = set()
    for name, place, data in (("none.mcap", -1, b""), ("short.mcap", 400, rows[400][1][:9]), ("other.mcap", 400, rows[400][1][:7])):
        path = written(name, place, data)
        hashes.add(digest := Bag(path).canonical_hash()["all"])
        assert canonical_hash(path)["all"] == digest
    assert len(hashes) == 3


@pytest.mark.parametrize("name", ["42", "true", "null", "y", "Off", "0x1f", "1.5", "~", "/x", "a b", "_", "a: b"])
def test_a_copy_is_whole_whatever_its_channels_are_called(name, tmp_path, capfd):
    path = tmp_path / "bag.mcap"
    path.write_bytes(crafted.file(crafted.chunk(crafted.schema() + crafted.channel(topic=name) + crafted.message() * 3)))
    assert main(["bag", "recover", str(path), "--out", str(tmp_path / "out")]) == 0
    assert read_metadata(tmp_path / "out").counts == {name: 3}
    for loader in (YAML(typ="safe", pure=True).load, yaml.safe_load):  # of YAML 1.2 and of 1.1
        entry = loader((tmp_path / "out" / "metadata.yaml").read_text())["rosbag2_bagfile_information"]["topics_with_message_count"]
        assert [(one["topic_metadata"]["name"], one["message_count"]) for one in entry] == [(name, 3)]
    assert main(["bag", "check", str(tmp_path / "out")]) == 0
    assert "whole, 3 messages of 1 topics" in capfd.readouterr().out
