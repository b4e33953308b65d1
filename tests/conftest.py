# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""No test hangs: one that takes far longer than the slowest is failed, and where Python cannot, its process ends."""

import faulthandler
import os
import signal
import threading

import pytest

LIMIT = 240.0  # s for a test, or for what is made before it; the slowest takes a minute on a busy machine
MORE = 60.0  # s after which a process that does not even take the failure shows where it stands, and ends


def pytest_configure(config):
    # while tests run, pytest keeps what is written there; whoever ends so suddenly must be seen
    config.stderr_of_all = os.dup(2)
    signal.signal(signal.SIGUSR2, _too_long)


def pytest_unconfigure(config):
    os.close(config.stderr_of_all)


def _too_long(*_):
    pytest.fail(f"it was not done after {LIMIT:g} s: it hangs")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup(item):
    return (yield from _bounded(item))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item):
    return (yield from _bounded(item))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown(item):
    return (yield from _bounded(item))


def _bounded(item):
    if item.get_closest_marker("campaign"):
        return (yield)
    # not SIGALRM, by which a controller of the user's own is bounded in the rig's process
    failing = threading.Timer(LIMIT, signal.pthread_kill, (threading.main_thread().ident, signal.SIGUSR2))
    failing.daemon = True
    failing.start()
    faulthandler.dump_traceback_later(LIMIT + MORE, exit=True, file=item.config.stderr_of_all)
    try:
        return (yield)
    finally:
        failing.cancel()
        faulthandler.cancel_dump_traceback_later()
