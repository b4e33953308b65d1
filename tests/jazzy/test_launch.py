# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""`ros2 launch rig_nodes rig_launch.py`; skipped where there is no ROS 2 command line."""

import json
import os
import subprocess
from pathlib import Path

import pytest

SHORT = Path(__file__).resolve().parents[1] / "graph" / "short.yaml"


def launch(ros2: str, domain: int, *arguments: str) -> subprocess.CompletedProcess:
    command = [ros2, "launch", "rig_nodes", "rig_launch.py", *arguments]
    environment = dict(os.environ, ROS_DOMAIN_ID=str(domain))
    return subprocess.run(command, capture_output=True, text=True, env=environment, timeout=180)


@pytest.mark.against_the_clock
def test_the_launch_ends_with_its_sequence_and_leaves_a_whole_run(ros2, domain, tmp_path):
    ended = launch(ros2, domain, f"sequence:={SHORT}", f"out:={tmp_path / 'run'}", "seed:=3", "delay:=2")
    assert ended.returncode == 0, ended.stdout + ended.stderr
    run = json.loads((tmp_path / "run" / "report.json").read_text())["run"]
    assert run["end"]["state"] == "ended" and run["lost"] == 0 and run["seed"] == 3
    assert run["controller"]["delay"] == 2


def test_a_process_that_cannot_start_ends_the_launch_with_its_name(ros2, domain, tmp_path):
    ended = launch(ros2, domain, "set:=alfa46.t12=9 s", f"out:={tmp_path / 'run'}")
    assert ended.returncode != 0
    output = ended.stderr + ended.stdout
    assert "alfa46.t12" in output and "ended with exit code 2" in output
