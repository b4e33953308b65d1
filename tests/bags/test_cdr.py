# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The encoder against two independent implementations, and its refusals."""

import importlib
import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from ament_index_python.packages import get_package_share_directory
from rclpy.serialization import deserialize_message
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from rig_nodes.bags.cdr import decode, encode_any, encoder, exact, stamp, stamp_and_seq
from rig_nodes.bags.definitions import installed
from rig_nodes.base.errors import RigError

SHARE = Path(get_package_share_directory("rig_msgs")) / "msg"
# types in bags; the messages of a controller's handshake, Controller*, have no stamp and are not recorded
HANDSHAKE = {f"Controller{name}" for name in ("Start", "Ready", "Step", "Answer")}
RIG_TYPES = sorted(f"rig_msgs/msg/{path.stem}" for path in SHARE.glob("*.msg") if path.stem not in HANDSHAKE)
TEXTS = ["", "x", "ab", "abc", "Sprzęgło S1 zamknięte", "four"]


def get_message(ros_type):
    """Returns the generated message class of a type."""
    package, _, name = ros_type.split("/")
    return getattr(importlib.import_module(f"{package}.msg"), name)


@pytest.fixture(scope="module")
def reference():
    """Rosbags' own type store with the rig's messages added to its standard types."""
    store = get_typestore(Stores.ROS2_JAZZY)
    types = {}
    for path in SHARE.glob("*.msg"):
        types.update(get_types_from_msg(path.read_text(), f"rig_msgs/msg/{path.stem}"))
    store.register(types)
    return store


def sample(node, rng):
    """Returns a random value for a field; sequences and strings have every length modulo the alignment."""
    if node.kind == "string":
        return TEXTS[rng.integers(len(TEXTS))]
    if node.kind == "number":
        if node.name == "bool":
            return bool(rng.integers(2))
        if node.name.startswith("float"):
            return float(rng.normal() * 1e3)
        limits = np.iinfo(node.name)
        return int(rng.integers(limits.min, limits.max, dtype=node.name, endpoint=True))
    count = node.count if node.kind == "array" else int(rng.integers(0, 5))
    values = [sample(node.item, rng) for _ in range(count)]
    return values if node.item.kind == "string" else np.array(values, dtype=node.item.name)


@pytest.mark.parametrize("ros_type", RIG_TYPES)
def test_bytes_equal_rosbags_and_rclpy_reads_them(ros_type, reference):
    rng = np.random.default_rng(3)
    fields = installed(ros_type).tree.fields[2:]
    time = reference.types["builtin_interfaces/msg/Time"]
    for _ in range(20):
        ns, seq = int(rng.integers(0, 2**60)), int(rng.integers(0, 2**64, dtype=np.uint64))
        values = [sample(node, rng) for _, node in fields]
        data = encoder(ros_type).encode(ns, seq, *values)
        head = reference.types["std_msgs/msg/Header"](time(sec=ns // 10**9, nanosec=ns % 10**9), "")
        other = reference.types[ros_type](head, seq, *values)
        assert data == bytes(reference.serialize_cdr(other, ros_type, little_endian=True))
        assert stamp_and_seq(data) == (ns, seq)
        ours, theirs = decode(ros_type, data), deserialize_message(data, get_message(ros_type))
        assert theirs.header.stamp.sec * 10**9 + theirs.header.stamp.nanosec == ns
        for (name, _), value in zip(fields, values):
            np.testing.assert_array_equal(getattr(theirs, name), value)
            np.testing.assert_array_equal(getattr(ours, name), value)


def varied(node, count, rng):
    """Returns random values of a field in some messages: an array of numbers or of lists of the same length, or the same text."""
    first = sample(node, rng)
    if node.kind == "number":
        return np.array([sample(node, rng) for _ in range(count)], node.name)
    if node.kind == "string" or node.item.kind == "string":
        return first
    return np.array([[sample(node.item, rng) for _ in first] for _ in range(count)], node.item.name).reshape(count, len(first))


@pytest.mark.parametrize("ros_type", RIG_TYPES)
def test_a_block_holds_the_bytes_of_its_messages(ros_type):
    rng, count = np.random.default_rng(5), 4
    for _ in range(5):
        fields = [node for _, node in installed(ros_type).tree.fields[2:]]
        values = [varied(node, count, rng) for node in fields]
        texts = [k for k, node in enumerate(fields) if node.kind == "sequence" and node.item.kind == "string"]
        for k in range(min(texts, default=len(fields)), len(fields)):  # behind a list of texts all messages are the same
            values[k] = values[k][0].tolist() if isinstance(values[k], np.ndarray) else values[k]
        stamps, seqs = rng.integers(0, 2**60, count), rng.integers(0, 2**62, count)
        each = [
            encoder(ros_type).encode(ns, seq, *(value[k] if isinstance(value, np.ndarray) else value for value in values))
            for k, (ns, seq) in enumerate(zip(stamps.tolist(), seqs.tolist()))
        ]
        assert [row.tobytes() for row in encoder(ros_type).encode_block(stamps, seqs, *values)] == each


def test_blocks_with_texts_of_as_many_letters_and_other_bytes():
    name, stamps = "rig_msgs/msg/RigState", np.arange(3)
    for text in ("dddddd", "ddddd°"):
        block = encoder(name).encode_block(stamps, stamps, 1, text, False, stamps, 0, 0.5)
        assert [decode(name, row.tobytes()).reason for row in block] == [text] * 3


@pytest.mark.parametrize("lists", [([], [], []), ([1.0], [], [2.0, 3.0]), ([1.0, 2.0], [3.0], [])])
@pytest.mark.parametrize("frame", ["", "rig", "output"])
def test_standard_messages_equal_rosbags_and_rclpy_reads_them(lists, frame, reference):
    name = "sensor_msgs/msg/JointState"
    position, velocity, effort = lists
    data = encode_any(
        name,
        {
            "header": {"stamp": 1_500_000_000, "frame_id": frame},
            "name": ["w0", "output"],
            "position": position,
            "velocity": velocity,
            "effort": effort,
        },
    )
    types = reference.types
    header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](1, 500_000_000), frame)
    other = types[name](header, ["w0", "output"], *(np.array(x, dtype=float) for x in lists))
    assert data == bytes(reference.serialize_cdr(other, name, little_endian=True))
    assert data == encode_any(name, other)
    message = deserialize_message(data, get_message(name))
    assert (message.header.frame_id, list(message.name)) == (frame, ["w0", "output"])
    assert (list(message.position), list(message.velocity), list(message.effort)) == lists
    assert data == encode_any(name, message)
    assert stamp(data) == 1_500_000_000


