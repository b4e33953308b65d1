# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""``rig bench``: its refusals, its output, and that the measurement on the bare problem computes the right result."""

from __future__ import annotations

import json
import math
import subprocess
import sys

import pytest

from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import main
from rig_nodes.studies.benchmark import document, machine, peers, rigs, two_inertias


def test_what_is_refused(capsys):
    for arguments, sentence in (
        (["nonsense"], "there is no part to measure 'nonsense'; known are kernel, rigs, demo"),
        (["kernel", "--repeats", "0"], "repeats is 0, expected a whole number of at least 1"),
        (["kernel", "--json", "/nowhere/x.json"], "--json /nowhere/x.json: there is no folder /nowhere"),
        (["kernel", "--json", "/"], "it is a folder, expected a file"),
    ):
        assert main(["bench", *arguments]) != 0
        assert sentence in capsys.readouterr().err


def test_one_part_as_json(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("rig_nodes.studies.benchmark.kernel.VARIANTS", {"the usual": ({}, True)})
    assert main(["bench", "kernel", "--repeats", "1", "--json", str(tmp_path / "x.json")]) == 0
    result = json.loads((tmp_path / "x.json").read_text())
    row = result["kernel"]["the usual"]
    assert set(result) == {"generator", "machine", "kernel"} and result["machine"]["cores"] >= 1
    assert row["real_time_factor"] * row["ns_per_step"]["all"] * 1e-9 == pytest.approx(row["step_s"])
    assert "| the usual |" in capsys.readouterr().out


def test_every_rig_runs_a_sequence_of_its_own(monkeypatch, capsys):
    monkeypatch.setattr("rig_nodes.studies.benchmark.rigs.installed", lambda _: ["cylinder_bench"])
    assert main(["bench", "rigs", "--repeats", "1"]) == 0
    assert "| cylinder_bench | 100 | 48.0 |" in capsys.readouterr().out
    assert rigs.own_sequence("three_speed").endswith("three_speed/sequences/demo.yaml")
    assert rigs.own_sequence("chapter9").endswith("hydmag/sequences/demo.yaml")


def test_the_exact_lock_up_is_that_of_the_equations_of_motion():
    # Euler steps of 1 us with the torque at the middle of the step; their error is of first order only at the kinks of the speeds
    h, w1, w2, n = 1e-6, two_inertias.W1, 0.0, 0
    while w1 > w2:
        torque = 264.0 * (math.sin(0.5 * math.pi * (n + 0.5) * h / 0.045) if (n + 0.5) * h < 0.045 else 1.0)
        w1, w2, n = w1 + h * (60.0 - torque) / 0.7, w2 + h * (torque - 40.0) / 0.127, n + 1
    assert two_inertias.lock_up() == pytest.approx(n * h, abs=2e-6)


def test_ours_locks_at_the_exact_time_and_ends_at_the_exact_speed():
    line = two_inertias.Ours()
    assert line.run(5e-3) == pytest.approx(two_inertias.lock_up(), rel=1e-6)
    assert line.state.v == pytest.approx([two_inertias.end_speed()] * 2, rel=1e-12)
    assert line.run(1e-3, parts=peers.STOPS) == pytest.approx(two_inertias.lock_up(), rel=1e-9)
    assert line.run_straight(40) == pytest.approx(two_inertias.lock_up(), rel=1e-8)


def test_the_cheapest_that_is_exact_enough_speaks_for_its_tool():
    points = [
        peers.Point("free", "coarse", 1e-2, 1.0, 2.0),
        peers.Point("free", "middle", 1e-5, 3.0, 0.7),
        peers.Point("free", "fine", 1e-8, 2.0, 1.0),
        peers.Point("stopped", "other", 0.0, 0.1, 20.0),
    ]
    assert peers.best(points, "free", 1e-3).setting == "fine"
    assert peers.best(points, "free", 1e-1).setting == "coarse"
    assert peers.best(points, "free", 1e-9) is None


def test_a_missing_peer_is_named_and_not_shown(monkeypatch):
    monkeypatch.setattr(
        peers, "TOOLS", {"this project": lambda: iter([("free", "s", two_inertias.lock_up)]), "nonesuch": peers.by_drake}
    )
    result = peers.bench_peers(0.0)
    text = "\n".join(document.lines("peers", result))
    assert result["missing"] == ["nonesuch"] and "not installed, so not compared: nonesuch" in text
    assert "| nonesuch" not in text


def test_a_program_that_fails_or_hangs_while_it_is_measured_is_said_in_a_sentence(monkeypatch):
    with pytest.raises(RigError, match="rig report nowhere failed while it was measured: rig: .*nowhere"):
        machine.timed_rig(["report", "nowhere"])
    monkeypatch.setattr(machine, "TIMEOUT", 0.01)
    with pytest.raises(RigError, match="rig --help took more than 0 s"):
        machine.timed_rig(["--help"])


def test_what_needs_no_compiler_imports_none():
    code = (
        "import sys; from rig_nodes.cli.main import main\n"
        "for line in sys.argv[1:]:\n"
        "    try:\n        print('done', main(line.split()))\n"
        "    except SystemExit:\n        print('done')\n"
        "print(sorted({'numba', 'llvmlite', 'scipy.linalg'} & set(sys.modules)), file=sys.stderr)"
    )
    lines = ["--help", "bench --help", "list rigs", "list sequences"]
    done = subprocess.run([sys.executable, "-c", code, *lines], capture_output=True, text=True, check=True)
    assert done.stderr.strip().splitlines()[-1] == "[]"
    assert done.stdout.count("\ndone") == len(lines)
