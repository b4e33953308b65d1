# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The live view: its contents in early and late viewers, its limits of memory, its subscriptions, its end."""

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest
from pixels import LONGEST, curve_pixels, dots, image_of, lanes, of_state, text_pixels

from rig_nodes.bags.reader import Bag
from rig_nodes.cli.main import main
from rig_nodes.controllers.ros.domain import allocate
from rig_nodes.rig.configuration import load_rig
from rig_nodes.view import live, picture, viewer
from rig_nodes.view.live import Sender, Server, live_topics
from rig_nodes.view.pages import Pages

CATALOGUE = load_rig("hydmag").catalogue

SAMPLE = Path(__file__).parents[2] / "bags" / "sample"
BRIEF = Path(__file__).parents[1] / "graph" / "brief.yaml"
PATIENCE = 60.0
PAGES = Pages(load_rig("hydmag").as_dict())


def plots(*groups):
    """Returns (name of the view, signals) of plots."""
    return [(f"{title} [{PAGES.signal(names[0]).display_unit}]", names) for group in groups for title, names in group]


RUN, OTHER = plots(PAGES.run_left, PAGES.run_right), plots(PAGES.other_plots)
SLIPS = [PAGES.colour(name) for name in dict(RUN)["Slip [rpm]"]]
needs_driver = pytest.mark.skipif(picture.software_driver() is None, reason=picture.NO_DRIVER)


def headless(url):
    """Returns a viewer with a window as small as its legends allow, because the time to draw it grows with its area."""
    return picture.HeadlessViewer(url, size=(1000, 1100), longest=LONGEST)


def until(predicate, what):
    deadline = time.monotonic() + PATIENCE
    while not (value := predicate()):
        assert time.monotonic() < deadline, f"waited {PATIENCE:g} s for {what}"
        time.sleep(0.02)
    return value


@pytest.fixture
def server():
    """Starts servers, which end with the test."""
    started = []

    def start(*arguments, **keywords):
        started.append(Server(*arguments, **keywords))
        return started[-1]

    yield start
    for one in started:
        one.close()


@pytest.fixture(scope="module")
def messages(recorded):
    """Returns (time [ns], topic, data) of the demo run's messages that the live view shows."""
    return Bag(recorded).timeline([topic.name for topic in live_topics(PAGES)])


def feed(sender, messages):
    """Passes messages to the sender, never more than the queue can hold."""
    for begin in range(0, len(messages), 2000):
        for _, topic, data in messages[begin : begin + 2000]:
            sender.put(topic, data)
        until(lambda: not sender.waiting, "the sender to send")


def spans(viewer):
    """Returns (first, newest) time [ns] of each recording of a viewer that holds any data."""
    return [(t.start, t.end) for recording in viewer.state().recordings for t in recording.timelines]


FIRST_TAB = {name for name, _ in RUN} | {"States", "Report", "Events"}


def seen(viewer, end, shown=frozenset(("Slip [rpm]", "States"))):
    """Returns pictures of some views of the first tab by name, when the viewer has everything up to a time [s]."""
    until(lambda: [newest for _, newest in spans(viewer)] == [round(end * 1e9)], f"data up to {end} s")

    def slips():
        images = [image_of(image) for _, image in viewer.views("Slip [rpm]".__eq__)]
        return any(all(curve_pixels(image, colour, side="left") > 30 for colour in SLIPS) for image in images)

    until(slips, "the curves of the slip")
    return {name: image_of(image) for name, image in viewer.views(shown.__contains__)}


@needs_driver
def test_a_late_viewer_and_one_after_a_killed_one_see_the_newest(server, messages, recorded):
    one = server(None)
    sender = Sender(one.url, "test", PAGES)
    half = next(i for i, (t, _, _) in enumerate(messages) if t > 5_000_000_000)
    feed(sender, messages[:half])
    with headless(one.url) as viewer:
        assert seen(viewer, messages[half - 1][0] / 1e9)
        viewer.process.send_signal(signal.SIGKILL)
        viewer.process.wait()
        feed(sender, messages[half:])
    with headless(one.url) as viewer:
        end = messages[-1][0] / 1e9
        images = seen(viewer, end, FIRST_TAB)
        assert viewer.reports() == []
        listed = {view.name for view in viewer.state().views}
    assert listed == FIRST_TAB | {name for name, _ in OTHER}
    for name, names in RUN:
        for one_name in names:
            assert curve_pixels(images[name], PAGES.colour(one_name), side="left") > 30, one_name
            assert dots(images[name], PAGES.colour(one_name)), f"no legend of {one_name}"
    assert text_pixels(images["Report"]) > 200 and text_pixels(images["Events"]) > 200
    bars = lanes(images["States"])
    assert len(bars) == len(PAGES.states)
    bag = Bag(recorded)
    for bar, name in zip(bars, sorted(PAGES.states)):
        t, values = bag.series(name)
        shown = values[t > end - live.WINDOW]
        for number, label in CATALOGUE.signal(name).states.items():
            assert of_state(bar, name, label).mean() == pytest.approx((shown == number).mean(), abs=0.03), (name, label)
    assert sender.close(5.0) and not sender.failure
    assert (sender.received, sender.dropped, sender.lost, sender.unreadable) == (len(messages), 0, 0, 0)


