# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A verb whose output goes to a full disk says so in one sentence; one whose reader has ended (`| head`) says nothing."""

import errno
import os
import subprocess
import sys

import pytest

from rig_nodes.cli.main import main

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


@pytest.mark.parametrize("number, why", [(errno.ENOSPC, "disk full"), (errno.EROFS, "Read-only file system")])
def test_a_file_that_a_disk_does_not_take_is_one_sentence_in_every_verb(monkeypatch, capsys, number, why):
    def writing(_):
        raise OSError(number, os.strerror(number), "/some/file")

    monkeypatch.setattr("rig_nodes.cli.list.main", writing)
    assert main(["list", "rigs"]) == 1
    assert capsys.readouterr().err == f"rig: /some/file cannot be written ({why}); what was begun is not finished\n"
