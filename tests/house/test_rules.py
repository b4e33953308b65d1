# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The rules of pyproject.toml: format, lint, types and spelling of everything that is checked in."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
RULES = {
    "format": ["ruff", "format", "--check", "--diff"],
    "lint": ["ruff", "check", "--output-format", "concise"],
    "types": ["pyrefly", "check", "--python-interpreter-path", sys.executable, "--output-format", "min-text"],
    "spelling": ["typos", "--format", "brief"],
}


def run(rule: str, folder: Path) -> subprocess.CompletedProcess:
    name, *arguments = RULES[rule]
    program = Path(sys.executable).with_name(name)
    if not program.exists() and Path(sys.prefix) != ROOT / ".venv":
        pytest.skip(f"{name} is in the environment that ./rig makes")
    return subprocess.run([program, *arguments], cwd=folder, capture_output=True, text=True, timeout=300, check=False)


@pytest.mark.parametrize("rule", RULES)
def test_all_files_keep_to_it(rule):
    done = run(rule, ROOT)
    assert done.returncode == 0, f"{' '.join(RULES[rule])}:\n{done.stdout}{done.stderr}"


BROKEN = {
    "format": 'def one( ):\n  return {"a":1}\n',
    "lint": '"""Says nothing."""\n\nimport os\n',
    "types": '"""Adds."""\n\n\ndef one(a: int) -> int:\n    """One more."""\n    return undefined_name + a\n',
    "spelling": '"""A %s frame."""\n' % ("rec" + "ieved"),
}


@pytest.mark.parametrize("rule", RULES)
def test_a_file_that_breaks_it_is_found(rule, tmp_path):
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    package = tmp_path / "rig_nodes" / "rig_nodes"
    package.mkdir(parents=True)
    (package / "broken.py").write_text(BROKEN[rule])
    done = run(rule, tmp_path)
    assert done.returncode != 0 and "broken.py" in done.stdout + done.stderr
