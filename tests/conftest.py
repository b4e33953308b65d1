# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Time limits of the tests: a test far longer than the slowest fails, and where Python cannot stop it, its process is ended.

What a failed test or fixture has started is ended. No two tests use the fixed ports of the templates at the same time.
"""

import contextlib
import faulthandler
import gc
import os
import signal
import socket
import subprocess
import threading
import time

import pytest

LIMIT = 240.0  # s for a test, or for its fixtures; the slowest takes a minute on a busy machine
LIMIT_OF_CAMPAIGN = 4 * 3600.0  # s for what is marked so; the longest, tests/graph/test_an_hour_by_hand.py, takes an hour
# Factor for tests at the lowest priority, at which `rig test` runs some parts: on a machine that is four times slower than
# usual, a test that compiles has waited 16 minutes for its core.
AT_LOWEST = 10
MORE = 60.0  # further s after which a process that does not react to the failure prints its place in the code and ends


@pytest.fixture
def on_own_port():
    """Replaces the fixed port by a free one in a command (list of words) that `controller new` prints."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp, socket.socket() as tcp:
        for one in (udp, tcp):
            one.bind(("127.0.0.1", 0))
        ports = {"udp:9002": udp.getsockname()[1], "modbus:5020": tcp.getsockname()[1]}

    def moved(kind: str, command: list[str], program: str = "") -> list[str]:
        """Returns the command for a template of a kind; ``program`` is the file of a template whose port is in the file."""
        words = [f"{word.partition(':')[0]}:{ports[word]}" if word in ports else word for word in command]
        if words[-1] == "&" and kind.startswith("udp-"):
            words[-1:] = ["127.0.0.1", str(ports["udp:9002"]), "&"]
        if words[-1] == "&" and kind == "modbus":
            with open(program, encoding="utf-8") as file:
                text = file.read()
            with open(program, "w", encoding="utf-8") as file:
                file.write(text.replace("port=5020", f"port={ports['modbus:5020']}"))
        return words

    return moved


@pytest.fixture
def small_disk(tmp_path):
    """Makes disks of a size [kB], each a folder that is gone at the end of its block."""

    @contextlib.contextmanager
    def made(size: int):
        disk = tmp_path / "disk"
        disk.mkdir(exist_ok=True)
        mounted(disk, "-t", "tmpfs", "-o", f"size={max(1, size)}k", "tmpfs")
        try:
            yield disk
        finally:
            subprocess.run(["umount", str(disk)], check=True)

    return made


@pytest.fixture
def read_only():
    """Makes folders read-only until the test's end; files that are open there go on being written, as after chmod."""
    made = []

    def make(folder):
        mounted(folder, "-o", "bind,ro", str(folder))  # at once: a file that is made between two steps would keep it writable
        made.append(folder)

    yield make
    for folder in made:
        subprocess.run(["umount", str(folder)], check=True)


@pytest.fixture
def soon_done(request):
    """Makes blocks that fail when they take more than so many seconds of wall clock, so much more at the lowest priority."""
    return lambda limit: _ends_in(limit * (AT_LOWEST**2 if at_lowest() else 1), request.config)


def mounted(folder, *arguments: str) -> None:
    """Mounts something at a folder, or skips the test."""
    if subprocess.run(["mount", *arguments, str(folder)], capture_output=True).returncode:
        pytest.skip("this user may not mount a disk")


def at_lowest() -> bool:
    """Returns whether these tests run at the lowest priority."""
    return os.sched_getscheduler(0) == os.SCHED_IDLE


def pytest_configure(config):
    # pytest captures stderr while tests run; what a process prints before such a sudden end must be visible
    config.stderr_of_all = os.dup(2)
    signal.signal(signal.SIGUSR2, _too_long)


def pytest_unconfigure(config):
    os.close(config.stderr_of_all)


@pytest.hookimpl(wrapper=True)
def pytest_collection(session):
    began = time.monotonic()
    try:
        return (yield)
    finally:
        session.config.collecting = time.monotonic() - began


def pytest_collection_finish():
    # what the tests have loaded stays; to look through it again and again would take a fifth of the time of tests of large files
    gc.collect()
    gc.freeze()
    gc.set_threshold(50_000, 20)


def pytest_terminal_summary(terminalreporter, config):
    terminalreporter.write_line(f"collection took {config.collecting:.1f} s")  # `rig test` adds these up


def _too_long(*_):
    pytest.fail("it was not done in its time: it hangs")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup(item):
    return (yield from _bounded(item))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item):
    with _nothing_left():
        return (yield from _bounded(item))


@pytest.hookimpl(wrapper=True)
def pytest_fixture_setup():
    with _nothing_left():
        return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown(item):
    return (yield from _bounded(item))


def _bounded(item):
    limit = LIMIT_OF_CAMPAIGN if item.get_closest_marker("campaign") else LIMIT
    with _ends_in(limit * (AT_LOWEST if at_lowest() else 1), item.config):
        return (yield)


@contextlib.contextmanager
def _ends_in(limit, config):
    """Fails the test in whose block more than ``limit`` s of wall clock pass, also where it only waits."""
    # not SIGALRM, which limits the time of a user's controller in the rig's process
    failing = threading.Timer(limit, signal.pthread_kill, (threading.main_thread().ident, signal.SIGUSR2))
    failing.daemon = True
    failing.start()
    faulthandler.dump_traceback_later(limit + MORE, exit=True, file=config.stderr_of_all)
    try:
        yield
    finally:
        failing.cancel()
        faulthandler.cancel_dump_traceback_later()


@contextlib.contextmanager
def _nothing_left():
    """Ends the processes that were started in the block when it fails, because what would have ended them may not be reached."""
    before = set(_children(os.getpid()))
    try:
        yield
    except BaseException:
        left = [pid for pid in _children(os.getpid()) if pid not in before]
        for pid in left:
            left += _children(pid)
        for pid in left:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        raise


def _children(pid: int) -> list[int]:
    found, tasks = [], f"/proc/{pid}/task"  # texts: this is asked with each test and fixture, and a Path takes twice the time
    with contextlib.suppress(OSError):  # the process has ended
        for task in os.listdir(tasks):
            with contextlib.suppress(OSError), open(f"{tasks}/{task}/children", encoding="ascii") as file:  # the thread has ended
                found += map(int, file.read().split())
    return found
