# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""colcon installs rig_nodes with all programs and all files that they read."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[2]
PACKAGE = CHECKOUT / "rig_nodes"
SCRIPTS = {"alfa46", "device", "recorder", "replay", "rig", "rig_container", "sequencer"}


@pytest.fixture(scope="module")
def install(tmp_path_factory) -> Path:
    """The install space of rig_nodes after a build by the colcon of this environment."""
    folder = tmp_path_factory.mktemp("workspace")
    colcon = [sys.executable, "-m", "colcon", "build", "--base-paths", str(PACKAGE)]
    built = subprocess.run(colcon, cwd=folder, capture_output=True, text=True)
    assert built.returncode == 0, built.stderr
    return folder / "install" / "rig_nodes"


def site(install: Path) -> Path:
    return next(install.glob("lib/python3*/site-packages"))


def test_ros2_run_finds_every_script_and_no_other(install):
    scripts = {path.name for path in (install / "lib" / "rig_nodes").iterdir() if os.access(path, os.X_OK)}
    assert scripts == SCRIPTS


def test_every_file_that_is_read_is_installed(install):
    read = [
        path.relative_to(PACKAGE)
        for suffix in ("yaml", "xml", "h", "c", "py")
        for path in (PACKAGE / "rig_nodes").rglob(f"*.{suffix}")
    ]
    assert len([path for path in read if path.suffix != ".py"]) >= 7
    assert [str(path) for path in read if not (site(install) / path).is_file()] == []


def test_launch_file_and_marker_are_where_ros2_looks(install):
    assert (install / "share" / "rig_nodes" / "launch" / "rig_launch.py").is_file()
    assert (install / "share" / "ament_index" / "resource_index" / "packages" / "rig_nodes").is_file()
    assert (install / "share" / "rig_nodes" / "package.xml").is_file()


def test_what_is_installed_runs(install, tmp_path):
    environment = dict(os.environ, PYTHONPATH=str(site(install)))
    listed = subprocess.run(
        [install / "lib" / "rig_nodes" / "rig", "list", "sequences"], capture_output=True, text=True, env=environment, cwd=tmp_path
    )
    assert listed.returncode == 0, listed.stderr
    assert "demo" in listed.stdout
