# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The messages of a bag are those that were written, and missing ones are counted."""

import json
import re
import textwrap

import numpy as np
import pytest
from mcap.writer import Writer

from rig_nodes.bags.cdr import encoder
from rig_nodes.bags.pieces import read_metadata
from rig_nodes.bags.reader import Bag
from rig_nodes.bags.writer import BagWriter
from rig_nodes.base.errors import BagError, RigError
from rig_nodes.cli.main import main
from rig_nodes.rig.configuration import load_rig

CATALOGUE = load_rig("hydmag").catalogue

LOGGER = "/instruments/hmg4000"
COMMAND = "/controller/command"


def test_counts_and_types_are_those_written(run, write_run, tmp_path):
    writer = write_run(tmp_path)
    bag = Bag(run)
    assert bag.counts == writer.counts
    assert bag.types == {topic: CATALOGUE.topics[topic].ros_type for topic in bag.counts}
    assert Bag(run / "run_0.mcap").counts == bag.counts


def test_series_of_every_signal_follows_its_topic(run):
    bag = Bag(run)
    for name, signal in CATALOGUE.signals.items():
        t, values = bag.series(name)
        assert t.dtype == values.dtype == float
        assert t.shape == values.shape == (bag.counts[signal.topic],)
        assert t[0] == 0.0 and np.all(np.diff(t) > 0.0)
    t, values = bag.series("I_set_zr_p2")
    np.testing.assert_allclose(values, t, atol=1e-12)
    t, values = bag.series("energy_residual")
    np.testing.assert_allclose(values, 500.0 * t, atol=1e-9)
    assert set(bag.series("s1_mode")[1]) == {2.0}


def test_series_keeps_time_beyond_two_seconds(tmp_path):
    encode = encoder("rig_msgs/msg/Measurement").encode
    with BagWriter(tmp_path, "run") as writer:
        for seq, ns in enumerate((2_500_000_000, 5_000_000_000, 3_600_000_000_001)):
            writer.write("/motor/n_wej", "rig_msgs/msg/Measurement", encode(ns, seq, float(seq)), ns)
    assert list(Bag(tmp_path).series(CATALOGUE.signal("n_wej"))[0]) == [2.5, 5.0, 3600.000000001]


def test_logger_joins_the_blocks(run):
    log = Bag(run).logger()
    names = [s.name for s in CATALOGUE.logger_channels()]
    assert list(log.channels) == names
    assert (log.t0, log.period, log.rows) == (0.0, 1.0e-4, 3500)
    for column, name in enumerate(names):
        np.testing.assert_allclose(log.channels[name], np.arange(3500) + 0.1 * column, rtol=0, atol=1e-9)
    np.testing.assert_allclose(log.time()[-1], 0.3499)


def test_events_and_run_info(run):
    bag = Bag(run)
    assert bag.events() == [
        (0.12, "/controller/events", "shift_ordered", "Gear I to gear II ordered.", 2.0),
        (0.12, "/sequencer/events", "step", "Step 3: shift.", 3.0),
    ]
    assert bag.run_info() == {"seed": 7, "rig": "hydmag"}


def test_a_sound_run_has_nothing_missing(run):
    bag = Bag(run)
    assert bag.gaps() == {} and bag.check() == [] and bag.damage == [] and bag.recovered == ""
    assert all(bag.distinct(topic) == count for topic, count in bag.counts.items())


def test_dropped_messages_are_counted(write_run, run, tmp_path):
    lost = {(COMMAND, 0), (COMMAND, 17), (COMMAND, 18), ("/motor/state", 40)}
    write_run(tmp_path, drop=lambda topic, n: (topic, n) in lost)
    bag = Bag(tmp_path)
    assert bag.gaps() == {COMMAND: 3, "/motor/state": 1}
    assert sorted(p for p in bag.check() if "lost" in p) == [
        "/controller/command lost 3 of 350 messages",
        "/motor/state lost 1 of 70 messages",
    ]
    assert {
        topic: count - bag.distinct(topic) for topic, count in Bag(run).counts.items() if topic in (COMMAND, "/motor/state")
    } == {COMMAND: 3, "/motor/state": 1}


