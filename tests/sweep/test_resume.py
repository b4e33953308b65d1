# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A killed sweep continues: no finished member is run again, and a partly written line is ignored."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from rig_nodes.base.errors import RigError
from rig_nodes.runs.workers import Workers
from rig_nodes.studies.sweep.run import manifest_of, run_sweep
from rig_nodes.studies.sweep.store import RESULTS, SWEEP_JOURNAL, Journal, Store, decode

from .killed_sweep import many, plan

SCRIPT = Path(__file__).with_name("killed_sweep.py")


def start(folder: Path, jobs: int, *more: str) -> subprocess.Popen:
    return subprocess.Popen([sys.executable, str(SCRIPT), str(folder), str(jobs), *more], stdout=subprocess.PIPE, text=True)


def read_until(process, word: str, count: int = 1) -> list[str]:
    """Reads lines up to the count-th one that begins with a word."""
    lines = []
    for line in process.stdout:
        lines.append(line.strip())
        if sum(one.startswith(word) for one in lines) == count:
            return lines
    raise AssertionError(f"the process ended after {lines}")


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory) -> bytes:
    """The results of the same sweep without interruption, in one process."""
    folder, chosen = tmp_path_factory.mktemp("whole") / "sweep", plan()
    with Store(folder, manifest_of(chosen, False)) as store, Workers(1) as workers:
        assert run_sweep(chosen, store, workers.stream) == 22
        return store.write_results(chosen).read_bytes()


def members_in(folder: Path) -> list[int]:
    return [decode(line)["member"] for line in (folder / SWEEP_JOURNAL).read_bytes().splitlines(keepends=True)]


def test_kill_of_the_parent(tmp_path, undisturbed):
    folder = tmp_path / "sweep"
    process = start(folder, 2)
    seen = read_until(process, "finished", 5)
    process.send_signal(signal.SIGKILL)
    process.wait()
    process.stdout.close()
    assert not (folder / RESULTS).exists()
    before = members_in(folder)
    assert set(before) >= {int(line.split()[1]) for line in seen if line.startswith("finished")}

    with open(folder / SWEEP_JOURNAL, "ab") as journal:
        journal.write(b'0badc0de {"member":21,"seed"')  # as after a kill while a line was being written
    again = start(folder, 2)
    lines = read_until(again, "whole")
    assert again.wait() == 0
    again.stdout.close()
    ran = {int(line.split()[1]) for line in lines if line.startswith("finished")}
    assert ran == set(range(22)) - set(before)
    assert sorted(members_in(folder)) == list(range(22))
    assert (folder / RESULTS).read_bytes() == undisturbed


def test_kill_of_a_worker(tmp_path, undisturbed):
    folder = tmp_path / "sweep"
    process = start(folder, 2)
    pids = [int(pid) for pid in read_until(process, "processes")[0].split()[1:]]
    assert len(pids) == 2
    read_until(process, "finished", 3)
    os.kill(pids[0], signal.SIGKILL)
    read_until(process, "whole")
    assert process.wait() == 0
    process.stdout.close()
    assert sorted(members_in(folder)) == list(range(22))
    assert (folder / RESULTS).read_bytes() == undisturbed


@pytest.mark.campaign
def test_two_thousand_runs(tmp_path, record_property):
    """With workers killed at 200 and 400 members and the parent at 800: 2000 members, each once, and the same bytes."""
    began = time.monotonic()
    folder = tmp_path / "sweep"
    process = start(folder, 2, "many")
    pids = [int(pid) for pid in read_until(process, "processes")[0].split()[1:]]
    for pid in pids:
        read_until(process, "finished", 200)
        os.kill(pid, signal.SIGKILL)
    read_until(process, "finished", 400)
    process.send_signal(signal.SIGKILL)
    process.wait()
    process.stdout.close()
    before = members_in(folder)
    assert len(before) >= 800 and len(set(before)) == len(before)
    again = start(folder, 2, "many")
    ran = [int(line.split()[1]) for line in read_until(again, "whole") if line.startswith("finished")]
    assert again.wait() == 0
    again.stdout.close()
    assert sorted(before + ran) == list(range(2000)) == sorted(members_in(folder))
    killed = time.monotonic()

    chosen = many()
    with Store(tmp_path / "whole", manifest_of(chosen, False)) as store, Workers(2) as workers:
        assert run_sweep(chosen, store, workers.stream) == 2000
        undisturbed = store.write_results(chosen)
    assert (folder / RESULTS).read_bytes() == undisturbed.read_bytes()
    table = pytest.importorskip("pyarrow.parquet").read_table(undisturbed)
    assert set(table["end"].to_pylist()) == {"ended"} and len(set(table["member"].to_pylist())) == 2000
    ended = time.monotonic()
    for name, value in (
        ("killed", len(before)),
        ("resumed", len(ran)),
        ("seconds", killed - began),
        ("seconds_undisturbed", ended - killed),
    ):
        record_property(name, value)
    assert ended - began < 1800.0, "4000 runs of 0.05 s on two cores, and what else they do"


def test_one_folder_one_process(tmp_path):
    chosen = plan()
    with Store(tmp_path / "sweep", manifest_of(chosen, False)):
        with pytest.raises(RigError, match="another process is working there"):
            Store(tmp_path / "sweep", manifest_of(chosen, False))


def test_another_sweep_in_the_folder(tmp_path):
    chosen = plan()
    manifest = manifest_of(chosen, False)
    with Store(tmp_path / "sweep", manifest):
        pass
    other = json.loads(json.dumps(manifest))
    other["plan"]["seed"] = 2
    with pytest.raises(RigError, match="holds another sweep .plan.seed is not the same"):
        Store(tmp_path / "sweep", other)
    (tmp_path / "notes").mkdir()
    (tmp_path / "notes" / "notes.txt").write_text("mine")
    with pytest.raises(RigError, match="holds no sweep"):
        Store(tmp_path / "notes", manifest)


def test_a_finished_member_is_never_noted_twice(tmp_path):
    with Store(tmp_path / "sweep", manifest_of(plan(), False)) as store:
        entry = {"member": 3, "seed": 4, "values": {}, "end": {"state": "ended", "reason": ""}, "shifts": []}
        store.add(entry)
        with pytest.raises(ValueError):
            store.add(entry)


def test_an_entry_that_is_damaged_while_the_journal_is_open_is_named(tmp_path):
    path = tmp_path / SWEEP_JOURNAL
    journal = Journal(path)
    for member in range(3):
        journal.add({"member": member})
    path.write_bytes(path.read_bytes().replace(b'"member":1', b'"member":7').replace(b'"member": 1', b'"member": 7'))
    with pytest.raises(RigError, match="damaged since the file was opened"):
        list(journal.entries())
    journal.close()
    again = Journal(path)
    assert [entry["member"] for entry in again.entries()] == [0]
    again.close()
