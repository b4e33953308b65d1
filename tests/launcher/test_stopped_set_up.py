# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A set-up that is stopped ends its tools and what these started, and leaves nothing in the temporary folder."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

# the launcher with a first step that never ends, whose tool has a child and uses the temporary folder
SETS_UP = """
import os, sys
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
sys.dont_write_bytecode = True
loader = SourceFileLoader("rig_launcher", sys.argv[1])
rig = module_from_spec(spec_from_loader("rig_launcher", loader))
loader.exec_module(rig)
rig.ROOT, rig.find_missing = sys.argv[2], lambda root, builds: None


def install(root, venv, steps, env):
    os.makedirs(env["TMPDIR"])
    steps.start("working")
    tool = 'sleep 60 & echo $! > "$TMPDIR/child"; mv "$TMPDIR/child" "$TMPDIR/../child"; mktemp -d; wait'
    steps.run(["sh", "-c", tool], env, "it failed")


rig.install_packages = install
sys.exit(rig.main(["doctor"]))
"""


def is_alive(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.parametrize(("number", "code"), [(signal.SIGTERM, 143), (signal.SIGINT, 130)])
def test_it_leaves_no_process_and_no_file(checkout, tmp_path, number, code):
    root, elsewhere = tmp_path / "checkout", tmp_path / "tmp"
    (root / ".venv").mkdir(parents=True)
    elsewhere.mkdir()
    started = subprocess.Popen(
        [sys.executable, "-c", SETS_UP, str(checkout / "rig"), str(root)],
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "TMPDIR": str(elsewhere)},
    )
    told, deadline = root / ".venv" / "child", time.monotonic() + 30
    while not (told.exists() and list((root / ".venv" / "tmp").glob("tmp*"))) and time.monotonic() < deadline:
        time.sleep(0.01)
    child = int(told.read_text())
    assert is_alive(child)
    started.send_signal(number)
    _, said = started.communicate(timeout=20)
    assert started.returncode == code and said.endswith("rig: set-up stopped; the next start takes it up again\n")
    while is_alive(child) and time.monotonic() < deadline:
        time.sleep(0.01)
    assert not is_alive(child) and not (root / ".venv" / "tmp").exists() and os.listdir(elsewhere) == []


# the same, with the signal sent while the tool's process is being started
MEANWHILE = SETS_UP.replace(
    "rig.install_packages",
    """
class Popen(rig.subprocess.Popen):
    def __init__(self, *arguments, **options):
        super().__init__(*arguments, **options)
        sys.stdout.write(str(self.pid))
        os.kill(os.getpid(), int(sys.argv[3]))


rig.subprocess.Popen = Popen
rig.install_packages""",
)


@pytest.mark.parametrize(("number", "code"), [(signal.SIGTERM, 143), (signal.SIGINT, 130)])
def test_a_signal_while_a_tool_starts_ends_it(checkout, tmp_path, number, code):
    (tmp_path / ".venv").mkdir()
    ended = subprocess.run(
        [sys.executable, "-c", MEANWHILE, str(checkout / "rig"), str(tmp_path), str(int(number))],
        capture_output=True,
        text=True,
        timeout=30,
    )
    assert ended.returncode == code and ended.stderr.endswith("rig: set-up stopped; the next start takes it up again\n")
    assert not is_alive(int(ended.stdout))
