# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The verb `rig test`: it runs pytest on the checkout's tests with ROS field checks on, by default all of them in parallel parts.

Files that failed against the clock run again when nothing else runs.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import rig_nodes
from rig_nodes.base import DEFAULT_RIG, RigError, ended_by
from rig_nodes.runs import RIGS_PRELOADED

HELP = "run the tests"
NEEDS = ("ros", "view")
PASSES_ON = True
# The mark of tests of processes in real time: on a machine that stalls for a tenth of a second, the rig under test
# rightly goes to its safe state. They run one after the other, and files that fail get further chances, in a process of
# their own when nothing else runs, which is printed. Failures are counted by file, because the tests of a file often share
# one graph. A graph in lockstep, a replay, or a program that only refuses does not depend on a clock and has no mark.
AGAINST_THE_CLOCK = "against_the_clock"
ONLY_CLOCK = f"{AGAINST_THE_CLOCK} and not campaign"
AT_MOST = 8  # files that get further chances; more failures are no accident
CHANCES = 2  # further runs of a file that failed
# A process of its own watches whether the machine keeps time (tests/machine.py, a plugin of pytest); what fails on one that
# does not is told and proves nothing.
WATCHED, NOT_JUDGED, NOTED = ("-p", "tests.machine", "-rs"), 80, "v/rig/not_judged"
# Folders whose processes wait for each other with time limits run first; the number is that of their parts, each short
# enough that the last one does not run alone for long.
FIRST = {"graph": 2, "controllers": 3, "fmu": 1}
# The others only compute. They take what the first parts and the tests against the clock leave of the processor, at the
# lowest priority that exists (SCHED_IDLE; a nice value is not enough). The longest should not run last, and those whose
# processes have time limits too should not run first. Short folders form one part with others, because to start a part
# costs four seconds: everything is imported, and the compiled rigs are read.
BESIDE = ("runs", "plant", "the rest", "view", "rigs", "rig", "bags", "api")
WITH = {"engine": "plant", "tune": "bags", "validation": "bags", "analysis": "bags"}  # folder -> the part to which it belongs
MOST_PARTS = 4  # at a time; each takes up to 1 GB, and spends a part of its time waiting for its own processes
# What `rig test --quick` runs: no ROS, and no more compiling than HydmAG needs.
QUICK = (
    *("house", "bags", "exchange", "alfa46/test_alfa46.py", "rig/test_wrong_rigs.py", "runs/test_names.py"),
    *("validation/test_evaluate.py", "validation/test_score.py", "validation/test_targets.py"),
)
NOT_QUICK = "tests/house/test_site.py::test_it_builds_without_a_warning"  # a third of the time of all of these
SLOWEST = 20  # tests that are named at the end
# what pytest (--durations) and tests/conftest.py say of times
TIMES = re.compile(
    r"=+ slowest \d+ durations|\(\d+ durations? <| *([\d.]+)s (?:call|setup|teardown) +(.+)|collection took ([\d.]+) s"
)
PASSED, FAILED, NOTHING_THERE = 0, 1, 5  # exit codes of pytest
PARTS, LAST_FAILED, CLOCK = ".pytest_cache/parts", "v/cache/lastfailed", "clock"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    parser.usage = "rig test [--quick] [pytest arguments]"
    parser.epilog = (
        "Without a path all of tests/ runs, apart from what is marked 'campaign'. "
        "Everything given is passed to pytest: 'rig test -x -k valve', 'rig test tests/plant'. "
        "--quick runs what needs no ROS and at most one rig's compiled code, in less than two minutes. "
        "Without arguments, folders run side by side on this machine's cores, and after some of them what "
        "runs against the clock; files that failed against the clock, up to 8, are tried up to twice more and named. "
        "What fails against the clock on a machine that was measured not to keep time is not judged, and named too."
    )


def tests_root() -> Path:
    """Return the folder of the checkout that holds the tests.

    Raises
    ------
    RigError
        When rig_nodes was installed without a checkout.
    """
    root = Path(rig_nodes.__file__).resolve().parents[2]
    if not (root / "pytest.ini").is_file():
        raise RigError(f"no tests beside {root}: 'rig test' works in a checkout only")
    return root


