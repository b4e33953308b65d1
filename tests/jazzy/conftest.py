# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Fixtures that the tests of this folder share: a domain, and a `ros2` that finds the rig's packages."""

import shutil
import subprocess

import pytest


@pytest.fixture
def domain():
    """Number of a ROS domain of the test's own."""
    from rig_nodes.controllers.ros.domain import allocate

    with allocate() as held:
        yield held.number


@pytest.fixture(scope="session")
def ros2() -> str:
    """The command `ros2` with the overlay of this workspace; without them the test is skipped."""
    command = shutil.which("ros2")
    if command is None:
        pytest.skip("there is no ros2 here")
    listed = subprocess.run([command, "pkg", "list"], capture_output=True, text=True, timeout=60)
    if not {"rig_nodes", "rig_msgs"} <= set(listed.stdout.split()):
        pytest.skip("ros2 does not see rig_nodes and rig_msgs: no overlay is sourced")
    return command
