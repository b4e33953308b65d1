# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A report from the pieces of a bag equals that of the whole bag, for all kinds of runs, lost messages and foreign recorders."""

from pathlib import Path

import numpy as np
import pytest
from mcap.writer import Writer

from rig_nodes.analysis.gathered import Thinned
from rig_nodes.analysis.of_runs import gathering
from rig_nodes.analysis.run_report import build_report
from rig_nodes.bags.opened import OpenedBags
from rig_nodes.bags.reader import Bag, Logger
from rig_nodes.bags.writer import BagWriter
from rig_nodes.base.errors import BagError
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.sequence import load_sequence
from rig_nodes.runs.simulation import simulate

SAMPLE = Path(__file__).parents[2] / "bags" / "sample"
LOGGER = "/instruments/hmg4000"
RUN = {"end": {"reason": "the run left no report"}}


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Folder of each run, by its special property."""
    root = tmp_path_factory.mktemp("runs")

    def written(name, keep):
        bag = Bag(SAMPLE)
        with BagWriter(root / name, "run") as writer:
            for number, (time, topic, data) in enumerate(bag.timeline()):
                if keep(topic, number, time / 1e9):
                    writer.write(topic, bag.types[topic], data, time)
        return root / name

    def by_another(name):
        """Log times of the wall clock, chunks of 100 kB, the beginning not recorded."""
        bag, channels = Bag(SAMPLE), {}
        (root / name).mkdir()
        with open(root / name / "run_0.mcap", "wb") as file:
            writer = Writer(file, chunk_size=100_000)
            writer.start("ros2", "another")
            for time, topic, data in bag.timeline():
                if time < 300_000_000 and topic not in ("/rig/run_info", "/instruments/channels", "/controller/events"):
                    continue
                if topic not in channels:
                    encoding, text, _ = bag.channel(topic)
                    schema = writer.register_schema(bag.types[topic], "ros2msg", text.encode())
                    channels[topic] = writer.register_channel(topic, encoding.partition("/")[0], schema)
                writer.add_message(channels[topic], time + 10**18, data, time + 10**18)
            writer.finish()
        return root / name

    simulate(load_rig("hydmag"), load_sequence("engagement"), root / "no change of gear")
    return {
        "a shift": SAMPLE,
        "no change of gear": root / "no change of gear",
        "lost rows": written("lost", lambda topic, number, t: not (topic == LOGGER and 1.0 < t < 1.2)),
        "lost messages": written("lossy", lambda topic, number, t: number % 97 or topic == LOGGER),
        "ends in the shift": written("short", lambda topic, number, t: t < 1.5),
        "no rows": written("rowless", lambda topic, number, t: topic != LOGGER),
        "no energies": written("balanceless", lambda topic, number, t: topic != "/motor/state"),
        "by another recorder": by_another("another"),
    }


SMALL = ["/rig/run_info", "/controller/events", "/sequencer/events", "/rig/events", "/instruments/channels"]


def in_pieces(folder, size, topics=SMALL):
    with OpenedBags([folder]) as index:
        small = index.bag(topics)
    gathered = gathering(folder, small, RUN)
    for piece in Bag.pieces(folder, size):
        gathered.add(piece)
    return gathered


CASES = [
    "a shift",
    "no change of gear",
    "lost rows",
    "lost messages",
    "ends in the shift",
    "no rows",
    "no energies",
    "by another recorder",
]


@pytest.mark.parametrize("case", CASES)
def test_the_report_of_the_pieces_is_that_of_the_whole(runs, case):
    folder = runs[case]
    whole = build_report(Bag(folder), RUN)
    assert build_report(in_pieces(folder, 200_000), RUN) == whole
    assert bool(whole["run"].get("problems")) == case.startswith("no ") - (case == "no change of gear")
    assert (whole["run"]["lost"] > 0) == case.startswith("lost")


def test_rows_that_come_again_in_a_later_piece_are_refused(runs):
    gathered = in_pieces(runs["a shift"], 200_000)
    gathered.add(next(Bag.pieces(runs["a shift"], 200_000)))
    with pytest.raises(BagError, match=f"blocks of {LOGGER} overlap or are out of order"):
        gathered.shifts()


def test_rows_far_behind_the_end_of_a_run_are_refused_also_where_only_every_nth_is_kept():
    thinned, logger = Thinned(10.0, 1000), Logger(0.0, 1e-3, {"p1": np.zeros(10)})
    thinned.add(0, logger)
    with pytest.raises(BagError, match=f"a block begins with row {2**60}, far behind the end of the run"):
        thinned.add(2**60, logger)


def test_a_garbled_message_of_one_topic_hides_no_fault_of_those_behind_it(tmp_path):
    """Its own numbers are not known, and no number of lost messages can be given."""
    bag = Bag(SAMPLE)
    rows = [row for row in bag.timeline() if row[1] in ("/motor/state", "/load_pump/state", "/rig/run_info")]
    rows[60] = (rows[60][0], "/motor/state", b"\0\1\0\0short")
    rows += [row for row in rows if row[1] == "/load_pump/state"][:3]  # there twice
    with open(tmp_path / "run_0.mcap", "wb") as file:
        writer, channels = Writer(file), {}
        writer.start("ros2", "another")
        for topic in ("/motor/state", "/load_pump/state", "/rig/run_info"):
            schema = writer.register_schema(bag.types[topic], "ros2msg", bag.channel(topic)[1].encode())
            channels[topic] = writer.register_channel(topic, "cdr", schema)
        for time, topic, data in rows:
            writer.add_message(channels[topic], time, data, time)
        writer.finish()
    gathered = in_pieces(tmp_path, 200_000, ["/rig/run_info"])
    assert any(one.startswith("/load_pump/state: 3 of ") for one in gathered.disorder())
    assert not any("/motor/state" in one for one in gathered.disorder())
    with pytest.raises(BagError, match="a message of /motor/state "):
        gathered.gaps()
