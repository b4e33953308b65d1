# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A bag that ends before its run, and one whose messages are not as they were sent, are called so by every verb."""

import json
import struct
from pathlib import Path

import crafted
import pytest
from mcap.writer import Writer

from rig_nodes.bags.pieces import files_of_run
from rig_nodes.bags.reader import Bag
from rig_nodes.bags.run_end import RECORD_NAME
from rig_nodes.bags.writer import LIBRARY, LIBRARY_OF_RUN, BagWriter, Layout
from rig_nodes.cli.main import main
from rig_nodes.rig.configuration import load_rig

from ..dated import DATE

SAMPLE = Path(__file__).parents[2] / "bags" / "sample"
LOGGER = "/instruments/hmg4000"
END = {"state": "ended", "reason": "the sequence ended"}
CUT_OFF = "the run was cut off at 1.290 s: the bag holds no record of its end"


@pytest.fixture(scope="module")
def sample():
    return Bag(SAMPLE)


@pytest.fixture(scope="module")
def rewritten(sample, tmp_path_factory):
    """rewritten(name, rows, library, end) -> folder of a bag with these messages, as a program of others writes it."""
    root = tmp_path_factory.mktemp("rewritten")

    def write(name, rows, library=LIBRARY_OF_RUN, end=END):
        folder = root / name
        if not folder.exists():
            folder.mkdir()
            with open(folder / "run_0.mcap", "wb") as file:
                writer = Writer(file)
                writer.start("ros2", library)
                numbers = {}
                for topic, kind in sample.types.items():
                    _, text, about = sample.channel(topic)
                    numbers[topic] = writer.register_channel(
                        topic, "cdr", writer.register_schema(kind, "ros2msg", text.encode()), about
                    )
                for time, topic, data in rows:
                    writer.add_message(numbers[topic], time, data, time)
                if end:
                    writer.add_metadata(RECORD_NAME, end)
                writer.finish()
        return folder

    return write


