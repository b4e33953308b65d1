# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Makes the shared helper modules importable for the tests of this folder."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture
def rig_command():
    """Runs a verb of `rig` in a process of its own and waits for its end."""

    def run(*arguments: str, env: dict[str, str] | None = None) -> subprocess.CompletedProcess:
        return subprocess.run(
            [sys.executable, "-P", "-m", "rig_nodes", *arguments],
            capture_output=True,
            text=True,
            env=os.environ | (env or {}),
            timeout=120,
        )

    return run
