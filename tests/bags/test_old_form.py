# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bags of versions without a Header in the messages, and users' messages with a frame_id, are read like those of today."""

from pathlib import Path

import mcap.reader
import numpy as np
import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from rig_nodes.bags import cdr
from rig_nodes.bags.definitions import installed
from rig_nodes.bags.opened import OpenedBags
from rig_nodes.bags.reader import Bag
from rig_nodes.bags.writer import BagWriter
from rig_nodes.rig.configuration import load_rig

# old fields that have another name or another place today
OLD_NAMES = {"stamp", "n_wej", "n_wyj", "p1", "p2", "w_wej", "w_wyj", "m_wej", "m_wyj", "__msgtype__"}
BEFORE = Path(__file__).parent / "before"  # the sample bag of version 0.1.0


def as_written(topic):
    """Returns messages of a topic of the old bag, decoded by other programs and by the definition in the bag."""
    (path,) = BEFORE.glob("*.mcap")
    store, found = get_typestore(Stores.EMPTY), []
    with path.open("rb") as file:
        for schema, _, message in mcap.reader.make_reader(file).iter_messages([topic]):
            if not found:
                store.register(get_types_from_msg(schema.data.decode(), schema.name))
            found.append(store.deserialize_cdr(message.data, schema.name))
    return found


def test_the_old_bag_is_one_of_before():
    assert hasattr(as_written("/alfa46/command")[0], "stamp")
    assert hasattr(as_written("/instruments/controller")[0], "n_wej")


def test_every_message_of_an_old_bag_says_what_it_said():
    bag = Bag(BEFORE)
    assert not [topic for topic in bag.types if topic.startswith("/alfa46/")]
    pairs = {"/alfa46/command": "/controller/command", "/alfa46/events": "/controller/events"}
    for before in (
        "/alfa46/command",
        "/alfa46/events",
        "/instruments/controller",
        "/motor/state",
        "/gearbox/state",
        "/rig/state",
        "/rig/run_info",
        "/instruments/hmg4000",
        "/instruments/channels",
        "/clutch_s1/p1",
    ):
        old, new = as_written(before), [message for _, message in bag.messages(pairs.get(before, before))]
        assert len(old) == len(new) > 0
        for one, other in zip(old[::7], new[::7]):
            assert (other.header.stamp.sec, other.header.stamp.nanosec, other.header.frame_id) == (
                one.stamp.sec,
                one.stamp.nanosec,
                "",
            )
            for name in {name for name in vars(one) if name.islower()} - OLD_NAMES:
                assert np.array_equal(getattr(one, name), getattr(other, name)), f"{before}.{name}"
            if before == "/instruments/controller":
                assert other.measured.tolist() == [one.n_wej, one.n_wyj, one.p1, one.p2]
            if before == "/gearbox/state":
                was, today = (one.w_wej, one.w_wyj, one.m_wej, one.m_wyj), ("speed_in", "speed_out", "torque_in", "torque_out")
                assert was == tuple(getattr(other, name) for name in today)


def test_an_old_bag_has_todays_types_so_that_it_can_be_replayed_and_compared():
    bag = Bag(BEFORE)
    with OpenedBags([BEFORE]) as index:
        for topic, ros_type in bag.types.items():
            encoding, text, _ = index.channel(topic)
            assert encoding == "cdr/ros2msg" and installed(ros_type).text.split() and bag.channel(topic)[1] == text
            assert [name for name, _ in cdr_fields(ros_type, text)] == [name for name, _ in installed(ros_type).tree.fields]
        for _, (topic, data) in index.timeline(["/controller/command", "/instruments/controller"]):
            message = cdr.decode(bag.types[topic], data)
            assert len(message.duty if topic == "/controller/command" else message.current) == 3
    time, setpoint = bag.series(load_rig("hydmag").catalogue.signal("I_set_zr_p1"))
    assert setpoint.max() > 0.3 and len(time) == len(as_written("/alfa46/command"))


def cdr_fields(ros_type, text):
    from rig_nodes.bags.definitions import parse

    return parse(ros_type, text).tree.fields


def test_a_users_message_with_a_frame_is_read_like_one_without(tmp_path):
    """The fields behind a frame_id have another place; messages of PlotJuggler and other programs have one."""
    ros_type = "rig_msgs/msg/ValveCommand"
    own = [cdr.encoder(ros_type).encode(10**6 * k, k, k, 1, True, 1, 0, (0.0,) * 3, (0.1 * k, 0.2, 0.0)) for k in range(4)]
    message = cdr.decode(ros_type, own[2])
    message.header.frame_id = "gearbox"
    own[2] = cdr.encode_any(ros_type, message)
    with BagWriter(tmp_path / "run", "run") as writer:
        for k, data in enumerate(own):
            writer.write("/controller/command", ros_type, data, 10**6 * k)
    bag = Bag(tmp_path / "run")
    time, setpoint = bag.series(load_rig("hydmag").catalogue.signal("I_set_zr_p1"))
    assert time.tolist() == pytest.approx([0.0, 0.001, 0.002, 0.003]) and setpoint == pytest.approx([0.0, 0.1, 0.2, 0.3])
    assert bag.gaps() == {} and [m.header.frame_id for _, m in bag.messages("/controller/command")] == ["", "", "gearbox", ""]


def test_fields_are_taken_from_messages_of_any_length():
    ros_type, fields = "rig_msgs/msg/ControllerSample", cdr.Fields("rig_msgs/msg/ControllerSample")
    for current, measured in (((1.0,), (2.0, 3.0)), ((1.0, 2.0), (3.0,)), ((), ()), ((0.5,) * 9, (0.25,) * 40)):
        data = cdr.encoder(ros_type).encode(5, 6, 7, current, measured)
        record = fields.of(data)
        assert (int(record["seq"]), int(record["sample"])) == (6, 7)
        assert (tuple(record["current"]), tuple(record["measured"])) == (current, measured)
        assert data == cdr.encode_any(ros_type, cdr.decode(ros_type, data))
    for length in range(len(data)):
        with pytest.raises(ValueError):
            fields.of(data[:length])
