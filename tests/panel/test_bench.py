# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the operator's page knows of the graph and of its rig, also of one that is gone, was started again, or never came up."""

import asyncio
import subprocess
import sys
import time
from collections import deque
from contextlib import closing
from types import SimpleNamespace

import pytest
from diagnostic_msgs.msg import DiagnosticStatus

from rig_nodes.controllers import allocate, environment
from rig_nodes.nodes.panel.bench import SILENT, Bench
from rig_nodes.nodes.panel.panel import Panel
from rig_nodes.nodes.panel.server import Socket
from rig_nodes.nodes.running_rig import RefusedByRig

GONE = "the rig has ended"


# In a process of its own: rclpy 7.1 can hang where one process has client, server and two executors of events.
RIG = """
import rclpy
from std_srvs.srv import Trigger

rclpy.init()
node, served = rclpy.create_node("rig"), []

def reset(_request, response):
    served.append(response)
    response.success, response.message = True, f"order {len(served)}"
    return response

node.create_service(Trigger, "/rig/reset", reset)
rclpy.spin(node)
"""


@pytest.mark.against_the_clock
def test_an_order_that_waits_for_a_rig_is_refused_with_its_end_and_not_given_to_the_next_one():
    with allocate() as domain, closing(Bench(domain.number)) as bench:
        waits = bench.trigger("/rig/reset")
        bench.forget(GONE)
        with pytest.raises(RefusedByRig, match=GONE):
            waits.result(20)
        next_one = subprocess.Popen([sys.executable, "-c", RIG], env=environment(domain))
        try:
            assert bench.trigger("/rig/reset").result(20) == "order 1"
            over = time.monotonic() + 20.0  # its publisher may be discovered after its service
            while "rig" not in bench.holders() and time.monotonic() < over:
                time.sleep(0.01)
            assert bench.holders()["rig"]
        finally:
            next_one.kill()
            next_one.wait()


ENDED = "no sequence runs; the last one ended early: the rig is in its safe state"


@pytest.mark.parametrize(
    ("says", "level", "age", "running", "text"),
    [
        ("runs 'demo', step 3 of 14: wait, until 'n' > 3", DiagnosticStatus.OK, 0.0, True, "wait, until 'n' > 3"),
        ("runs 'it's', its first step", DiagnosticStatus.OK, 0.0, True, "its first step"),
        ("no sequence runs", DiagnosticStatus.OK, 0.0, False, ""),
        (ENDED, DiagnosticStatus.WARN, 0.0, False, ENDED),
        ("runs 'demo', step 3 of 14: wait", DiagnosticStatus.OK, SILENT + 1.0, False, ""),
    ],
    ids=["a step", "a name with a quote", "none", "one that failed", "a sequencer that is gone"],
)
def test_a_sequence_runs_whoever_has_started_it_as_long_as_the_sequencer_says_so(says, level, age, running, text):
    word = DiagnosticStatus(message=says, level=level)
    found = Bench.progress.fget(SimpleNamespace(health={"sequencer": (time.monotonic() - age, word)}))
    assert (found["running"], found["text"]) == (running, text)
    assert not text.startswith("wait, ") or (found["step"], found["steps"]) == (3, 14)


def test_a_device_that_says_nothing_any_more_is_stale():
    now, ok = time.monotonic(), DiagnosticStatus(message="on")
    bench = SimpleNamespace(health={"motor": (now - SILENT - 1.0, ok), "load": (now, ok)})
    assert {name: old for name, (_, old) in Bench.said(bench).items()} == {"load": False, "motor": True}


class Fake(SimpleNamespace):
    """A bench in whose graph nothing is."""

    failure, health, progress = None, {}, {"running": False, "text": ""}

    def __init__(self):
        super().__init__(records=deque(), changed=deque(), refused=[])

    def take(self):
        return {}

    def nodes(self):
        return []

    holders = said = dict

    def forget(self, why):
        self.refused.append(why)


def test_a_first_start_that_fails_can_be_tried_again():
    async def looked():
        own = SimpleNamespace(ended=True, how="the rig has ended with exit code 2; the terminal says why", rig="mine")
        panel, told = Panel(Fake(), 7, own), []
        panel.tell = told.append
        for _ in range(20):
            panel.tick()
        own.start = lambda: setattr(own, "ended", False)
        panel.start(own)
        await panel.close()
        return [one for one in told if one["kind"] == "state"]

    failed, starts = asyncio.run(looked())
    assert failed["start"] is True and failed["reason"].startswith("the rig has ended with exit code 2")
    assert not starts.get("start") and starts["reason"] == "the rig is starting"


def test_a_browser_that_does_not_read_is_dropped_and_told_when_it_comes_again(monkeypatch):
    from rig_nodes.nodes.panel import page as pages

    closed, sent, now = [], [], [100.0]
    monkeypatch.setattr(pages.time, "monotonic", lambda: now[0])
    stream = SimpleNamespace(close=lambda: closed.append("stream"), socket=SimpleNamespace(setsockopt=lambda *_: None))
    socket = SimpleNamespace(
        write_message=lambda data, binary: sent.append(data) or asyncio.Future(loop=loop),
        close=lambda *why: closed.append(why),
        ws_connection=SimpleNamespace(stream=stream),
        panel=SimpleNamespace(pages=set(), wish=lambda: None, greet=lambda page: None),
        told={},
        _name="mine",
    )
    loop = asyncio.new_event_loop()
    socket.page = page = pages.Page(socket)
    page.tell({"kind": "first"})
    now[0] += pages.STUCK - 1.0
    page.tell({"kind": "second"})
    assert not page.dropped and len(sent) == 1
    now[0] += 2.0
    page.send_texts()
    assert page.dropped and closed == [pages.SLOW, "stream"]
    Socket.on_close(socket)
    sent.clear()
    Socket.open(socket)
    assert pages.SLOW[1] in sent[0] and "connected again" in sent[0]
    loop.close()
