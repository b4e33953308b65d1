# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The supervisor names a process that stands still, ends what cannot go on without it, and accuses none that it did not hear.

Its processes are stood in for by lines on which a thread reports; no node is started.
"""

import json
import os
import signal
import threading
import time
from types import SimpleNamespace

import pytest

from rig_nodes.base import RigError
from rig_nodes.nodes.processes import child, supervisor
from rig_nodes.nodes.processes.line import Line
from rig_nodes.nodes.processes.supervisor import Order, Supervisor
from rig_nodes.rig import STOOD_STILL


class StandIn:
    """What the supervisor sees of a process; it goes on until it is ``stopped`` or ended."""

    exit_code, log, life, silent = 0, "", 1, False

    def __init__(self, name, *_):
        self.name, self.orders, self.signals, self.stopped = name, [], [], False
        self.line, end = os.pipe()
        os.set_blocking(self.line, False)
        self.says, self._ended, self._end = Line(end), threading.Event(), end
        if name == "container":
            self.says.send("running", {})
        self._thread = threading.Thread(target=self._go_on, daemon=True)
        self._thread.start()

    def _go_on(self):
        while not self._ended.wait(0.02):
            if not self.stopped:
                self.says.send("alive", {})

    def messages(self):
        try:
            return [json.loads(line) for line in os.read(self.line, 65536).splitlines()]
        except BlockingIOError:
            return []

    def send(self, **order):
        self.orders.append(order)
        if "trip" in order:
            self.says.send("state", {"state": "TRIPPED", "reason": order["trip"], "trip": order["name"], "t": 1.0})

    def signal(self, number):
        self.signals.append(number)

    def finish(self, _seconds):
        self._ended.set()
        self._thread.join()
        return True

    def close(self):
        os.close(self.line)
        os.close(self._end)


@pytest.fixture
def watch(tmp_path, monkeypatch):
    """Runs a supervisor of stand-ins, with shorter limits; returns the end, the stand-ins and what was told."""
    monkeypatch.setattr(supervisor, "participants", lambda _number: 0)
    monkeypatch.setattr(supervisor, "environment", lambda _domain: {})
    monkeypatch.setattr(supervisor, "Child", StandIn)
    for name, seconds in (("LOOK", 0.05), ("STANDS", 0.4), ("FOR_GOOD", 0.8), ("GOES_ON", 0.5), ("AFTER_TRIP", 0.05)):
        monkeypatch.setattr(supervisor, name, seconds)

    def run(order, act, pause=0.0):
        told, paused = [], threading.Semaphore(0)

        def say(_t, text):
            told.append(text)
            if text == "pause":
                paused.release()
                time.sleep(pause)  # the length of the pause is the condition of the test
            if "time starts" in text:
                threading.Thread(target=act, args=(one, paused)).start()

        one = Supervisor(order, tmp_path, SimpleNamespace(number=1), say)
        thread = threading.Thread(target=one.run, daemon=True)
        thread.start()
        thread.join(20.0)
        assert not thread.is_alive(), "it waits for ever"
        return one.end, one.children, told

    return run


@pytest.mark.parametrize(
    "name, order, trips",
    [
        ("recorder", Order("demo", speed=1.0), 1),
        ("sequencer", Order(None, speed=1.0), 1),
        ("container", Order("demo", speed=1.0), 1),
        ("container", Order(None), 1),
        ("sequencer", Order("demo"), 2),
        ("alfa46", Order("demo", speed=1.0, step_timeout=0.1, come_timeout=0.2), 1),
    ],
)
def test_a_process_that_stands_still_for_good_is_named_and_ends_the_run_tripped(watch, name, order, trips):
    end, children, told = watch(order, lambda one, _: setattr(one.children[name], "stopped", True))
    assert (end.state, end.trip) == ("tripped", STOOD_STILL) and f"the {name} stands still for " in end.reason, end
    assert float(end.reason.split()[-2]) > 0.79
    assert [one["name"] for one in children["container"].orders if "trip" in one] == [STOOD_STILL] * trips
    assert children[name].signals[0] == signal.SIGCONT, "so that it can end in order"
    assert any("and ends after 0.8 s of that" in text for text in told) == (order.sequence is None and order.speed is None)


def test_a_controller_under_a_debugger_is_waited_for_without_limit(watch):
    def act(one, _):
        one.children["alfa46"].stopped = True
        time.sleep(1.0)  # longer than any limit
        one.stop()

    end, children, _ = watch(Order("demo", speed=1.0, step_timeout=None, come_timeout=None), act)
    assert end.reason == "stopped" and children["container"].orders == []


@pytest.mark.parametrize("speed", [None, 1.0])
def test_a_supervisor_that_could_not_write_accuses_nobody(watch, speed):
    def act(one, paused):
        for _ in range(3):
            one.children["container"].says.send("told", {"text": "pause"})
            paused.acquire()
        one.children["container"].says.send("end", {})

    end, children, told = watch(Order(None, speed=speed), act, pause=0.9)
    assert told.count("pause") == 3 and end.reason == "ended by hand" and children["container"].orders == []


def test_what_is_said_once_arrives_when_the_supervisor_reads_again():
    there, end = os.pipe()
    os.set_blocking(there, False)
    line, heard = Line(end), b""
    for _ in range(5000):
        line.send("alive", {})
    for text in ("one", "x" * 10_000, "three"):
        line.send("told", {"text": text})
    line.send("done", {"success": True})
    while b'"done"' not in heard:
        heard += os.read(there, 1 << 20)
        line.send("alive", {})
    said = [json.loads(text) for text in heard.splitlines()]
    assert [one.get("text", "")[:5] for one in said if one["kind"] != "alive"] == ["one", "xxxxx", "three", ""]
    os.close(there)
    line.send("alive", {})
    os.close(end)


def test_a_process_for_which_no_file_is_left_is_refused_in_a_sentence(tmp_path, monkeypatch):
    def full(**_):
        raise OSError(24, "Too many open files")

    monkeypatch.setattr(child, "start_server", lambda: None)
    monkeypatch.setattr(child, "get_context", lambda _kind: SimpleNamespace(Pipe=full))
    with pytest.raises(RigError, match=r"^recorder cannot be started \(Too many open files\)$"):
        child.Child("recorder", "rig_nodes.nodes.recorder", [], tmp_path, {})
