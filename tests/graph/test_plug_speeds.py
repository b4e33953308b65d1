# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Every lockstep plug on the graph: the bits of `simulate` at any speed, and with its process stopped as in a debugger.

The short test always runs, the whole matrix on demand: `./rig test -m campaign tests/graph/test_plug_speeds.py` prints
the factors that docs/how_to/controllers.md shows.
"""

import contextlib
import os
import re
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest
from running_graph import RigRun

import rig_nodes
from rig_nodes.bags.reader import Bag
from rig_nodes.controllers.ros.domain import allocate, environment
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.fmu.build import build_controller_fmu
from rig_nodes.runs.sequence import load_sequence
from rig_nodes.runs.simulation import simulate

EXAMPLES = Path(rig_nodes.__file__).parent / "controllers" / "examples"
NOT_THE_PLANTS = {"/controller/events", "all"}
SEQUENCE = """
description: gear I, nothing else
ready: {timeout: 30 s}
steps:
  - oil: {pressure: 4 MPa}
  - shift: {to: I, timeout: 5 s}
"""
PLUGS = {  # specification or its pattern; name of the process that computes, or a word in its command line
    "python": ("python:rig_nodes.controllers.examples.alfa46:Alfa46", "rig-python\n"),
    "c": (f"c:{EXAMPLES / 'alfa46.c'}", "rig-library\n"),
    "simulink": (f"simulink:{EXAMPLES / 'simulink'}", "rig-library\n"),
    "udp": ("udp:{port}", "examples.alfa46_udp"),
    "fmu": ("fmu:{folder}/alfa46.fmu", "rig-fmu\n"),
    "ros": ("ros:speeds", "examples.alfa46_ros"),
}
PROGRAMS = {  # programs that run beside the rig, with their arguments
    "udp": ("rig_nodes.controllers.examples.alfa46_udp", "127.0.0.1", "{port}"),
    "ros": ("rig_nodes.controllers.examples.alfa46_ros", "speeds"),
}


@pytest.fixture(scope="module")
def sequence(tmp_path_factory):
    path = tmp_path_factory.mktemp("sequence") / "sequence.yaml"
    path.write_text(SEQUENCE)
    return path


@pytest.fixture(scope="module")
def expected(sequence, tmp_path_factory):
    """Returns the hashes of `simulate` with the built-in controller, and the length of the sequence [s]."""
    folder = tmp_path_factory.mktemp("simulated")
    run = simulate(load_rig("hydmag"), load_sequence(sequence, default="hydmag"), folder)
    return Bag(folder).canonical_hash(), run["duration_s"]


def process_of(run, word):
    """Returns the child process of `rig run`, or a process beside it, with this name or this word in its command line."""
    parents, found = {}, []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            parents[int(folder.name)] = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
            if word in (folder / "cmdline").read_text(errors="replace") or word == (folder / "comm").read_text():
                found.append(int(folder.name))
        except OSError:
            continue

    def below(pid):
        while pid in parents and pid not in (run.process.pid, os.getpid()):
            pid = parents[pid]
        return pid in (run.process.pid, os.getpid())

    return next(pid for pid in found if below(pid))


@contextlib.contextmanager
def program_of(plug, port, domain):
    """Runs the controller's own program for the plugs that have one."""
    if plug not in PROGRAMS:
        yield
        return
    words = [word.format(port=port) for word in PROGRAMS[plug]]
    program = subprocess.Popen([sys.executable, "-m", *words], env=environment(domain))
    try:
        yield
    finally:
        program.kill()
        program.wait()


def check(folder, sequence, expected, plug, speed, stop=0.0):
    """Runs the sequence: the bag equals that of `simulate`, and the printed factor fits the speed and the stop."""
    spec, word = PLUGS[plug]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    if plug == "fmu":
        build_controller_fmu([EXAMPLES / "alfa46.c"], folder / "alfa46.fmu", load_rig("hydmag"))
    with allocate() as domain, program_of(plug, port, domain):
        run = RigRun(
            folder / "run",
            "--speed",
            speed,
            "--step-timeout",
            "none",
            "--controller",
            spec.format(port=port, folder=folder),
            sequence=sequence,
            env={"ROS_DOMAIN_ID": str(domain.number)},
        )
        if stop:
            run.until("shift to I")
            controller = process_of(run, word)
            os.kill(controller, signal.SIGSTOP)
            time.sleep(stop)
            os.kill(controller, signal.SIGCONT)
        code, output = run.end()
    assert code == 0, output
    hashes, seconds = expected
    found = Bag(run.folder).canonical_hash()
    assert {topic for topic in hashes if found.get(topic) != hashes[topic]} <= NOT_THE_PLANTS
    factor = float(re.search(r"^speed: (\d+\.\d+) times real time$", output, re.M)[1])
    most = min(float(speed.replace("max", "inf")), seconds / stop if stop else float("inf"))
    assert 0.0 < factor <= 1.01 * most + 0.005, "two digits are printed"
    return factor


def test_half_speed_and_a_stop_in_a_debugger_change_no_bit(tmp_path, sequence, expected):
    check(tmp_path, sequence, expected, "ros", "0.5", stop=1.5)


@pytest.mark.campaign
@pytest.mark.parametrize("plug", PLUGS)
def test_the_same_bits_at_any_speed_and_with_a_stop_of_ten_seconds(tmp_path, sequence, expected, plug, capfd):
    factors = {}
    for name, speed, stop in (("0.5", "0.5", 0.0), ("1", "1", 0.0), ("max", "max", 0.0), ("max, stopped", "max", 10.0)):
        (tmp_path / name).mkdir()
        factors[name] = check(tmp_path / name, sequence, expected, plug, speed, stop)
    with capfd.disabled():
        print(f"\n{plug}: " + ", ".join(f"{name} {factor:.2f}" for name, factor in factors.items()))
