"""Bags made to break a reader: each gets one sentence, soon and without much memory, from every reader."""

import json
import subprocess
import sys
from pathlib import Path

import crafted
import pytest

LONGEST, MOST = 2.0, 300.0  # s of the processor, MB of the whole process


@pytest.fixture(scope="module")
def tried(tmp_path_factory):
    """For each crafted bag the words that are expected and what each reader said, how long and how much it took."""
    folder = tmp_path_factory.mktemp("crafted")
    words = {}
    for number, (what, make) in enumerate(crafted.BAGS.items()):
        data, words[what] = make()
        (folder / str(number)).mkdir()
        (folder / str(number) / "bag.mcap").write_bytes(data)
        del data
    done = subprocess.run([sys.executable, "-P", str(Path(__file__).with_name("crafted.py")), str(folder)],
                          capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr[-2000:]
    lines = done.stdout.splitlines()
    assert len(lines) == len(crafted.BAGS) >= 30
    return {what: (words[what], json.loads(line)) for what, line in zip(crafted.BAGS, lines)}


@pytest.mark.parametrize("what", crafted.BAGS)
def test_a_crafted_bag_is_refused_in_one_sentence(tried, what):
    words, readers = tried[what]
    assert words in readers["Bag"]["said"]
    for name, found in readers.items():
        said = found["said"]
        assert "TRACEBACK" not in said and "Traceback" not in said and "\n" not in said, (name, said)
        assert len(said) < 1000, name
        assert found["s"] < LONGEST, (name, found["s"])
        assert found["mb"] < MOST, (name, found["mb"])