def test_messages_lost_at_the_end_are_counted_against_the_publisher(write_run, run, tmp_path):
    write_run(tmp_path, drop=lambda topic, n: (topic == "/motor/state" and n >= 60) or topic == "/rig/state")
    bag = Bag(tmp_path)
    assert bag.gaps() == {}
    sent = Bag(run).counts
    assert sent["/motor/state"] - bag.distinct("/motor/state") == 10
    assert sent["/rig/state"] == 70 and bag.distinct("/rig/state") == 0


def test_a_repeated_message_does_not_hide_a_lost_one(tmp_path):
    encode = encoder("rig_msgs/msg/Measurement").encode
    with BagWriter(tmp_path, "run") as writer:
        for seq in (0, 1, 1, 3):
            writer.write("/motor/n_wej", "rig_msgs/msg/Measurement", encode(seq, seq, 0.0), seq)
    bag = Bag(tmp_path)
    assert bag.gaps() == {"/motor/n_wej": 1}
    assert bag.distinct("/motor/n_wej") == 3


def test_missing_logger_rows_are_said_or_filled(write_run, run, tmp_path):
    write_run(tmp_path, drop=lambda topic, n: topic == LOGGER and n in (0, 10, 11))
    bag = Bag(tmp_path)
    with pytest.raises(BagError, match="misses 100 rows, the first at 0.0500 s"):
        bag.logger()
    assert any("misses 100 rows" in problem for problem in bag.check())
    log, whole = bag.logger(fill=True), Bag(run).logger()
    assert (log.t0, log.rows) == (0.005, 3450)
    holes = np.isnan(log.channels["p1"])
    assert list(np.flatnonzero(holes)) == list(range(450, 550))
    np.testing.assert_array_equal(log.channels["p1"][~holes], whole.channels["p1"][50:][~holes])


@pytest.mark.parametrize(
    "blocks, says",
    [
        ([(0, 2, 2, [1.0] * 4), (1, 2, 2, [1.0] * 4)], "overlap"),
        ([(0, 2, 2, [1.0] * 3)], "does not hold the 4 values"),
        ([(0, 2, 3, [1.0] * 6)], "3 columns where the channel list names 2"),
        ([], "has no topic"),
        ([(2**63, 2, 2, [1.0] * 4)], "begins with row 9223372036854775808, which no run reaches"),
        ([(0, 2, 2, [1.0] * 4), (2**62, 2, 2, [1.0] * 4)], "begins with row 4611686018427387904, which no run reaches"),
        (
            [(0, 2, 2, [1.0] * 4), (2**60, 2, 2, [1.0] * 4)],
            f"{2**60 - 2} rows are missing between its blocks, more than the 134217728",
        ),
    ],
)
def test_blocks_that_do_not_fit_are_refused(tmp_path, blocks, says):
    with BagWriter(tmp_path, "run") as writer:
        writer.write(
            "/instruments/channels",
            "rig_msgs/msg/ChannelList",
            encoder("rig_msgs/msg/ChannelList").encode(0, 0, ["p1", "p2"], ["Pa", "Pa"], 1e-4),
            0,
        )
        for seq, (first, rows, channels, values) in enumerate(blocks):
            data = encoder("rig_msgs/msg/SampleBlock").encode(0, seq, first, 1e-4, rows, channels, values)
            writer.write(LOGGER, "rig_msgs/msg/SampleBlock", data, 0)
    with pytest.raises(BagError, match=says):
        Bag(tmp_path).logger(fill=True)


