# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The graph's processes as `ros2 launch` and `ros2 run` start them: without a supervisor, in the terminal's domain."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from rig_nodes.nodes.processes.result import end_of
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.rig import Rig

BRIEF = Path(__file__).resolve().parents[1] / "graph" / "brief.yaml"
PATIENCE = 90.0
PROFILES = ("FASTDDS_DEFAULT_PROFILES_FILE", "FASTRTPS_DEFAULT_PROFILES_FILE")


def start(folder: Path, domain: int, name: str, *arguments: str) -> subprocess.Popen:
    environment = {key: value for key, value in os.environ.items() if key not in PROFILES}
    command = [sys.executable, "-P", "-m", f"rig_nodes.nodes.{name}", *arguments, "--recorded", "--logs", str(folder / "logs")]
    with open(folder / "logs" / f"{name}.log", "wb") as log:
        return subprocess.Popen(command, stdout=log, stderr=log, env=environment | {"ROS_DOMAIN_ID": str(domain)})


@pytest.mark.against_the_clock
def test_a_run_without_a_supervisor_has_a_whole_report(tmp_path, domain):
    Rig(load_rig("hydmag")).advance_samples(1)  # compiles what is not compiled yet, outside the time limit below
    (tmp_path / "logs").mkdir()
    sequence = ("--sequence", str(BRIEF))
    processes = {
        "recorder": start(tmp_path, domain, "recorder", "--out", str(tmp_path), "--name", "brief"),
        "rig_container": start(tmp_path, domain, "rig_container", *sequence),
        "alfa46": start(tmp_path, domain, "alfa46"),
        "sequencer": start(tmp_path, domain, "sequencer", *sequence, "--once"),
    }
    try:
        assert processes["sequencer"].wait(PATIENCE) == 0
        shared = Path(f"/proc/{processes['rig_container'].pid}/maps").read_text()
        assert "/dev/shm/fastrtps" not in shared
        for name in ("rig_container", "alfa46", "recorder"):
            processes[name].send_signal(signal.SIGTERM)
            assert processes[name].wait(PATIENCE) == 0
    finally:
        for process in processes.values():
            process.kill()
            process.wait()
    log = (tmp_path / "logs" / "sequencer.log").read_text()
    assert "step 4 of 4" in log and "sequence 'brief' is done" in log
    report = [sys.executable, "-P", "-m", "rig_nodes", "report", str(tmp_path), "--json"]
    printed = subprocess.run(report, capture_output=True, text=True)
    assert printed.returncode == 0, printed.stderr
    run = json.loads(printed.stdout)["run"]
    assert run["end"] == {"state": "ended", "reason": "the sequence ended"}
    assert run["lost"] == 0 and run["seed"] == 1 and run["mode"] == "run"
    assert run["ticks"] > 100 and run["lateness_ms"]["p50"] >= 0.0
    assert set(run["processes"]) == {"recorder", "container", "alfa46", "sequencer"}


WELL = {"recorder": {}, "alfa46": {}, "sequencer": {"outcome": None}, "container": {"reason": "", "interrupted": False}}
DONE = {"sequencer": {"outcome": {"success": True, "text": "done"}}}
FAILED = {"sequencer": {"outcome": {"success": False, "text": "step 3 waited too long"}}}
TRIPPED = {"container": {"reason": "no command", "interrupted": False}}


@pytest.mark.parametrize(
    "change, lost, state, reason",
    [
        (DONE, None, "ended", "the sequence ended"),
        ({}, None, "ended", "stopped"),
        (FAILED, None, "failed", "step 3 waited too long"),
        ({"container": {"reason": "no command", "interrupted": True}}, None, "interrupted", "no command"),
        (TRIPPED, "alfa46", "failed", "alfa46 left no counts, as a process that was killed; safe state: no command"),
        ({}, "container", "failed", "container left no counts, as a process that was killed"),
    ],
)
def test_how_a_run_ended_is_told_from_what_its_processes_left(change, lost, state, reason):
    end = end_of({name: fact for name, fact in (WELL | change).items() if name != lost}, shifts=True)
    assert (end.state, end.reason) == (state, reason)


def test_a_bench_ends_well_without_the_shift_controller_that_it_does_not_have():
    end = end_of({name: fact for name, fact in (WELL | DONE).items() if name != "alfa46"}, shifts=False)
    assert (end.state, end.reason) == ("ended", "the sequence ended")