def main(args: argparse.Namespace) -> int:
    """Run what the arguments ask for with pytest, or all parts in parallel; return pytest's exit code."""
    root = tests_root()
    # a script's background jobs ignore SIGINT, as do the processes that they start, and a test that sends it would wait for ever
    signal.signal(signal.SIGINT, signal.default_int_handler)
    command = [sys.executable, "-m", "pytest", "--rootdir", str(root), "-c", str(root / "pytest.ini")]
    print("rig: " + " ".join(["ROS_PYTHON_CHECK_FIELDS=1", "pytest", *args.passed_on]), flush=True)
    # Message setters do not check types by default and send garbage; in tests a wrong type must be an error.
    env = dict(os.environ, ROS_PYTHON_CHECK_FIELDS="1")
    words = args.passed_on
    try:
        if "--quick" in words:
            quick = [f"--durations={SLOWEST}", "-m", f"not campaign and not {AGAINST_THE_CLOCK}", "--deselect", NOT_QUICK]
            words = [*quick, *(f"tests/{name}" for name in QUICK), *(word for word in words if word != "--quick")]
            return subprocess.run([*command, *words], env=env, cwd=root).returncode
        if words:
            # Given paths count from the caller's folder; without any, pytest.ini's testpaths count from the checkout.
            paths = [a.split("::")[0] for a in words if not a.startswith("-")]
            given = any((Path.cwd() / p).exists() for p in paths)
            return subprocess.run([*command, *words], env=env, cwd=None if given else root).returncode
        return _all(root, command, env)
    except KeyboardInterrupt as stop:
        return ended_by(stop)[1]


def _all(root: Path, command: list[str], env: dict[str, str]) -> int:
    """Run every test: some folders in parallel, then those against the clock, the others beside both; then failed files again."""
    began, counts, codes, times = time.monotonic(), Counter(), [], ""
    shutil.rmtree(root / PARTS, ignore_errors=True)  # pytest would keep failed tests that have another name now
    plants = {RIGS_PRELOADED: json.dumps([DEFAULT_RIG, "clutch_bench"])}
    first, beside, clock = parts_of(root)
    cores = len(os.sched_getaffinity(0))
    at_a_time = min(cores + 1, MOST_PARTS)
    print(
        f"rig: {len(first)} parts, {at_a_time} at a time, each shown when it is done; then {len(clock)} files against the "
        f"clock; beside all these {len(beside)} parts, shown at the end",
        flush=True,
    )

    def begin(name: str, mark: str, *arguments: str) -> subprocess.Popen:
        # with one cache folder for all parts, their notes would overwrite each other
        own = ["--no-header", f"--durations={SLOWEST}", "-m", mark, "-o", f"cache_dir={root / PARTS / name}"]
        return subprocess.Popen(
            [*command, *own, *arguments], env=env, cwd=root, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
        )

    def run(name: str, lowest: bool = False) -> tuple[str, int]:
        process = begin(name, f"not campaign and not {AGAINST_THE_CLOCK}", "-q", *{**first, **beside}[name])
        if lowest:
            os.sched_setscheduler(process.pid, os.SCHED_IDLE, os.sched_param(0))
        output, _ = process.communicate()
        return output, process.returncode

    def show(name: str, output: str, code: int) -> None:
        nonlocal times
        kept = [line for line in output.splitlines(keepends=True) if not TIMES.match(line)]
        print(f"rig: {name}\n{''.join(kept)}", end="", flush=True)
        times += output
        counts.update(counted(output))
        codes.append(code)

    # what runs at the lowest priority waits as soon as any other part or test wants its core
    with ThreadPoolExecutor(at_a_time) as together, ThreadPoolExecutor(at_a_time) as below, ThreadPoolExecutor(at_a_time) as after:
        try:
            others = {name: below.submit(run, name, True) for name in beside}
            # compiled before the first parts begin, whose processes have time limits, and after what needs only a core that is idle
            subprocess.run([sys.executable, "-m", "rig_nodes.runs.preloaded"], env=env | plants, cwd=root)
            for name, (output, code) in zip(first, together.map(run, first)):
                show(name, output, code)
            if clock:
                print("rig: against the clock", flush=True)
                process, line = begin(CLOCK, ONLY_CLOCK, "-v", *WATCHED, *clock), ""
                for line in process.stdout or ():
                    if TIMES.match(line):
                        times += line
                    else:
                        print(line, end="", flush=True)
                counts += counted(line)
                codes.append(process.wait())
            others.update({name: after.submit(run, name, True) for name, part in others.items() if part.cancel()})
            for name, part in others.items():
                show(name, *part.result())
        except KeyboardInterrupt:
            for pool in (together, below, after):
                pool.shutdown(wait=False, cancel_futures=True)
            raise
    failed, unjudged = failed_tests(root), not_judged(root)
    note_failed(root, failed)
    print(slowest(times), flush=True)
    total = ", ".join(f"{counts[what]} {what}" for what in ("failed", "error", "passed", "skipped") if counts[what])
    print(f"rig: {total} in {time.monotonic() - began:.0f} s", flush=True)
    for file, why in unjudged.items():
        print(f"rig: not judged: {file}; {why}", flush=True)
    code = next((code for code in codes if code not in (PASSED, FAILED, NOT_JUDGED, NOTHING_THERE)), int(FAILED in codes))
    again = [*failed, *unjudged]
    if code not in (PASSED, FAILED) or not may_try_again(again, [*failed_tests(root, CLOCK), *unjudged]):
        return code
    return _second_chances(again, [*command, *WATCHED, "-m", ONLY_CLOCK], env, root)


