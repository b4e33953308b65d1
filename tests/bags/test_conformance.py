# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""All files of MCAP's conformance set are whole, with all their messages, and copies keep these byte for byte."""

import hashlib

import conformance
import pytest

from rig_nodes.bags.copy import check, write
from rig_nodes.bags.opened import OpenedBags
from rig_nodes.bags.reader import Bag
from rig_nodes.cli.main import main

NAMES = conformance.names()


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Returns the path of each file of the set by its name."""
    folder = tmp_path_factory.mktemp("conformance")
    paths = {name: folder / f"{name}.mcap" for name in NAMES}
    for name, path in paths.items():
        path.write_bytes(conformance.built(name))
    return paths


def messages(path):
    with OpenedBags([path]) as bags:
        rows = [(time, bags.topic_of(name), *bags.channel(name), data) for time, (name, data) in bags.timeline(bags.types)]
        return rows, check(bags), bags.notes


def expected(name):
    times = sorted(log_time for _, log_time, _ in conformance.CONTENTS[name.split("-")[0]][2])
    return [(time, "example", conformance.DATA) for time in times]


def test_the_files_are_those_that_were_published(files):
    assert len(NAMES) == 416
    lines = [f"{name} {hashlib.sha256(files[name].read_bytes()).hexdigest()}\n" for name in sorted(NAMES)]
    assert hashlib.sha256("".join(lines).encode()).hexdigest() == conformance.PUBLISHED


def test_every_file_is_whole_and_every_message_is_read(files):
    for name in NAMES:
        rows, kept, notes = messages(files[name])
        assert [(time, topic, data) for time, topic, *_, data in rows] == expected(name), name
        assert kept.whole and sum(kept.counts.values()) == len(rows) and not notes, (name, kept)
        assert sum(Bag(files[name]).counts.values()) == len(rows), name


@pytest.mark.parametrize("names", [NAMES[::5], pytest.param(NAMES, marks=pytest.mark.campaign)], ids=["a fifth", "all"])
def test_a_copy_of_every_file_has_the_messages_byte_for_byte_and_the_same_description(files, tmp_path, names):
    for name in names:
        with OpenedBags([files[name]]) as bags:
            path, _ = write(bags, tmp_path / name)
        copied, kept, _ = messages(path)
        assert copied == messages(files[name])[0] and kept.whole, name


@pytest.mark.parametrize("verb", ["recover", "cut", "merge"])
@pytest.mark.parametrize(
    "name", ["OneSchemalessMessage-ch-chx-mx-rch-st-sum", "TenMessages-ch-chx-mx-pad-rch-st-sum", "TenMessages"]
)
def test_the_verbs_say_what_stays_bytes_and_what_is_not_copied(files, tmp_path, capfd, verb, name):
    assert main(["bag", verb, str(files[name]), "--out", str(tmp_path / "out")]) == 0
    said = capfd.readouterr().err
    assert "example: its messages are " in said and "they are kept as bytes" in said
    assert "times of publishing" in said and messages(tmp_path / "out")[0] == messages(files[name])[0]
    assert main(["bag", "check", str(tmp_path / "out")]) == 0


@pytest.mark.parametrize("what", ["attachment 'myFile'", "metadata record 'myMetadata'"])
def test_what_lies_beside_the_messages_is_not_copied_and_that_is_said(what, files, tmp_path, capfd):
    name = "OneAttachment-ax-st" if "attachment" in what else "OneMetadata"
    one = files["OneMessage-ch-chx-mx-rch-rsh-st"]
    assert main(["bag", "merge", str(files[name]), str(one), "--out", str(tmp_path / "out")]) == 0
    assert f"{what} is not copied" in capfd.readouterr().err
