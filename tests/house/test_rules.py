# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The rules of pyproject.toml: format, lint, types and spelling of everything that is checked in."""

import importlib.util
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TOOLS = {
    "format": ["ruff", "format", "--check", "--diff"],
    "lint": ["ruff", "check", "--output-format", "concise"],
    "types": ["pyrefly", "check", "--python-interpreter-path", sys.executable, "--output-format", "min-text"],
    "spelling": ["typos", "--format", "brief"],
}


@pytest.mark.parametrize("rule", TOOLS)
def test_the_rules_hold(rule):
    name, *arguments = TOOLS[rule]
    program = shutil.which(name, path=str(Path(sys.executable).parent))
    if program is None and importlib.util.find_spec("numpy") and not (ROOT / ".venv").is_dir():
        pytest.skip(f"{name} is in the launcher's environment, and these tests run in another one")
    done = subprocess.run([program, *arguments], cwd=ROOT, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, f"{' '.join([name, *arguments])}:\n{done.stdout}{done.stderr}"