@pytest.fixture(scope="module")
def half(sample, rewritten):
    rows = sample.timeline()
    return rewritten("half", rows[: len(rows) // 2], end=None)


def rig(capfd, *arguments):
    code = main([*map(str, arguments)])
    captured = capfd.readouterr()
    return code, captured.out, captured.err


@pytest.mark.parametrize(
    "verb",
    [
        ["bag", "check"],
        ["bag", "info"],
        ["report"],
        ["view", "--no-open"],
        ["compare", SAMPLE],
        ["rerun", "--through", "plant", "--out", "again"],
        ["calculate", "survival", "--rig", "hydmag_engine", "--run"],
    ],
    ids=lambda verb: " ".join(map(str, verb[:2])),
)
def test_a_bag_without_the_end_of_its_run_is_called_cut_off(verb, half, capfd, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, out, err = rig(capfd, *verb, half)
    assert code == 3 and CUT_OFF in err, err
    assert "whole" not in out
    if verb == ["report"]:
        assert f"end: {CUT_OFF}" in out
        assert json.loads((half / "report.json").read_text())["run"]["end"] == {"state": "cut off", "reason": CUT_OFF}


@pytest.mark.parametrize(
    "verb, expected",
    [
        (["bag", "check"], 3),
        (["bag", "info"], 3),
        (["view", "--no-open"], 3),
        (["report"], 1),
        (["compare", SAMPLE], 2),
        (["calculate", "survival", "--rig", "hydmag_engine", "--run"], 3),
    ],
)
def test_a_file_that_ends_in_the_middle_is_no_good_bag_for_any_verb(verb, expected, tmp_path, capfd):
    data = (SAMPLE / "sample_0.mcap").read_bytes()
    (tmp_path / "sample_0.mcap").write_bytes(data[: len(data) // 2])
    code, out, err = rig(capfd, *verb, tmp_path)
    assert code == expected and ("is cut" in out + err or "ends" in out + err), out + err


def test_the_end_that_a_bag_records_is_that_of_its_report(half, sample, rewritten, capfd):
    failed = {"state": "failed", "reason": "alfa46 killed by signal 9 (SIGKILL)"}
    rows = sample.timeline()
    folder = rewritten("failed", rows[: len(rows) // 2], end=failed)
    assert rig(capfd, "bag", "check", folder)[0] == 0
    assert "; failed: alfa46 killed by signal 9 (SIGKILL)" in rig(capfd, "bag", "info", folder)[1]
    code, out, _ = rig(capfd, "report", folder)
    assert code == 0 and "end: alfa46 killed by signal 9 (SIGKILL)" in out


def test_of_a_bag_whose_log_times_are_dates_the_time_of_the_run_is_told(sample, rewritten, capfd):
    rows = [(DATE + time, topic, data) for time, topic, data in sample.timeline()]
    dated = rewritten("dated", rows[: len(rows) // 2], "libmcap 1.3.1", None)
    for verb in (["bag", "check"], ["report"]):
        code, _, err = rig(capfd, *verb, dated)
        assert code == 3 and CUT_OFF in err, err


@pytest.mark.parametrize("library", [LIBRARY, "python mcap 1.6.0"])
def test_without_a_record_the_events_of_the_sequence_show_the_end(library, sample, rewritten, capfd):
    rows = sample.timeline()
    whole = rewritten(f"whole {library}", rows, library, None)
    assert rig(capfd, "bag", "check", whole)[::2] == (0, "")
    code, _, err = rig(capfd, "bag", "check", rewritten(f"half {library}", rows[: len(rows) // 2], library, None))
    assert code == 3 and CUT_OFF in err


@pytest.mark.parametrize("damaged", [False, True])
def test_a_copy_of_a_whole_bag_ends_as_its_run_did(damaged, half, rewritten, sample, tmp_path, capfd):
    source, copy = half, tmp_path / "copy"
    if damaged:
        source = tmp_path / "damaged.mcap"
        source.write_bytes((SAMPLE / "sample_0.mcap").read_bytes()[:-100_000])
    assert rig(capfd, "bag", "recover", source, "--out", copy)[0] == 3
    code, out, err = rig(capfd, "bag", "check", copy)
    assert code == 3 and "cut off, " in out and "the run was cut off at " in err
    code, out, _ = rig(capfd, "report", copy)
    assert code == 3 and "end: the run was cut off at " in out
    failed = {"state": "failed", "reason": "interrupted by Ctrl-C"}
    ended = rewritten("interrupted", sample.timeline()[:9000], end=failed)
    assert rig(capfd, "bag", "merge", ended, "--out", tmp_path / "ended")[0] == 0
    assert "end: interrupted by Ctrl-C" in rig(capfd, "report", tmp_path / "ended")[1]


def test_parts_of_runs_and_bags_of_no_rig_are_not_cut_off(half, sample, tmp_path, capfd):
    assert rig(capfd, "bag", "cut", SAMPLE, "--to", 1, "--out", tmp_path / "part")[0] == 0
    assert rig(capfd, "bag", "check", tmp_path / "part")[::2] == (0, "")
    (tmp_path / "foreign.mcap").write_bytes(crafted.one())
    assert rig(capfd, "bag", "check", tmp_path / "foreign.mcap")[::2] == (0, "")
    with BagWriter(tmp_path / "late", "late", library="libmcap 1.4") as late:  # another recorder that came in the middle
        for time, topic, data in Bag(half).timeline():
            if time > 500_000_000 or topic == "/rig/run_info":
                late.write(topic, sample.types[topic], data, time)
    assert rig(capfd, "bag", "info", tmp_path / "late")[0] == 0


def test_the_last_of_several_files_has_the_end_and_without_it_the_rest_is_cut_off(sample, tmp_path, capfd):
    with BagWriter(tmp_path / "run", "run", library=LIBRARY_OF_RUN, layout=Layout(length=500_000_000)) as writer:
        for time, topic, data in sample.timeline():
            writer.write(topic, sample.types[topic], data, time)
        writer.end(**END)
    assert rig(capfd, "bag", "check", tmp_path / "run")[::2] == (0, "")
    *_, last = files_of_run(tmp_path / "run")
    last.unlink()
    assert rig(capfd, "bag", "check", tmp_path / "run")[0] == 3, "metadata.yaml lists the file"
    (tmp_path / "run" / "metadata.yaml").unlink()
    code, _, err = rig(capfd, "bag", "check", tmp_path / "run")
    assert code == 3 and "the run was cut off at" in err


def test_a_run_by_hand_whose_end_nobody_recorded_was_cut_off(messages, tmp_path, capfd):
    topics = load_rig("hydmag").catalogue.topics
    for end in ({}, {"state": "ended", "reason": "ended by hand"}):
        folder = tmp_path / f"run {len(end)}"
        with BagWriter(folder, "run", library=LIBRARY_OF_RUN) as writer:
            for topic, ns, data in messages(0.05):
                writer.write(topic, topics[topic].ros_type, data, ns)
            if end:
                writer.end(**end)
        assert rig(capfd, "bag", "check", folder)[0] == (0 if end else 3)


def with_head(sample, row, field="rows", form="<I", value=7):
    """Returns the message of a row with another value in the head of a block."""
    time, topic, data = row
    if topic != LOGGER:
        return row
    leaf = next(leaf for leaf in sample._definition(sample._stream(topic)).leaves if leaf.path == field)
    changed = bytearray(data)
    struct.pack_into(form, changed, 4 + leaf.offset, value)
    return time, topic, bytes(changed)


def with_one_head(sample, rows, *change):
    """Returns the rows with a change in the head of the hundredth block."""
    place = [place for place, row in enumerate(rows) if row[1] == LOGGER][100]
    return [*rows[:place], with_head(sample, rows[place], *change), *rows[place + 1 :]]


DISORDER = {
    "doubled": (lambda sample, rows: rows + rows, f"{LOGGER}: 517 of 1034 messages are there twice"),
    "each twice": (lambda sample, rows: [row for row in rows for _ in (0, 1)], f"{LOGGER}: 517 of 1034 messages are there twice"),
    "reversed": (lambda sample, rows: rows[::-1], f"{LOGGER}: 516 of 517 messages come behind later ones"),
    "two exchanged": (
        lambda sample, rows: [*rows[:5000], *rows[7000:9000], *rows[5000:7000], *rows[9000:]],
        "/motor/state: 1 of 518 messages come behind later ones",
    ),
    "false row counts": (
        lambda sample, rows: [with_head(sample, row) for row in rows],
        f"a block of {LOGGER} does not hold the 63 values that its head says",
    ),
    "a false first row": (
        lambda sample, rows: with_one_head(sample, rows, "first_sample", "<Q", 5007),
        f"{LOGGER}: a block begins with row 5007, not with 5000 as the one before it says",
    ),
    "a row number of 2^62": (
        lambda sample, rows: with_one_head(sample, rows, "first_sample", "<Q", 2**62),
        f"{LOGGER}: a block begins with row 4611686018427387904, not with 5000 as the one before it says",
    ),
    "another period of row 100": (
        lambda sample, rows: with_one_head(sample, rows, "period", "<d", 2e-4),
        f"{LOGGER}: the period is not one and the same above 0 in all its blocks",
    ),
    "no period in any row": (
        lambda sample, rows: [with_head(sample, row, "period", "<d", 0.0) for row in rows],
        f"{LOGGER}: the period is not one and the same above 0 in all its blocks",
    ),
}


LIKE_ANOTHER = ("each twice", "a row number of 2^62", "no period in any row")


@pytest.mark.parametrize(
    "what", [pytest.param(what, marks=[pytest.mark.campaign] if what in LIKE_ANOTHER else []) for what in DISORDER]
)
def test_messages_that_are_not_as_they_were_sent_are_named(what, sample, rewritten, capfd):
    change, words = DISORDER[what]
    folder = rewritten(what, change(sample, sample.timeline()))
    faults = Bag(folder).check()
    code, _, err = rig(capfd, "bag", "check", folder)
    assert code == 3 and "none is lost" in err
    assert any(words in fault for fault in [*faults, err]), (faults, err)
    code, out, err = rig(capfd, "report", folder)
    assert code == 3 and "problem: " in out
    assert (words if "row" in what else "not as they were sent") in out + err
    assert "1: I -> II" in out or "no shift metrics" in out, "a shift never vanishes without a word"


@pytest.mark.parametrize("what", ["doubled", pytest.param("each twice", marks=pytest.mark.campaign), "reversed", "two exchanged"])
def test_recovery_writes_them_as_they_were_sent(what, sample, rewritten, tmp_path, capfd):
    folder = rewritten(what, DISORDER[what][0](sample, sample.timeline()))
    code, _, err = rig(capfd, "bag", "recover", folder, "--out", tmp_path / "saved")
    assert code == 0 and ("13995 messages that were there twice are written once" in err) == (what in ("doubled", "each twice"))
    assert Bag(tmp_path / "saved").canonical_hash() == sample.canonical_hash()
    assert rig(capfd, "bag", "check", tmp_path / "saved")[0] == 0
