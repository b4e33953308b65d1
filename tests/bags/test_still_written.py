# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The bag of a run that goes on is not called damaged: its readers say who writes it, since when, and how to follow the run."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from rig_nodes.api import open as open_run
from rig_nodes.bags.reader import Bag
from rig_nodes.base.errors import BagError
from rig_nodes.cli.main import main

SAMPLE = next((Path(__file__).parents[2] / "bags" / "sample").glob("*.mcap"))
WRITES = "import sys; file = open(sys.argv[1], 'ab'); print('open', flush=True); sys.stdin.read()"
SAYS = (
    r"is still being written by \S+ \(process {pid}, since \d{{4}}-\d\d-\d\d \d\d:\d\d:\d\d\); read it when that has ended, "
    r"or make a bag of what it holds so far with (\./)?rig bag recover\. (\./)?rig status and (\./)?rig view --live follow"
)


@pytest.fixture
def written(tmp_path):
    """A folder with a bag that is not closed and a process that has it open for writing; and that process."""
    folder = tmp_path / "run"
    folder.mkdir()
    bag = folder / "run_0.mcap"
    bag.write_bytes(SAMPLE.read_bytes()[:200_000])
    with subprocess.Popen([sys.executable, "-c", WRITES, bag], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as writer:
        writer.stdout.readline()
        yield folder, writer


VERBS = (
    ["report"],
    ["bag", "check"],
    ["bag", "info"],
    ["bag", "hash"],
    ["compare", SAMPLE],
    ["view", "--no-open"],
    ["export", "csv"],
)


@pytest.mark.parametrize("verb", VERBS, ids=lambda verb: " ".join(map(str, verb[:2])))
def test_every_verb_says_who_writes_it(written, verb, capsys):
    folder, writer = written
    assert main([*map(str, verb), str(folder)]) in (1, 2)
    said = capsys.readouterr().err
    assert re.search(SAYS.format(pid=writer.pid), said), said
    assert "damaged" not in said and [path.name for path in folder.iterdir()] == ["run_0.mcap"], "nothing is written beside it"


def test_what_it_holds_so_far_can_be_had(written, tmp_path, capsys):
    folder, writer = written
    assert main(["bag", "recover", str(folder), "--out", str(tmp_path / "so_far")]) == 3
    assert f"(process {writer.pid}, since" in capsys.readouterr().err
    assert Bag(tmp_path / "so_far").last > 0
    main(["report", str(tmp_path / "so_far")])
    assert f"the run went on at 0.695 s, up to which python (process {writer.pid}" in "".join(capsys.readouterr())


def test_python_says_so_too_and_reads_it_as_cut_off_once_nobody_writes(written):
    folder, writer = written
    with pytest.raises(BagError, match=SAYS.format(pid=writer.pid)):
        open_run(folder)
    writer.communicate()
    with pytest.raises(BagError, match="the run was cut off before it could close the bag"):
        Bag(folder)
