# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Lets the tests of this folder import the running graph they share."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture
def rig_command():
    """A verb of `rig` as a process of its own, waited for."""

    def run(*arguments: str, env: dict[str, str] | None = None) -> subprocess.CompletedProcess:
        return subprocess.run(
            [sys.executable, "-P", "-m", "rig_nodes.cli.main", *arguments],
            capture_output=True,
            text=True,
            env=os.environ | (env or {}),
            timeout=120,
        )

    return run