def _second_chances(failed: list[str], command: list[str], env: dict[str, str], root: Path) -> int:
    """Run tests' files again, each alone, and say how they ended; return the exit code."""
    print("rig: what failed runs against the clock; once more, file by file: " + ", ".join(failed), flush=True)
    files = sorted({test.split("::")[0] for test in failed})
    codes = {file: _again([*command, file], env, root) for file in files}
    ends = {
        "failed again": [file for file in files if codes[file] not in (PASSED, NOT_JUDGED)],
        "not judged, because this machine does not keep time": [file for file in files if codes[file] == NOT_JUDGED],
    }
    told = [f"{end}: {', '.join(ones)}" for end, ones in ends.items() if ones]
    print(f"rig: failed the first time: {', '.join(failed)}; {'; '.join(told) or 'passed then'}")
    return max(code for code in (PASSED, *codes.values()) if code != NOT_JUDGED)


def _again(command: list[str], env: dict[str, str], root: Path) -> int:
    """Return the exit code of the first of CHANCES further runs that does not fail, or else of the last one."""
    for _ in range(CHANCES):
        code = subprocess.run(command, env=env, cwd=root).returncode
        if code in (PASSED, NOT_JUDGED):
            break
    return code


def parts_of(root: Path) -> tuple[dict[str, list[str]], dict[str, list[str]], list[str]]:
    """Divide the files of the tests into parts.

    Parameters
    ----------
    root : Path
        The checkout.

    Returns
    -------
    first : dict of str to list of str
        Names of the parts that run first, with their files.
    beside : dict of str to list of str
        Names of the parts that run beside everything else, with their files.
    clock : list of str
        Files with tests that run against the clock.
    """
    files = sorted(path.relative_to(root).as_posix() for path in (root / "tests").rglob("test_*.py"))
    # in reverse order, so that the kernels of the rigs in tests/rig/ are compiled beside the graph's tests
    clock = [file for file in reversed(files) if f"mark.{AGAINST_THE_CLOCK}" in (root / file).read_text(encoding="utf-8")]
    folders: dict[str, list[str]] = {}
    for file in files:
        folder = file.split("/")[1]
        folders.setdefault(WITH.get(folder, folder), []).append(file)
    first = {
        f"{name}-{k + 1}" if count > 1 else name: folders[name][k::count]
        for name, count in FIRST.items()
        for k in range(min(count, len(folders.get(name, ()))))
    }
    beside = {name: folders.get(name, []) for name in BESIDE}
    for name in sorted(folders.keys() - FIRST.keys() - beside.keys()):
        beside["the rest"] += folders[name]
    return first, {name: files for name, files in beside.items() if files}, clock


def counted(output: str) -> Counter:
    """Return the counts in pytest's last line, e.g. "2 failed, 30 passed in 3.10s"."""
    last = output.strip().rpartition("\n")[2]
    return Counter({what: int(number) for number, what in re.findall(r"(\d+) (failed|passed|skipped|error)s?\b", last)})


def slowest(output: str) -> str:
    """Return lines that name the slowest tests, and the time of all collections, from what the parts printed."""
    found = [match for line in output.splitlines() if (match := TIMES.match(line))]
    tests = sorted(((float(match[1]), match[2]) for match in found if match[1]), reverse=True)[:SLOWEST]
    collecting = sum(float(match[3]) for match in found if match[3])
    lines = [f"rig: the {len(tests)} slowest tests:", *(f"{seconds:8.1f} s  {test}" for seconds, test in tests)]
    return "\n".join([*lines, f"rig: the parts took {collecting:.0f} s to collect their tests"])


def failed_tests(root: Path, part: str = "*") -> list[str]:
    """Return the names of the failed tests.

    Parameters
    ----------
    root : Path
        The checkout.
    part : str
        Name of a part; "*" for all parts.

    Returns
    -------
    list of str
        Names that the parts noted; none for a part that keeps no notes.
    """
    failed: set[str] = set()
    for notes in (root / PARTS).glob(f"{part}/{LAST_FAILED}"):
        failed.update(json.loads(notes.read_text()))
    return sorted(failed)


def not_judged(root: Path) -> dict[str, str]:
    """Return the files against the clock that this machine could not judge, each with what was measured."""
    notes = root / PARTS / CLOCK / NOTED
    return json.loads(notes.read_text()) if notes.is_file() else {}


def note_failed(root: Path, failed: list[str]) -> None:
    """Store the failed tests for a later ``rig test --lf``, which reads one place only."""
    notes = root / ".pytest_cache" / LAST_FAILED
    notes.parent.mkdir(parents=True, exist_ok=True)
    notes.write_text(json.dumps(dict.fromkeys(failed, True), indent=2))


def may_try_again(failed: list[str], clock: list[str]) -> bool:
    """Return True for failures in a few files, all of them among the tests that run against the clock."""
    return 0 < len({test.split("::")[0] for test in failed}) <= AT_MOST and set(failed) <= set(clock)
