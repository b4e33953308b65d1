# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""SIGTERM ends a verb as Ctrl-C does: the files are complete, no process remains, the exit code is 143."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from rig_nodes.bags.reader import Bag

PATIENCE = 180.0
LONG = "description: long\nsteps:\n  - oil: {pressure: 4 MPa}\n  - wait: {for: 600 s}\n"


class Verb:
    """A verb in a process of its own, with everything that it starts in one session."""

    def __init__(self, folder: Path, *arguments: str):
        command = [sys.executable, "-P", "-m", "rig_nodes", *arguments]
        plain = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
        self.process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, cwd=folder, start_new_session=True, env=plain
        )

    def session(self) -> list[int]:
        """Returns the processes of its session that exist and are no zombies."""
        found = []
        for stat in Path("/proc").glob("[0-9]*/stat"):
            try:
                state, _, _, session = stat.read_text().rpartition(")")[2].split()[:4]
            except OSError:
                continue
            if int(session) == self.process.pid and state != "Z":
                found.append(int(stat.parent.name))
        return found

    def until(self, predicate, what: str) -> None:
        until = time.monotonic() + PATIENCE
        while not predicate():
            assert time.monotonic() < until and self.process.poll() is None, f"{what} never came"
            time.sleep(0.02)

    def terminate(self) -> tuple[int, str]:
        """Returns exit code and output after SIGTERM to the verb alone, as from a service manager or `timeout`."""
        self.process.send_signal(signal.SIGTERM)
        output, _ = self.process.communicate(timeout=PATIENCE)
        until = time.monotonic() + PATIENCE  # at the lowest priority, the last process may wait for its turn to end
        while self.session() and time.monotonic() < until:
            time.sleep(0.02)
        assert self.session() == [], "something that it started runs on"
        return self.process.returncode, output


@pytest.fixture
def start(tmp_path):
    """Starts a verb; processes that remain after the test are killed."""
    verbs = []

    def begin(*arguments: str) -> Verb:
        verbs.append(Verb(tmp_path, *arguments))
        return verbs[-1]

    yield begin
    for verb in verbs:
        for pid in verb.session():
            os.kill(pid, signal.SIGKILL)
        verb.process.wait()


def test_simulate_leaves_a_whole_bag_and_its_report(tmp_path, start):
    (tmp_path / "long.yaml").write_text(LONG)
    verb = start("simulate", "long.yaml", "--out", "run")
    bag = tmp_path / "run" / "long_0.mcap"
    verb.until(lambda: bag.exists() and bag.stat().st_size > 50_000, "the bag")
    code, output = verb.terminate()
    assert code == 143 and "Traceback" not in output, output
    assert output.splitlines()[-1] == "rig: ended by SIGTERM"
    assert Bag(tmp_path / "run").check() == [] and (tmp_path / "run" / "metadata.yaml").exists()
    end = json.loads((tmp_path / "run" / "report.json").read_text())["run"]["end"]
    assert end == {"state": "interrupted", "reason": "ended by SIGTERM"}


@pytest.mark.parametrize(
    "arguments, last",
    [
        (
            ["sweep", "demo", "--vary", "alfa46.t12=-250 ms .. -150 ms", "--samples", "500", "--out", "sweep"],
            "rig: ended by SIGTERM; go on with: ./rig sweep sweep",
        ),
        (["procedure", "delay_series", "--out", "series"], "rig: ended by SIGTERM"),
        pytest.param(["tune", "--out", "tune"], "rig: ended by SIGTERM", marks=pytest.mark.campaign),
        pytest.param(["validate"], "rig: ended by SIGTERM; what was begun is not finished", marks=pytest.mark.campaign),
    ],
    ids=lambda value: value[0] if isinstance(value, list) else "",
)
def test_a_campaign_ends_with_its_processes_and_leaves_no_half_file(tmp_path, start, arguments, last):
    verb = start(*arguments)
    journal = tmp_path / "sweep" / "members.jsonl"

    def works():
        if arguments[0] == "sweep":
            return journal.exists() and journal.stat().st_size > 0
        # its session also has the server of the workers, their tracker and the workers; a procedure without --jobs has none
        return len(verb.session()) > 3 or any(tmp_path.rglob("*.mcap"))

    verb.until(works, "its work")
    code, output = verb.terminate()
    assert code == 143 and "Traceback" not in output, output
    assert last in output
    for path in tmp_path.rglob("*"):
        assert not path.name.startswith("."), f"{path} is half of a file"
        if path.suffix == ".json":
            json.loads(path.read_text())
        if path.suffix == ".mcap" and (path.parent / "metadata.yaml").exists():
            assert Bag(path).check() == []
