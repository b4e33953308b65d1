# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The lock file serves every Python that the launcher takes."""

import re
from importlib.metadata import distributions
from pathlib import Path

LOCK = Path(__file__).parents[2] / "requirements.lock"
ENTRY = re.compile(r"^([\w.-]+)==.*?(?=^\S|\Z)", re.M | re.S)
FOR_ONE_PYTHON = re.compile(r"^Tag: cp\d+-cp\d+-", re.M)


def test_packages_with_a_wheel_for_each_python_have_the_hashes_of_all(launcher):
    """A lock made from a folder that holds the wheels of one Python looks right there and fails on every other."""
    hashes = {entry[1]: entry[0].count("--hash=") for entry in ENTRY.finditer(LOCK.read_text(encoding="utf-8"))}
    compiled = {one.name.lower() for one in distributions() if FOR_ONE_PYTHON.search(one.read_text("WHEEL") or "")}
    pythons = launcher.PYTHON_MAX[1] - launcher.PYTHON_MIN[1] + 1
    assert len(compiled & hashes.keys()) > 50
    assert {name for name in compiled & hashes.keys() if hashes[name] < pythons} == set()
