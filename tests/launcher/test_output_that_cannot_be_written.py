# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A verb whose output goes to a full disk says so in one sentence; one whose reader has ended (`| head`) says nothing."""

import os
import subprocess
import sys

RIG = [sys.executable, "-P", "-m", "rig_nodes"]


def test_a_full_disk_is_one_sentence():
    with open("/dev/full", "w") as full:
        ended = subprocess.run([*RIG, "list", "trips"], stdout=full, stderr=subprocess.PIPE, text=True)
    assert ended.returncode == 1
    assert ended.stderr.splitlines() == ["rig: its output cannot be written (No space left on device)"]


def test_the_end_of_the_reader_is_no_fault():
    reading, writing = os.pipe()
    os.close(reading)
    ended = subprocess.run([*RIG, "list", "trips"], stdout=writing, stderr=subprocess.PIPE, text=True)
    os.close(writing)
    assert (ended.returncode, ended.stderr) == (141, "")