@pytest.mark.parametrize("ros_type", RIG_TYPES)
def test_type_hash_is_the_one_ros_installed(ros_type):
    described = json.loads((SHARE / f"{ros_type.split('/')[-1]}.json").read_text())
    hashes = {entry["type_name"]: entry["hash_string"] for entry in described["type_hashes"]}
    assert installed(ros_type).type_hash == hashes[ros_type]


def test_whole_numbers_and_numpy_scalars_arrive_as_the_number_they_are():
    # The setters of rclpy messages silently turn these into wrong values.
    name = "rig_msgs/msg/Measurement"
    for value in (3, np.float32(3.0), np.int64(3), np.float64(3.0)):
        assert decode(name, encoder(name).encode(0, 0, value)).value == 3


SETPOINT, COMMAND, STATE = (f"rig_msgs/msg/{name}" for name in ("Setpoint", "ValveCommand", "RigState"))
THREE = (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    "ros_type, stamp_ns, seq, values, error, says",
    [
        (SETPOINT, 0, 0, (1.0,), TypeError, "2 values.*value, enable.*got 1"),
        (SETPOINT, 0, 0, (1.0, True, 2.0), TypeError, "got 3"),
        (SETPOINT, 0, 0, ("fast", True), TypeError, "Setpoint.value is a number.*'fast'"),
        (SETPOINT, 0, 0, (1.0, 1), TypeError, "Setpoint.enable is a bool, got 1"),
        (SETPOINT, 0.5, 0, (1.0, True), TypeError, "Setpoint.stamp is an integer.*0.5"),
        (SETPOINT, 2**63, 0, (1.0, True), ValueError, "Setpoint.stamp"),
        (SETPOINT, 0, -1, (1.0, True), ValueError, "Setpoint.seq is a uint64.*-1"),
        (COMMAND, 0, 0, (1.5, 1, False, 0, 0, THREE, THREE), TypeError, "ValveCommand.sample is an integer.*1.5"),
        (COMMAND, 0, 0, (1, 256, False, 0, 0, THREE, THREE), ValueError, "ValveCommand.gear is a uint8.*256"),
        (COMMAND, 0, 0, (1, 1, False, 0, 0, ("a", 0.0), THREE), TypeError, "ValveCommand.duty is a list of"),
        (COMMAND, 0, 0, (1, 1, False, 0, 0, THREE, ("a",) * 3), TypeError, "ValveCommand.setpoint is a list of"),
        (STATE, 0, 0, (1, 7, False, 0, 0, 0.0), TypeError, "RigState.reason is a string, got 7"),
        (STATE, 0, 0, (1, "", False, 0.5, 0, 0.0), TypeError, "RigState.tick is an integer.*0.5"),
    ],
)
def test_wrong_values_are_refused_naming_the_field(ros_type, stamp_ns, seq, values, error, says):
    with pytest.raises(error, match=says):
        encoder(ros_type).encode(stamp_ns, seq, *values)


@pytest.mark.parametrize(
    "message, says",
    [
        ({"header": {"stamp": 0, "frame_id": ""}}, "missing: fluid_pressure, variance"),
        ({"header": {"stamp": 0, "frame_id": ""}, "fluid_pressure": 1.0, "variance": 0.0, "gauge": True}, "unknown: gauge"),
        (SimpleNamespace(fluid_pressure=1.0, variance=0.0), "without header"),
    ],
)
def test_incomplete_standard_messages_are_refused(message, says):
    with pytest.raises(TypeError, match=says):
        encode_any("sensor_msgs/msg/FluidPressure", message)


@pytest.mark.parametrize(
    "ros_type, says",
    [
        ("rig_msgs/msg/Mesurement", "package 'rig_msgs' has no message 'Mesurement'"),
        ("no_such_msgs/msg/State", "'no_such_msgs' is not installed"),
        ("Measurement", "expected package/msg/Name"),
    ],
)
def test_unknown_types_are_refused(ros_type, says):
    with pytest.raises(RigError, match=says):
        encoder(ros_type)


@pytest.mark.parametrize(
    "ros_type, values", [(SETPOINT, (1.5, True)), ("rig_msgs/msg/RunInfo", ("{}",)), (STATE, (1, "why", True, 1, 2, 3.0))]
)
def test_padding_of_the_transport_is_cut_off(ros_type, values):
    data = encoder(ros_type).encode(5, 6, *values)
    padded = data + bytes(-len(data) % 4)
    assert exact(installed(ros_type), padded) == data
    assert exact(installed(ros_type), data) == data


@pytest.mark.parametrize("data", [b"", b"\x00\x01\x00\x00", bytes(28)])
def test_bytes_that_are_no_message_are_refused(data):
    with pytest.raises(ValueError, match="bytes"):
        decode("rig_msgs/msg/Setpoint", data[:20])
    with pytest.raises(ValueError, match="CDR"):
        stamp_and_seq(data)
