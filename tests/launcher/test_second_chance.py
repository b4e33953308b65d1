# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rig test` without arguments: every file is in one part, and some failed tests are run once more."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from rig_nodes.cli.test import AT_MOST, NOT_JUDGED, counted, failed_tests, may_try_again, parts_of, slowest

sys.path.insert(0, str(Path(__file__).parents[1]))

import machine

CLOCK = "tests/graph/test_live_graph.py::test_torque_is_read_without_gaps_and_in_time"
PLAIN = "tests/plant/test_models.py::test_something"
ROOT = Path(__file__).resolve().parents[2]
WATCH = (ROOT / "tests/machine.py").read_text().replace("WORKING = 20_000, 0.3", "WORKING = 20_000, 0.01")
TOLD = "; not judged, because this machine does not keep time: tests/graph/test_one.py"
RUN_ALL = (
    "import sys; from argparse import Namespace; from pathlib import Path; from rig_nodes.cli import test; "
    "test.tests_root, test.RIGS_PRELOADED = lambda: Path(sys.argv[1]), 'NO_RIG'; sys.exit(test.main(Namespace(passed_on=[])))"
)
LATE = """
import pytest


@pytest.mark.against_the_clock
def test_late():
    with open("late", "a+") as file:
        file.write("x")
        file.seek(0)
        assert len(file.read()) > TIMES, "late"


def test_beside():
    with open("beside", "a") as file:
        file.write("x")
"""


@pytest.mark.parametrize(
    "failed, again",
    [
        ([], False),
        ([CLOCK], True),
        ([CLOCK, PLAIN], False),
        ([f"{CLOCK}[{n}]" for n in range(20)], True),
        ([f"tests/graph/test_{n}.py::test_late" for n in range(9)], False),
    ],
)
def test_only_failures_against_the_clock_in_a_few_files(failed, again):
    assert may_try_again(failed, [test for test in failed if test != PLAIN]) is again


def test_the_failures_are_those_that_pytest_noted(tmp_path):
    assert failed_tests(tmp_path) == []
    for part, name in (("clock", CLOCK), ("plant", PLAIN)):
        notes = tmp_path / ".pytest_cache/parts" / part / "v/cache/lastfailed"
        notes.parent.mkdir(parents=True)
        notes.write_text(json.dumps({name: True}))
    assert failed_tests(tmp_path) == [CLOCK, PLAIN] and failed_tests(tmp_path, "clock") == [CLOCK]


def test_the_slowest_tests_of_all_parts_are_named_once(monkeypatch):
    monkeypatch.setattr("rig_nodes.cli.test.SLOWEST", 2)
    text = "..\n=== slowest 20 durations ===\n{}s call     tests/{}.py::test_it[a b]\n\n(3 durations < 0.005s hidden.)\n"
    parts = [text.format(*one) + "collection took 1.5 s\n" for one in (("3.50", "a"), ("12.25", "b"), ("0.01", "c"))]
    lines = slowest("".join(parts)).splitlines()
    assert [line.split(maxsplit=2) for line in lines[1:3]] == [
        ["12.2", "s", "tests/b.py::test_it[a b]"],
        ["3.5", "s", "tests/a.py::test_it[a b]"],
    ]
    assert lines[-1] == "rig: the parts took 4 s to collect their tests" and len(lines) == 4


def test_every_file_is_in_exactly_one_part_and_what_has_a_clock_is_found():
    first, beside, clock = parts_of(ROOT)
    assert {"tests/graph/test_cut.py", "tests/view/test_live_view.py"} <= set(clock) and "controllers-1" in first
    assert "tests/graph/test_domain.py" not in clock
    covered = [ROOT / file for part in (*first.values(), *beside.values()) for file in part]
    assert sorted(covered) == sorted((ROOT / "tests").rglob("test_*.py")) and not first.keys() & beside.keys()


@pytest.mark.parametrize(
    "line, counts",
    [
        ("1 failed, 30 passed, 1 skipped, 2 deselected in 3.10s", {"failed": 1, "passed": 30, "skipped": 1}),
        ("==== 7 passed, 2 errors in 0.5s ====", {"passed": 7, "error": 2}),
        ("no tests ran in 0.01s", {}),
    ],
)
def test_what_a_part_says_at_its_end_is_counted(line, counts):
    assert counted(f"....\n{line}\n") == counts


