# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Fixtures that the launcher's tests share: the launcher as a module, and a small checkout with a made-up environment."""

import importlib.util
import os
import sys
from importlib.machinery import SourceFileLoader
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def checkout() -> Path:
    return CHECKOUT


@pytest.fixture(scope="session")
def launcher():
    """The file `rig` as a module."""
    loader = SourceFileLoader("rig_launcher", str(CHECKOUT / "rig"))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader("rig_launcher", loader))
    before, sys.dont_write_bytecode = sys.dont_write_bytecode, True
    try:
        loader.exec_module(module)
    finally:
        sys.dont_write_bytecode = before
    return module


@pytest.fixture
def small_checkout(tmp_path, launcher) -> Path:
    """A checkout with a lock, one message and an environment that is complete by its stamp."""
    root = tmp_path / "checkout"
    (root / "msgs" / "msg").mkdir(parents=True)
    (root / "msgs" / "msg" / "Torque.msg").write_text("float64 value\n")
    (root / "requirements.lock").write_text("numpy==2.4.6 \\\n    --hash=sha256:00\n    # via rig\n")
    venv = root / ".venv"
    site = venv / "lib" / "python3.11" / "site-packages"
    for name in ("numpy", "numpy-2.4.6.dist-info", "rig_msgs"):
        (site / name).mkdir(parents=True)
    (venv / "lib" / "librig_msgs.so").touch()
    (venv / "bin").mkdir()
    os.symlink(sys.executable, venv / "bin" / "python")
    launcher.write_stamp(
        str(venv),
        {
            "recipe": launcher.RECIPE,
            "root": str(root),
            "lock": launcher.file_hash(str(root / "requirements.lock")),
            "later": ["ros"],
            "messages": launcher.tree_hash(str(root / "msgs")),
            "python": launcher.base_python(str(venv)),
            "series": "%d.%d" % sys.version_info[:2],
            "entries": {"lib/python3.11/site-packages": ["numpy", "numpy-2.4.6.dist-info"], "bin": ["python"]},
            "message_entries": {"lib": ["librig_msgs.so"], "lib/python3.11/site-packages": ["rig_msgs"]},
        },
    )
    return root
