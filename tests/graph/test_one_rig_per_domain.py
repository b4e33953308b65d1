# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""One rig or replay for each ROS domain: a second one is refused in a sentence before it starts anything."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from rig_msgs.msg import RigState
from running_graph import SHORT, Client, RigRun

from rig_nodes.base.errors import RigError
from rig_nodes.controllers.ros.domain import allocate, from_environment

SAMPLE = Path(__file__).resolve().parents[2] / "bags" / "sample"


def test_a_second_rig_in_a_domain_is_refused_and_the_first_goes_on(tmp_path, rig_command):
    with allocate() as domain:
        env = {"ROS_DOMAIN_ID": str(domain.number)}
        sequence = tmp_path / "long.yaml"
        sequence.write_text("description: long\nsteps:\n  - oil: {pressure: 4 MPa}\n  - wait: {for: 60 s}\n")
        first = RigRun(tmp_path / "first", "--speed", "1", sequence=sequence, env=env)
        first.until("all nodes are connected")
        for arguments in (["run", str(SHORT), "--out", str(tmp_path / "second")], ["replay", str(SAMPLE)]):
            second = rig_command(*arguments, env=env)
            assert second.returncode == 2, second.stdout + second.stderr
            assert second.stderr.splitlines()[-1].startswith(
                f"rig: there is a rig or a replay in ROS domain {domain.number} already (it runs on this machine)"
            )
        assert not (tmp_path / "second").exists()
        alone = subprocess.run(
            [sys.executable, "-P", "-m", "rig_nodes.nodes.rig_container"],
            text=True,
            capture_output=True,
            env=os.environ | env,
            timeout=60,
        )
        assert alone.returncode == 2 and f"a rig or a replay in ROS domain {domain.number}" in alone.stderr
        first.ctrl_c()
        code, output = first.end()
    assert code == 130 and json.loads((tmp_path / "first" / "report.json").read_text())["run"]["lost"] == 0, output


@pytest.mark.against_the_clock  # the command searches the domain for a short time only
def test_a_rig_that_only_dds_shows_is_found_too(tmp_path, rig_command):
    """A rig in another container is such a case: it holds no socket here."""
    with allocate() as domain:
        user = Client(domain)
        try:
            user.node.create_publisher(RigState, "/rig/state", 10)
            second = rig_command("run", str(SHORT), "--out", str(tmp_path / "run"), env={"ROS_DOMAIN_ID": str(domain.number)})
        finally:
            user.close()
    assert second.returncode == 2 and "(/rig/state is sent by user)" in second.stderr.splitlines()[-1]
    assert not (tmp_path / "run").exists()


def test_other_tools_in_the_domain_do_not_keep_a_rig_out():
    with allocate() as domain:
        user = Client(domain)
        try:
            domain.lead()
        finally:
            user.close()


def test_a_domain_that_was_named_is_not_given_to_somebody_else(monkeypatch):
    with allocate() as free:
        number = free.number
    monkeypatch.setenv("ROS_DOMAIN_ID", str(number))
    with from_environment() as named:
        named.lead()
        with allocate() as other:
            assert other.number != number
        with pytest.raises(RigError, match=f"in ROS domain {number} already"):
            from_environment().lead()
    with from_environment() as again:
        again.lead()