def test_a_checkout_is_tested_in_parts_and_its_failures_are_told(tmp_path):
    (tmp_path / "pytest.ini").write_text(
        "[pytest]\ntestpaths = tests\naddopts = --import-mode=importlib\nmarkers =\n    campaign\n    against_the_clock\n"
    )
    for folder, text in (
        ("plant", "def test_a(): pass\n"),
        ("bags", "def test_b(): assert False\n"),
        ("graph", "import pytest\n\n\ndef test_c(): pass\n\n\n@pytest.mark.against_the_clock\ndef test_d(): pass\n"),
    ):
        (tmp_path / "tests" / folder).mkdir(parents=True)
        (tmp_path / "tests" / folder / "test_one.py").write_text(text)
    (tmp_path / "tests" / "machine.py").write_text(WATCH)
    notes = tmp_path / ".pytest_cache/parts/plant/v/cache/lastfailed"
    notes.parent.mkdir(parents=True)
    notes.write_text(json.dumps({"tests/plant/test_one.py::test_renamed": True}))
    done = subprocess.run([sys.executable, "-c", RUN_ALL, str(tmp_path)], capture_output=True, text=True, timeout=120)
    assert done.returncode == 1 and "rig: 1 failed, 3 passed in" in done.stdout and "slowest durations" not in done.stdout, (
        done.stdout + done.stderr
    )
    assert failed_tests(tmp_path) == ["tests/bags/test_one.py::test_b"], "no test against the clock: no second chance"
    assert "once more" not in done.stdout


@pytest.mark.parametrize(
    "times, still, code, first, end",
    [
        (2, 60.0, 0, "1 failed, 1 passed", "::test_late; passed then"),
        (3, 60.0, 1, "1 failed, 1 passed", "::test_late; failed again: tests/graph/test_one.py"),
        (3, -60.0, 0, "1 passed, 1 skipped", TOLD),
    ],
)
def test_what_fails_against_the_clock_runs_up_to_twice_more_alone(tmp_path, times, still, code, first, end):
    """The last machine is one that is not fit: it is never late by less than -60 s."""
    (tmp_path / "pytest.ini").write_text(
        "[pytest]\ntestpaths = tests\naddopts = --import-mode=importlib\nmarkers =\n    campaign\n    against_the_clock\n"
    )
    (tmp_path / "tests" / "graph").mkdir(parents=True)
    (tmp_path / "tests" / "graph" / "test_one.py").write_text(LATE.replace("TIMES", str(times)))
    watch = f"SLOWER, STILL = 1e3, {still}"  # the machine of this test plays no part
    (tmp_path / "tests" / "machine.py").write_text(WATCH.replace("SLOWER = 1.5", watch).replace("STILL = 0.05", ""))
    done = subprocess.run([sys.executable, "-c", RUN_ALL, str(tmp_path)], capture_output=True, text=True, timeout=120)
    assert done.returncode == code and f"rig: {first} in" in done.stdout, done.stdout + done.stderr
    assert done.stdout.splitlines()[-1] == f"rig: failed the first time: tests/graph/test_one.py{end}"
    assert (tmp_path / "beside").read_text() == "x", "what has no clock runs once"


def test_a_machine_that_is_too_slow_for_many_files_ends_with_their_names(tmp_path):
    (tmp_path / "pytest.ini").write_text(
        "[pytest]\ntestpaths = tests\naddopts = --import-mode=importlib\nmarkers =\n    campaign\n    against_the_clock\n"
    )
    (tmp_path / "tests" / "graph").mkdir(parents=True)
    files = [f"tests/graph/test_{n}.py" for n in range(AT_MOST + 1)]
    for file in files:
        after = "\n\n@pytest.mark.against_the_clock\ndef test_after():\n    raise SystemExit('the file goes on')\n"
        (tmp_path / file).write_text(LATE.replace("TIMES", "1000") + after)
    (tmp_path / "tests" / "machine.py").write_text(WATCH.replace("SLOWER = 1.5", "SLOWER = 0.0"))
    done = subprocess.run([sys.executable, "-c", RUN_ALL, str(tmp_path)], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0 and f"rig: {len(files)} passed, {2 * len(files)} skipped in" in done.stdout, (
        done.stdout + done.stderr
    )
    assert "once more" not in done.stdout and "the file goes on" not in done.stdout
    told = [line for line in done.stdout.splitlines() if line.startswith("rig: not judged: ")]
    assert sorted(line.split(": ")[2].split(";")[0] for line in told) == files
    assert all("times slower than a usual one" in line for line in told)


@pytest.mark.parametrize(
    "late, took, why",
    [
        (0.02, machine.USUAL, ""),
        (0.083, machine.USUAL, "this machine stood still for 83 ms at real-time priority"),
        (0.02, 3.5 * machine.USUAL, "this machine is 3.5 times slower than a usual one"),
    ],
)
def test_a_machine_is_fit_or_it_is_said_why_not(late, took, why):
    assert machine.unfit(late, took).startswith(why) and bool(why) == bool(machine.unfit(late, took))
    assert machine.NOT_JUDGED == NOT_JUDGED


def test_what_is_measured_is_what_the_machine_does():
    watched = machine.Watched(None)
    late, took = watched.measured()
    assert 0.0 <= late < 10.0 and 0.0 < took < 1.0 and watched.measured("the next file")[0] == 0.0
    watched._process.communicate()
