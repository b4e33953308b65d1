# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A small run with every kind of message, written through the public writer."""

import sys
from pathlib import Path

import numpy as np
import pytest

from rig_nodes.bags.cdr import encode_any, encoder
from rig_nodes.bags.writer import BagWriter
from rig_nodes.rig.configuration import load_rig

CATALOGUE = load_rig("hydmag").catalogue

sys.path.insert(0, str(Path(__file__).parent))  # for crafted.py

ROWS = 50
STATES = {
    "MotorState": (157.0, 158.0, 80.0, 1200.0, True),
    "GearboxState": (1, 157.0, 74.0, 80.0, 160.0, 1.0, 2.0, 30.0),
    "ClutchState": (2, 81.0, 0.5, 300.0, 350.0, 0.0, 4000.0, 2.0e6, 0.002, 15.0),
    "ValveState": (0.4, 0.5, 1.0e-4, 2.0e-5, 2.0e6, 0.001, False),
    "OilState": (4.0e6, 4.0e6, 1.0e-5, 50.0, True),
    "LoadState": (80.0, 120.0, 5.0e6, 6.0e6, 900.0),
}


def _messages(seconds, start_seq):
    """Returns (topic, time [ns], bytes) of a run of that length [s]: the catalogue's topics at their rates."""
    topics = CATALOGUE.topics
    seqs = dict(start_seq)
    noise = np.random.default_rng(7)

    def one(topic, ns, *values):
        seq = seqs.get(topic, 0)
        seqs[topic] = seq + 1
        return topic, ns, encoder(topics[topic].ros_type).encode(ns, seq, *values)

    columns = CATALOGUE.logger_channels()
    yield one("/rig/run_info", 0, '{"seed": 7, "rig": "hydmag"}')
    yield one(
        "/instruments/controller_record",
        0,
        "0123456789abcdef",
        ["a", "b", "c"],
        ["", "", ""],
        list("wxyz"),
        ["1"] * 4,
        [0, 1],
        ["neutral", "I"],
    )
    yield one("/instruments/channels", 0, [c.name for c in columns], [c.unit for c in columns], 1.0e-4)
    for ms in range(round(seconds * 1000)):
        ns = ms * 1_000_000
        yield one("/instruments/controller", ns, ms, (0.1, 0.2, 0.0), (157.0, 74.0, 2.0e6, float(ms)))
        yield one("/controller/command", ns, ms, 1, ms % 2 == 1, 0, 0, (0.1, 0.2, 0.3), (0.4, ms * 1e-3, 0.6))
        if ms % 5 == 0:
            block = np.arange(ms * 10, ms * 10 + ROWS)[:, None] + np.arange(len(columns)) * 0.1
            yield one("/instruments/hmg4000", ns, ms * 10, 1.0e-4, ROWS, len(columns), block)
            yield one("/rig/state", ns, 2, "", False, ms // 5, 0, ms * 0.5)
            for name, topic in topics.items():
                if topic.type in STATES:
                    yield one(name, ns, *STATES[topic.type])
        if ms % 10 == 0:
            for name, topic in topics.items():
                if topic.type == "Measurement":
                    yield one(name, ns, float(noise.normal()))
            yield (
                "/instruments/joint_states",
                ns,
                encode_any(
                    "sensor_msgs/msg/JointState",
                    {
                        "header": {"stamp": ns, "frame_id": "rig"},
                        "name": ["w0", "wk"],
                        "position": [],
                        "velocity": [157.0, 74.0],
                        "effort": [],
                    },
                ),
            )
        if ms == 120:
            yield one("/controller/events", ns, "shift_ordered", "Gear I to gear II ordered.", 2.0)
            yield one("/sequencer/events", ns, "step", "Step 3: shift.", 3.0)


@pytest.fixture(scope="session")
def messages():
    """messages(seconds, start_seq={}) -> list of (topic, time [ns], bytes) of a small run."""
    return lambda seconds, start_seq=(): list(_messages(seconds, start_seq))


@pytest.fixture(scope="session")
def write_run(messages):
    """write_run(folder, seconds=0.35, drop=None) writes it; ``drop(topic, number)`` keeps a message out."""

    def write(folder, seconds=0.35, drop=None):
        topics, numbers = CATALOGUE.topics, {}
        with BagWriter(folder, "run") as writer:
            for topic, ns, data in messages(seconds):
                number = numbers[topic] = numbers.get(topic, -1) + 1
                if drop is None or not drop(topic, number):
                    writer.write(topic, topics[topic].ros_type, data, ns)
        return writer

    return write


@pytest.fixture(scope="session")
def run(write_run, tmp_path_factory):
    """Folder of one finished small run, which tests must not change."""
    folder = tmp_path_factory.mktemp("run")
    write_run(folder)
    return folder
