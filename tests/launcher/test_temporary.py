# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a command puts aside is in one folder, which is gone at its end, or at the next start when the command was killed."""

import os
import subprocess
import sys

from rig_nodes.cli import temporary

WAITS = """
import sys, tempfile
from rig_nodes.cli.temporary import own_folder
own_folder()
print(tempfile.mkdtemp(prefix="pymp-"), flush=True)
sys.stdin.read()
"""


def started(folder):
    """Starts a command that uses its temporary folder; returns its process and a folder in there."""
    command = subprocess.Popen(
        [sys.executable, "-c", WAITS],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "TMPDIR": str(folder)},
    )
    return command, command.stdout.readline().strip()


def test_only_the_folders_of_commands_that_were_killed_are_removed(tmp_path):
    (tmp_path / "rig-tmp-mine").mkdir()  # a user's, with no lock
    (tmp_path / "rig-tmp-mine" / "thesis.txt").write_text("a week's work")
    (tmp_path / "pymp-other").mkdir()
    killed, left = started(tmp_path)
    running, kept = started(tmp_path)
    assert os.path.isdir(left) and os.path.dirname(left) != os.path.dirname(kept)
    killed.kill()
    killed.communicate()
    assert os.path.isdir(left)
    ended, its = started(tmp_path)
    assert not os.path.exists(os.path.dirname(left)) and os.path.isdir(kept)
    ended.communicate()
    running.communicate()
    assert not os.path.exists(its) and not os.path.exists(kept)
    assert sorted(os.listdir(tmp_path)) == ["pymp-other", "rig-tmp-mine"]
    assert os.listdir(tmp_path / "rig-tmp-mine") == ["thesis.txt"]


def test_a_folder_stays_while_a_process_of_a_killed_command_lives(tmp_path):
    forks = WAITS.replace("print(", "import os; child = os.fork(); child or sys.stdin.read() or os._exit(0); print(")
    command = subprocess.Popen(
        [sys.executable, "-c", forks],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "TMPDIR": str(tmp_path)},
    )
    folder = os.path.dirname(command.stdout.readline().strip())
    command.kill()
    command.wait()
    other, _ = started(tmp_path)
    assert os.path.isdir(folder)
    command.communicate()  # the child ends when nobody can write to it any more
    other.communicate()
    again, _ = started(tmp_path)
    again.communicate()
    assert not os.path.exists(folder) and temporary.PREFIX in folder
