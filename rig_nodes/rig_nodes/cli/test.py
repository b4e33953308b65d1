# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rig test`: pytest on the checkout's tests, with ROS field checks on; all of them in parts, side by side.

What failed against the clock runs again when nothing else does.
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
from rig_nodes.errors import RigError, ended_by

HELP = "run the tests"
PASSES_ON = True
# The mark of tests of processes in real time: on a machine that stalls for a tenth of a second the rig they look at
# rightly goes to its safe state. They run one after the other, and their files get further chances, in a process of their
# own when nothing else runs; that is said. Failures are counted by file, because the tests of a file often share one
# graph. A graph in lockstep, a replay, or a program that only refuses waits for nobody's clock and bears no mark.
AGAINST_THE_CLOCK = "against_the_clock"
ONLY_CLOCK = f"{AGAINST_THE_CLOCK} and not campaign"
AT_MOST = 8  # files that get further chances; more are no accident
CHANCES = 2  # further ones, of a file
# Folders whose processes wait for each other with limits of time: they come first, in so many parts.
FIRST = {"controllers": 2, "graph": 1, "fmu": 1}
# The others only compute. Of the processor they take what these leave, which is little, and half of it beside the tests
# against the clock, at the lowest priority there is (SCHED_IDLE; a nice value is not enough): the longest are not to be
# left to the end, nor those whose processes have limits of time too to begin. Short folders are one part with others: to
# begin one costs two seconds.
BESIDE = ("plant", "tune", "testbench", "description", "view", "the rest", "validation")
MOST_PARTS = 4  # at a time; each takes up to 1 GB, and waits for its own processes for a part of its time
PASSED, FAILED, NOTHING_THERE = 0, 1, 5  # exit codes of pytest
PARTS, LAST_FAILED, CLOCK = ".pytest_cache/parts", "v/cache/lastfailed", "clock"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of the verb."""
    parser.usage = "rig test [pytest arguments]"
    parser.epilog = (
        "Without a path all of tests/ runs, apart from what is marked 'campaign'. "
        "Everything given is passed to pytest: 'rig test -x -k valve', 'rig test tests/plant'. "
        "Without arguments, folders run side by side on this machine's cores, and after some of them what "
        "runs against the clock; files that failed against the clock, up to 8, are tried up to twice more and named."
    )


def tests_root() -> Path:
    """The checkout that holds the tests; raises RigError where rig_nodes was installed without one."""
    root = Path(rig_nodes.__file__).resolve().parents[2]
    if not (root / "pytest.ini").is_file():
        raise RigError(f"no tests beside {root}: 'rig test' works in a checkout only")
    return root


def main(args: argparse.Namespace) -> int:
    """Run what is asked for by pytest, or all parts side by side; pytest's exit code."""
    root = tests_root()
    # a script's background ignores it, in all that is started there too, and a test that sends it would wait for ever
    signal.signal(signal.SIGINT, signal.default_int_handler)
    command = [sys.executable, "-m", "pytest", "--rootdir", str(root), "-c", str(root / "pytest.ini")]
    print("rig: " + " ".join(["ROS_PYTHON_CHECK_FIELDS=1", "pytest", *args.passed_on]), flush=True)
    # Message setters do not check types by default and send garbage; in tests a wrong type must be an error.
    env = dict(os.environ, ROS_PYTHON_CHECK_FIELDS="1")
    try:
        if args.passed_on:
            # Paths given are the caller's; without any, pytest.ini's testpaths count from the checkout.
            paths = [a.split("::")[0] for a in args.passed_on if not a.startswith("-")]
            given = any((Path.cwd() / p).exists() for p in paths)
            return subprocess.run([*command, *args.passed_on], env=env, cwd=None if given else root).returncode
        return _all(root, command, env)
    except KeyboardInterrupt as stop:
        return ended_by(stop)[1]


