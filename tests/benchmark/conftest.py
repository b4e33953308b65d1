# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A copy of the sample bag, because a report may be written beside a bag."""

import shutil
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def sample_bag(tmp_path_factory) -> str:
    """The folder of a run."""
    source = Path(__file__).resolve().parents[2] / "bags" / "sample"
    return str(shutil.copytree(source, tmp_path_factory.mktemp("bench") / "sample"))
