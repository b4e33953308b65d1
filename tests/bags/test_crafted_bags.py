# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bags with faults: every reader refuses each of them in one sentence, soon and without much memory."""

import json
import random
import subprocess
import sys
from pathlib import Path

import crafted
import pytest

from rig_nodes.bags.reader import Bag
from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import main

LONGEST, MOST = 4.0, 200.0  # s of processor time, twice that of the worst bag on an idle machine; MB that reading the bag adds


@pytest.fixture(scope="module")
def tried(tmp_path_factory):
    """Returns for each crafted bag the expected words, and what each reader printed, how long it took and how much memory."""
    folder = tmp_path_factory.mktemp("crafted")
    words = {}
    for number, (what, make) in enumerate(crafted.BAGS.items()):
        data, words[what] = make()
        (folder / str(number)).mkdir()
        (folder / str(number) / "bag.mcap").write_bytes(data)
        del data
    done = subprocess.run(
        [sys.executable, "-P", str(Path(__file__).with_name("crafted.py")), str(folder)],
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    lines = done.stdout.splitlines()
    assert len(lines) == len(crafted.BAGS) >= 30
    return {what: (words[what], json.loads(line)) for what, line in zip(crafted.BAGS, lines)}


@pytest.mark.parametrize("what", crafted.BAGS)
def test_a_crafted_bag_is_refused_in_one_sentence(tried, what):
    words, readers = tried[what]
    assert words in readers["Bag"]["text"]
    for name, found in readers.items():
        text = found["text"]
        assert "TRACEBACK" not in text and "Traceback" not in text and "\n" not in text, (name, text)
        assert len(text) < 1000, name
        assert found["s"] < LONGEST, (name, found["s"])
        assert found["mb"] < MOST, (name, found["mb"])


ESCAPES = "\x1b]0;title\x07\x9b31m\u202e"


@pytest.mark.parametrize("verb, options", [("report", ()), ("view", ("--no-open",)), ("replay", ("--topics", "/nothing"))])
def test_what_a_terminal_would_obey_is_shown_and_not_sent(tmp_path, capfd, verb, options):
    (tmp_path / "bag.mcap").write_bytes(
        crafted.file(
            crafted.chunk(
                crafted.schema(name="rig_msgs/msg/RunInfo" if verb != "replay" else "a/msg/B")
                + crafted.channel(topic=f"/{ESCAPES}")
                + crafted.message()
            )
        )
    )
    assert main([verb, str(tmp_path), *options]) == 2
    output = "".join(capfd.readouterr())
    assert "\\u001b]0;title" in output and output.replace("\n", "").isprintable() and output.count("\n") == 1


def test_any_flip_or_cut_of_a_bag_without_checksums_is_read_or_refused(tmp_path, write_run):
    """With checksums every flip is noticed; without them a flipped byte reaches the decoders."""
    rng = random.Random(4)
    write_run(tmp_path / "run", seconds=0.02)
    bag = Bag(tmp_path / "run")
    numbers = {topic: number for number, topic in enumerate(bag.types, 1)}
    head = b"".join(
        crafted.schema(n, bag.types[topic], bag.channel(topic)[1]) + crafted.channel(n, topic, n) for topic, n in numbers.items()
    )
    messages = b"".join(crafted.message(data, numbers[topic], ns) for ns, topic, data in bag.timeline())
    sound = [crafted.file(head, messages), crafted.file(crafted.chunk(head + messages, last=10**10, crc=0))]
    refused, path = 0, tmp_path / "bag.mcap"
    for number in range(50):
        data = bytearray(sound[number % 2])
        if number % 5 == 0:
            del data[rng.randrange(9, len(data)) :]
        for _ in range(rng.choice((1, 3, 30)) * (number % 5 > 0)):
            data[rng.randrange(9, len(data))] = rng.randrange(256)
        path.write_bytes(data)
        for read in (crafted.read_all, crafted.index_all, lambda path: Bag(path, recover=True)):
            try:
                read(path)
            except RigError as error:
                assert "\n" not in str(error)
                refused += 1
    assert refused > 20, "nothing was hit"