def later_by(messages, seconds):
    """Returns the same messages at later times: stamps moved, numbers kept."""
    later = []
    for t, topic, data in messages:
        moved = t + round(seconds * 1e9)
        stamp = (moved // 10**9).to_bytes(4, "little") + (moved % 10**9).to_bytes(4, "little")
        later.append((moved, topic, data[:4] + stamp + data[12:]))
    return later


@needs_driver
def test_without_a_viewer_the_server_keeps_the_newest_and_stays_small(server, messages):
    one = server(None, memory="4MB")
    sender = Sender(one.url, "test", PAGES)
    length = messages[-1][0] / 1e9
    for number in range(2):
        feed(sender, later_by(messages, number * length))
    assert sender.close(10.0) and not sender.failure
    assert psutil.Process(one.process.pid).memory_info().rss < 150e6
    with headless(one.url) as viewer:
        images = seen(viewer, 2 * length)
        ((oldest, _),) = spans(viewer)
        assert oldest / 1e9 > 0.5 * length, "the oldest data should be gone"
    # layout, colours and legends are older than the dropped messages
    assert dots(images["Slip [rpm]"], SLIPS[1]) and len(lanes(images["States"])) == len(PAGES.states)


@pytest.mark.against_the_clock
def test_a_server_that_stands_still_costs_messages_but_no_time_and_no_memory(server, monkeypatch):
    messages = Bag(SAMPLE).timeline([topic.name for topic in live_topics(PAGES)])
    monkeypatch.setattr(live, "WAITING", 3000)
    one = server(None)
    sender = Sender(one.url, "test", PAGES)
    feed(sender, messages[:1000])
    one.process.send_signal(signal.SIGSTOP)
    rss, longest, count = psutil.Process().memory_info().rss, 0.0, 0
    deadline = time.monotonic() + PATIENCE
    while not sender.dropped and time.monotonic() < deadline:
        for _, topic, data in messages[:20000]:
            began = time.perf_counter()
            sender.put(topic, data)
            longest = max(longest, time.perf_counter() - began)
            count += 1
    assert sender.dropped and sender.waiting <= 3000
    assert sender.received == 1000 + count
    assert longest < 0.5
    assert psutil.Process().memory_info().rss - rss < 400e6
    began = time.monotonic()
    sender.close(0.5)
    assert time.monotonic() - began < 1.0
    one.process.kill()


def test_lost_and_unreadable_messages_are_counted(server):
    one = server(None)
    sender = Sender(one.url, "test", PAGES)
    whole = [data for _, data in Bag(SAMPLE).raw("/clutch_s1/p1")]
    for number, data in enumerate(whole):
        if number not in (7, 8, 20):
            sender.put("/clutch_s1/p1", data)
    sender.put("/clutch_s1/p1", b"\x00\x01\x00\x00short")
    sender.put("/rig/events", whole[0][:20] + b"\xff" * 8)
    assert sender.close(5.0)
    assert (sender.received, sender.dropped, sender.unreadable) == (len(whole) - 1, 0, 2)
    assert sender.lost == 1, "three missing, two of them explained by what could not be read"
    assert "2 unreadable" in sender.summary()


@needs_driver
def test_a_run_that_begins_anew_is_a_recording_of_its_own(server, messages):
    one = server(None)
    sender = Sender(one.url, "ROS domain 7", PAGES)
    short = [m for m in messages if m[0] < 3_000_000_000]
    feed(sender, short)
    feed(sender, short)
    assert sender.close(5.0) and not sender.failure
    with headless(one.url) as viewer:
        until(lambda: [newest for _, newest in spans(viewer)] == 2 * [short[-1][0]], "both recordings")


def test_a_port_in_use_is_refused(server):
    one = server(None)
    with pytest.raises(live.RigError, match=f"--port {one.port}: the port is in use"):
        Server(one.port)
    assert server(None).port != one.port, "without --port another is found"


def test_a_server_that_does_not_start_is_quoted(monkeypatch, tmp_path):
    bad = tmp_path / "rerun"
    bad.write_text("#!/bin/sh\necho out of order >&2\nexit 3\n")
    bad.chmod(0o755)
    monkeypatch.setattr(viewer, "program", lambda: str(bad))
    with pytest.raises(live.RigError, match=r"ended at once \(out of order\)"):
        Server()


def test_which_domain_is_meant_must_be_clear(monkeypatch, capsys):
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    for busy, sentence in ((set(), "no ROS domain is in use"), ({3, 5}, "ROS domains 3, 5 are in use")):
        monkeypatch.setattr("rig_nodes.controllers.busy_domains", lambda: busy)
        assert main(["view", "--live"]) == 2
        error = capsys.readouterr().err
        assert sentence in error and "--domain N" in error and len(error.splitlines()) == 1


class LiveCommand:
    """`rig view --live` in a process of its own, and a replay of the sample bag in its domain."""

    def __init__(self, folder, domain, *arguments):
        env = {key: value for key, value in os.environ.items() if key not in ("DISPLAY", "WAYLAND_DISPLAY")}
        env["ROS_DOMAIN_ID"] = str(domain.number)
        command = [sys.executable, "-P", "-m", "rig_nodes"]
        self.log = folder / "live.log"
        with open(self.log, "wb") as log:
            self.process = subprocess.Popen([*command, "view", "--live", *arguments], env=env, stdout=log, stderr=log)
        self.replay = subprocess.Popen(
            [*command, "replay", str(SAMPLE), "--loop"], env=env, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL
        )

    def output(self):
        return self.log.read_text()

    def family(self):
        return [psutil.Process(self.process.pid), *psutil.Process(self.process.pid).children(recursive=True)]

    def close(self):
        for process in (self.replay, self.process):
            if process.poll() is None:
                process.kill()
            process.wait()


@pytest.fixture
def live_command(tmp_path):
    with allocate() as domain:
        command = LiveCommand(tmp_path, domain)
        yield command
        command.close()


@pytest.mark.against_the_clock
@needs_driver
@pytest.mark.parametrize("number", [pytest.param(signal.SIGINT, marks=pytest.mark.campaign), signal.SIGTERM])
def test_it_shows_a_real_graph_listens_on_loopback_only_and_ends_in_time(live_command, number):
    address = re.compile(r"rerun (rerun\+http://127\.0\.0\.1:\d+/proxy)")
    url = until(lambda: address.search(live_command.output()), "the address")[1]
    with headless(url) as viewer:
        until(lambda: any(newest > 10**9 for _, newest in spans(viewer)), "a second of data")
        until(
            lambda: any(
                curve_pixels(image_of(image), PAGES.colour("p_p"), side="left") > 30
                for _, image in viewer.views(lambda name: name.startswith("Clutch and supply"))
            ),
            "the curve of the supply pressure",
        )
    family = live_command.family()
    tcp = [c for process in family for c in process.net_connections("tcp") if c.status == psutil.CONN_LISTEN]
    assert [c.laddr.ip for c in tcp] == ["127.0.0.1"]
    began = time.monotonic()
    live_command.process.send_signal(number)
    assert live_command.process.wait(PATIENCE) == 0
    assert time.monotonic() - began < 2.0
    counts = re.search(r"the live view ended: (\d+) messages, 0 dropped here, (\d+) lost", live_command.output())
    assert int(counts[1]) > 1000
    _, alive = psutil.wait_procs(family, timeout=5)
    assert not alive, "its server is left behind"


@pytest.mark.against_the_clock
def test_a_run_neither_waits_for_its_live_view_nor_ends_with_it(tmp_path):
    command = [sys.executable, "-P", "-m", "rig_nodes", "run", str(BRIEF), "--view", "--out", str(tmp_path / "run")]
    env = {key: value for key, value in os.environ.items() if key not in ("DISPLAY", "WAYLAND_DISPLAY")}
    run = subprocess.Popen(command, env=env, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    lines = []
    for line in run.stdout:
        lines.append(line)
        if "live view of ROS domain" in line:
            break
    view = next(p for p in psutil.Process(run.pid).children() if "--live" in p.cmdline())
    assert view.nice() > psutil.Process(run.pid).nice()
    family = [view, *view.children()]
    view.kill()
    rest, _ = run.communicate(timeout=60)
    assert run.returncode == 0, "".join(lines) + rest
    assert "end: the sequence ended" in rest and "messages lost: 0" in rest
    _, alive = psutil.wait_procs(family, timeout=5)
    assert not alive


def test_every_signal_is_on_a_live_topic():
    assert {signal.topic for signal in CATALOGUE.signals.values()} <= {topic.name for topic in live_topics(PAGES)}
    assert {"/rig/events", "/controller/events", "/sequencer/events"} <= {topic.name for topic in live_topics(PAGES)}
