# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rig run` ends in order whatever becomes of its output or of the server of its processes, and leaves no process.

Where it cannot begin, it says so and has begun nothing.
"""

import json
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from running_graph import PATIENCE, RigRun, Traces

from rig_nodes.bags.opened import OpenedBags
from rig_nodes.controllers.ros.domain import allocate
from rig_nodes.nodes.processes.supervisor import Order, Supervisor

TELLS = "starting the nodes"


def test_a_run_whose_output_nobody_reads_any_more_ends_in_order(tmp_path):
    run = RigRun(tmp_path / "run", "--speed", "1")
    run.until("shift to I")
    traces = Traces(run)
    run.process.stdout.close()  # as `rig run ... | head` does, or whoever has started it and was killed
    assert run.process.wait(PATIENCE) == 141
    traces.wait_gone()
    end = {"state": "interrupted", "reason": "the program that read its output has ended"}
    assert json.loads((run.folder / "report.json").read_text())["run"]["end"] == end
    with OpenedBags([next(run.folder.glob("*.mcap"))]) as bag:
        assert bag.pieces[-1].end == end


@pytest.mark.parametrize(
    "error",
    [OSError(28, "No space left on device"), UnicodeEncodeError("ascii", "é", 0, 1, "ordinal not in range")],
    ids=["full", "ascii"],
)
def test_a_run_whose_output_cannot_be_written_ends_all_its_processes(tmp_path, error):
    told = []

    def say(_t, text):
        told.append(text)
        if TELLS not in text:
            raise error

    with allocate() as domain:
        supervisor = Supervisor(Order(None, "hydmag", speed=1.0), tmp_path, domain, say)
        thread = threading.Thread(target=supervisor.run, daemon=True)
        thread.start()
        thread.join(2 * PATIENCE)
        assert not thread.is_alive()
    assert supervisor.end.state == "failed" and supervisor.end.reason.startswith(f"its output cannot be written ({error})")
    assert len(told) == 2, "it is not tried again"
    assert all((tmp_path / "logs" / f"{name}.json").exists() for name in supervisor.children), "each ended in order"


def test_sigterm_ends_a_run_whose_processes_server_stands_still(tmp_path):
    run = RigRun(tmp_path / "run", "--speed", "1")
    run.until("shift to I")
    traces = Traces(run)
    status = Path(f"/proc/{traces.children['container']}/status").read_text()
    server = int(status.partition("PPid:")[2].split()[0])
    os.kill(server, signal.SIGSTOP)
    run.process.send_signal(signal.SIGTERM)
    code, output = run.end()
    assert code == 128 + signal.SIGTERM and "Traceback" not in output, output
    assert "ended by SIGTERM" in output
    traces.wait_gone()


@pytest.mark.parametrize("files", [16, 63])
def test_too_few_open_files_are_named_before_anything_is_begun(tmp_path, files):
    done = subprocess.run(
        [
            "/bin/sh",
            "-c",
            f'ulimit -n {files} && exec "$0" -P -m rig_nodes run demo --speed max --out {tmp_path / "run"}',
            sys.executable,
        ],
        capture_output=True,
        text=True,
        timeout=60,
    )
    needed = f"rig: {files} open files are too few for the processes of a rig, which need 64 (ulimit -n)"
    assert (done.returncode, done.stderr.splitlines()) == (2, [needed]), done.stderr
    assert not (tmp_path / "run").exists()
