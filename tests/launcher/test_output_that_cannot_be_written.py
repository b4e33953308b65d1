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


@pytest.mark.parametrize("closed", ["stdin", "stdout", "stderr"])
@pytest.mark.parametrize("launched", [False, True])
def test_a_closed_stream_is_no_fault_and_gets_nothing(closed, launched, checkout):
    if launched and os.path.basename(sys.prefix) != ".venv":
        pytest.skip("not in the launcher's environment")
    number = ("stdin", "stdout", "stderr").index(closed)
    command = [str(checkout / "rig")] if launched else RIG
    for verb, code in (["list", "rigs"], 0), (["list", "nothing"], 2):
        ended = subprocess.run(
            ["sh", "-c", f'exec "$@" {number}>&-', "sh", *command, *verb], capture_output=True, text=True, timeout=60
        )
        assert (ended.returncode, "Traceback" in ended.stderr) == (code, False), ended.stderr
        assert ("hydmag" in ended.stdout) == (code == 0 and closed != "stdout")
        assert ended.stderr.count("\n") == (code == 2 and closed != "stderr")


def test_the_reason_of_an_end_is_said_also_where_earlier_output_was_lost(monkeypatch):
    program = (
        "import sys\n"
        "from rig_nodes.base.errors import RigError\n"
        "from rig_nodes.cli import list as verb, main\n"
        "def failing(_):\n"
        "    print('some output')\n"
        "    raise RigError('this is why')\n"
        "verb.main = failing\n"
        "sys.exit(main.main(['list', 'rigs']))\n"
    )
    refused = [sys.executable, "-P", "-c", program]
    monkeypatch.delenv("PYTHONUNBUFFERED", raising=False)  # the output waits in a buffer until the end
    with open("/dev/full", "w") as full:
        ended = subprocess.run(refused, stdout=full, stderr=subprocess.PIPE, text=True)
    lost = "rig: its output cannot be written (No space left on device)"
    assert (ended.returncode, ended.stderr.splitlines()) == (2, [lost, "rig: this is why"])
    reading, writing = os.pipe()
    os.close(reading)
    ended = subprocess.run(refused, stdout=writing, stderr=subprocess.PIPE, text=True)
    assert (ended.returncode, ended.stderr.splitlines()) == (2, ["rig: this is why"])
    ended = subprocess.run(refused, stdout=subprocess.PIPE, stderr=writing, text=True)
    os.close(writing)
    assert (ended.returncode, ended.stdout) == (2, "some output\n")


@pytest.mark.parametrize(
    "error, sentence, code",
    [
        (OSError(errno.EACCES, os.strerror(errno.EACCES), "/a/file"), "/a/file: Permission denied", 2),
        (OSError(errno.ENAMETOOLONG, os.strerror(errno.ENAMETOOLONG), "/a/file"), "/a/file: File name too long", 2),
        (OSError(errno.ENODEV, os.strerror(errno.ENODEV)), "No such device; what was begun is not finished", 1),
        (OSError("no more"), "no more; what was begun is not finished", 1),
    ],
)
def test_what_the_system_refuses_is_one_sentence_in_every_verb(error, sentence, code, monkeypatch, capsys):
    def refused(_):
        raise error

    monkeypatch.setattr("rig_nodes.cli.list.main", refused)
    assert main(["list", "rigs"]) == code
    assert capsys.readouterr().err == f"rig: {sentence}\n"