def test_hash_does_not_depend_on_how_topics_interleave(messages, run, tmp_path):
    with BagWriter(tmp_path, "other") as writer:
        for topic, ns, data in sorted(messages(0.35), key=lambda m: (m[1] // 10**8, m[0])):
            writer.write(topic, CATALOGUE.topics[topic].ros_type, data, ns)
    assert (tmp_path / "other_0.mcap").read_bytes() != (run / "run_0.mcap").read_bytes()
    hashes = Bag(run).canonical_hash()
    assert Bag(tmp_path).canonical_hash() == hashes
    assert set(hashes) == set(Bag(run).counts) | {"all"}


def test_hash_shows_which_topic_differs(write_run, run, tmp_path):
    write_run(tmp_path, drop=lambda topic, n: topic == COMMAND and n == 349)
    one, other = Bag(run).canonical_hash(), Bag(tmp_path).canonical_hash()
    assert {topic for topic in one if one[topic] != other[topic]} == {COMMAND, "all"}
    only = Bag(run).canonical_hash([COMMAND])
    assert only[COMMAND] == one[COMMAND] and set(only) == {COMMAND, "all"}


def test_a_bag_is_read_by_the_definitions_it_carries(tmp_path):
    """The bag has an older message without the last field and was made by another program."""
    text = "builtin_interfaces/Time stamp\nuint64 seq\nfloat64 speed\nfloat32 torque\n"
    text += "=" * 80 + "\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
    payload = encoder("rig_msgs/msg/Measurement").encode(3_000_000_000, 0, 99.5) + b"\x00\x00\x20\x41"
    payload = payload[:12] + payload[20:]  # a bare stamp, as in old messages
    with open(tmp_path / "old.mcap", "wb") as file:
        writer = Writer(file, use_chunking=False)
        writer.start("ros2", "other")
        schema = writer.register_schema("rig_msgs/msg/MotorState", "ros2msg", text.encode())
        channel = writer.register_channel("/motor/state", "cdr", schema)
        writer.add_message(channel, 3_000_000_000, payload, 3_000_000_000)
        writer.finish()
    bag = Bag(tmp_path)
    ((ns, message),) = bag.messages("/motor/state")
    assert (ns, message.speed, message.torque) == (3_000_000_000, 99.5, 10.0)
    assert [list(x) for x in bag.series(CATALOGUE.signal("motor_torque"))] == [[3.0], [10.0]]
    with pytest.raises(BagError, match="no field 'work'.*another version"):
        bag.series(CATALOGUE.signal("motor_work"))


def test_what_is_not_there_is_said(run, tmp_path):
    with pytest.raises(RigError, match="signal 'p9'; "):
        Bag(run).series("p9")
    with pytest.raises(BagError, match="has no topic /motor/speed; it holds /rig/run_info"):
        list(Bag(run).messages("/motor/speed"))
    BagWriter(tmp_path, "run").close()
    with pytest.raises(BagError, match="has no topic /motor/n_wej; it holds none"):
        Bag(tmp_path).series(CATALOGUE.signal("n_wej"))
    for topic, sentence in (
        ("/controller/signals", "the run's controller names no signals of its own"),
        ("/motor/logger", "has no topic /motor/logger"),
    ):
        with pytest.raises(BagError, match=sentence):
            Bag(run).logger(topic)
    with pytest.raises(BagError, match="nothing was recorded: the run was stopped before its time began"):
        Bag(tmp_path).check_began()
    Bag(run).check_began()
    assert Bag(tmp_path).run_info() == {} and Bag(tmp_path).events() == []


def test_metadata_that_disagrees_is_reported(write_run, tmp_path):
    write_run(tmp_path, seconds=0.05)
    path = tmp_path / "metadata.yaml"
    path.write_text(path.read_text().replace("message_count: 50\n", "message_count: 49\n"))
    problems = Bag(tmp_path).check()
    assert problems and all("counts 49 messages of" in p and "holds 50" in p for p in problems)
    path.write_text("- nothing\n")
    assert ["is no description of a bag" in p for p in Bag(tmp_path).check()] == [True]


PROFILES = re.compile(r"(offered_qos_profiles:)\n((?: {6}[ -].*\n)+)")
OTHER_FORMS = {
    "as rosbag2 writes it": lambda found: f"{found[1]}\n{textwrap.indent(found[2], '  ')}",
    "as a text": lambda found: found[1] + ' "- history: 1\\n  depth: 1"\n',
    "empty": lambda found: f"{found[1]} []\n",
}


@pytest.mark.parametrize("form", OTHER_FORMS.values(), ids=OTHER_FORMS)
def test_metadata_counts_the_same_however_its_qualities_of_service_are_written(run, tmp_path, form):
    as_ours, text = read_metadata(run), (run / "metadata.yaml").read_text()
    (tmp_path / "metadata.yaml").write_text(PROFILES.sub(form, text))
    assert (tmp_path / "metadata.yaml").read_text() != text
    assert read_metadata(tmp_path) == as_ours and as_ours.counts["/motor/state"] > 0 and as_ours.files == ["run_0.mcap"]


def test_an_error_in_metadata_has_its_line(run, tmp_path):
    lines = (run / "metadata.yaml").read_text().splitlines()
    lines[-1] = "  ros_distro: ]"
    (tmp_path / "metadata.yaml").write_text("\n".join(lines))
    with pytest.raises(RigError, match=rf"metadata.yaml:{len(lines)}: "):
        read_metadata(tmp_path)


def recorded_elsewhere(run, folder, keep):
    """Writes the run as ``ros2 bag record`` does: with another program's name, log times of the wall clock, and chosen messages."""
    folder.mkdir()
    bag, channels = Bag(run), {}
    with open(folder / "theirs_0.mcap", "wb") as file:
        writer = Writer(file)
        writer.start("ros2", "libmcap 1.3.0")
        for time, topic, data in bag.timeline():
            if topic not in channels:
                schema = writer.register_schema(bag.types[topic], "ros2msg", bag.channel(topic)[1].encode())
                channels[topic] = writer.register_channel(topic, "cdr", schema)
            if keep(topic, time):
                writer.add_message(channels[topic], 1_700_000_000 * 10**9 + time, data, 0)
        writer.finish()
    return Bag(folder)


def test_a_recorder_that_came_late_or_a_piece_of_a_bag_loses_nothing_by_that(run, tmp_path):
    latched = {"/rig/run_info", "/instruments/channels"}
    late = recorded_elsewhere(run, tmp_path / "late", lambda topic, ns: topic in latched or ns >= 80_000_000)
    assert late.recorded_from == 0.08 and late.gaps() == {}
    assert not [problem for problem in late.check() if "lost" in problem]
    piece = recorded_elsewhere(run, tmp_path / "piece", lambda topic, ns: 100_000_000 <= ns < 200_000_000)
    assert piece.recorded_from == 0.1 and piece.gaps() == {}
    holes = recorded_elsewhere(
        run, tmp_path / "holes", lambda topic, ns: ns >= 80_000_000 and not (topic == COMMAND and ns in (90_000_000, 95_000_000))
    )
    assert holes.gaps() == {COMMAND: 2}
    assert late.events() == Bag(run).events() and list(late.fields(COMMAND, ["gear"])[0][:2]) == [0.08, 0.081]


def test_who_was_there_from_the_start_has_lost_what_is_missing_of_it(write_run, run, tmp_path):
    first = recorded_elsewhere(run, tmp_path / "theirs", lambda topic, ns: topic != COMMAND or ns >= 20_000_000)
    assert first.recorded_from == 0.0 and first.gaps() == {COMMAND: 20}
    write_run(tmp_path / "ours", drop=lambda topic, n: topic not in ("/rig/run_info",) and n < 4)
    ours = Bag(tmp_path / "ours")
    assert ours.recorded_from == 0.0 and ours.gaps()[COMMAND] == 4


def test_the_report_says_from_when_on_a_bag_was_recorded(run, tmp_path, capsys):
    recorded_elsewhere(run, tmp_path / "late", lambda topic, ns: ns >= 80_000_000)
    assert main(["report", str(tmp_path / "late")]) == 0
    assert "messages lost: 0 (recorded from 0.080 s on)" in capsys.readouterr().out
    assert json.loads((tmp_path / "late" / "report.json").read_text())["run"]["recorded_from_s"] == 0.08


def test_a_bag_of_an_earlier_version_has_no_number_in_its_name_and_is_found(run, tmp_path):
    for name in ("run.mcap", "run_0.mcap"):
        (tmp_path / name).write_bytes((run / "run_0.mcap").read_bytes())
        assert Bag(tmp_path).counts == Bag(run).counts
        (tmp_path / name).unlink()