def _all(root: Path, command: list[str], env: dict[str, str]) -> int:
    """Every test: some folders side by side, then those against the clock, the others beside both; then a second chance."""
    began, counts, codes = time.monotonic(), Counter(), []
    shutil.rmtree(root / PARTS, ignore_errors=True)  # pytest would keep what failed once and has another name now
    subprocess.run([sys.executable, "-m", "rig_nodes.testbench.preloaded"], env=env, cwd=root)  # or two would compile
    first, beside, clock = parts_of(root)
    cores = len(os.sched_getaffinity(0))
    at_a_time = min(cores + 1, MOST_PARTS)
    print(
        f"rig: {len(first)} parts, {at_a_time} at a time, each shown when it is done; then {len(clock)} files against the "
        f"clock; beside all these {len(beside)} parts, shown at the end",
        flush=True,
    )

    def begin(name: str, mark: str, *arguments: str) -> subprocess.Popen:
        # with one folder for all, notes would be lost
        own = ["--no-header", "-m", mark, "-o", f"cache_dir={root / PARTS / name}"]
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
        print(f"rig: {name}\n{output}", end="", flush=True)
        counts.update(counted(output))
        codes.append(code)

    # beside the clock one at a time: two fill the caches of a rig in real time and get no more of the processor
    with (
        ThreadPoolExecutor(at_a_time) as together,
        ThreadPoolExecutor(1) as below,
        ThreadPoolExecutor(min(cores, MOST_PARTS)) as after,
    ):
        try:
            others = {name: below.submit(run, name, True) for name in beside}
            for name, (output, code) in zip(first, together.map(run, first)):
                show(name, output, code)
            if clock:
                print("rig: against the clock", flush=True)
                process, line = begin(CLOCK, ONLY_CLOCK, "-v", *clock), ""
                for line in process.stdout:
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
    failed = failed_tests(root)
    note_failed(root, failed)
    total = ", ".join(f"{counts[what]} {what}" for what in ("failed", "error", "passed", "skipped") if counts[what])
    print(f"rig: {total} in {time.monotonic() - began:.0f} s", flush=True)
    code = next((code for code in codes if code not in (PASSED, FAILED, NOTHING_THERE)), int(FAILED in codes))
    if code != FAILED or not may_try_again(failed, failed_tests(root, CLOCK)):
        return code
    print("rig: what failed runs against the clock; once more, file by file: " + ", ".join(failed), flush=True)
    files = sorted({test.split("::")[0] for test in failed})
    codes = {file: _again([*command, "-m", ONLY_CLOCK, file], env, root) for file in files}
    still = [file for file in files if codes[file] != PASSED]
    print(f"rig: failed the first time: {', '.join(failed)}; " + (f"failed again: {', '.join(still)}" if still else "passed then"))
    return max(codes.values())


def _again(command: list[str], env: dict[str, str], root: Path) -> int:
    """Exit code of the first of CHANCES further goes that passes, or of the last."""
    for _ in range(CHANCES):
        code = subprocess.run(command, env=env, cwd=root).returncode
        if code == PASSED:
            break
    return code


def parts_of(root: Path) -> tuple[dict[str, list[str]], dict[str, list[str]], list[str]]:
    """Files of the parts that run first and of those that run beside all else, by the parts' names; files of which
    some tests run against the clock.
    """
    files = sorted(path.relative_to(root).as_posix() for path in (root / "tests").rglob("test_*.py"))
    # the other way round: what a rig in description/ has to compile is compiled beside the graph's tests
    clock = [file for file in reversed(files) if f"mark.{AGAINST_THE_CLOCK}" in (root / file).read_text(encoding="utf-8")]
    folders: dict[str, list[str]] = {}
    for file in files:
        folders.setdefault(file.split("/")[1], []).append(file)
    first = {
        f"{name}-{k + 1}" if count > 1 else name: folders[name][k::count]
        for name, count in FIRST.items()
        if name in folders
        for k in range(count)
    }
    beside = {name: folders.get(name, []) for name in BESIDE}
    for name in sorted(folders.keys() - FIRST.keys() - beside.keys()):
        beside["the rest"] += folders[name]
    return first, {name: files for name, files in beside.items() if files}, clock


def counted(output: str) -> Counter:
    """What pytest's last line counts, e.g. "2 failed, 30 passed in 3.10s"."""
    last = output.strip().rpartition("\n")[2]
    return Counter({what: int(number) for number, what in re.findall(r"(\d+) (failed|passed|skipped|error)s?\b", last)})


def failed_tests(root: Path, part: str = "*") -> list[str]:
    """The tests that the parts, or one of them, have noted as failed, by name; none where they keep no notes."""
    failed: set[str] = set()
    for notes in (root / PARTS).glob(f"{part}/{LAST_FAILED}"):
        failed.update(json.loads(notes.read_text()))
    return sorted(failed)


def note_failed(root: Path, failed: list[str]) -> None:
    """For a later ``rig test --lf``, which looks at one place only."""
    notes = root / ".pytest_cache" / LAST_FAILED
    notes.parent.mkdir(parents=True, exist_ok=True)
    notes.write_text(json.dumps(dict.fromkeys(failed, True), indent=2))


def may_try_again(failed: list[str], clock: list[str]) -> bool:
    """True for failures in a few files, all of them among those against the clock."""
    return 0 < len({test.split("::")[0] for test in failed}) <= AT_MOST and set(failed) <= set(clock)
