# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What comes and is not used: a flood prints a handful of lines, numbers too many or out of range are refused with the reason."""

import math
import socket
import threading
import time

import pytest

from rig_nodes.controllers import ControllerFailed, load_controller
from rig_nodes.controllers.ignored import REASONS, Ignored
from rig_nodes.controllers.udp.frames import ANSWER, HELLO, READY, Client, pack, unpack

from .conftest import ask

ZERO = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0))


def test_a_hundred_thousand_times_the_same_is_a_handful_of_lines_with_the_sum_at_the_end(monkeypatch):
    now, lines = [0.0], []
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    ignored = Ignored("udp:1", lines.append)
    for _ in range(100_000):
        now[0] += 6.0 / 100_000
        ignored.add("what came is no frame")
    ignored.conclude()
    assert len(lines) <= 5 and lines[0] == "udp:1: what came is no frame; it is not used, nor are others like it"
    assert lines[-1] == "udp:1: 100000 times in all something came that is not used: what came is no frame"
    assert ignored.counts == {"what came is no frame": 100_000}


def test_reasons_without_end_are_counted_together():
    lines = []
    ignored = Ignored("udp:1", lines.append)
    for number in range(100_000):
        ignored.add(f"a frame of {number} bytes")
    ignored.conclude()
    assert len(ignored.counts) == REASONS + 1 and sum(ignored.counts.values()) == 100_000
    assert len(lines) <= REASONS + 2 and "100000 times in all" in lines[-1]


def test_what_came_once_is_said_once():
    lines = []
    ignored = Ignored("udp:1", lines.append)
    ignored.add("one")
    ignored.conclude()
    assert lines == ["udp:1: one; it is not used, nor are others like it"]


# ---- UDP


@pytest.fixture
def udp(free_udp_port, config):
    """A plug with a controller by hand that is ready: its socket answers each sample with what ``plug.answering`` packs."""
    plug, over = load_controller(f"udp:{free_udp_port}", config), threading.Event()
    plug.reports = []
    plug.say = plug.reports.append
    peer = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    peer.connect(("127.0.0.1", free_udp_port))
    peer.settimeout(0.05)
    plug.answering = lambda session, frame: pack(ANSWER, session, frame, 0, 0, 0, 0, "", more=[0.25] + [0.0] * 5)

    def serve():
        peer.send(pack(HELLO, 0, 0, 3, 0, ""))
        while not over.is_set():
            try:
                kind, session, frame, _ = unpack(peer.recv(4096))
            except (TimeoutError, ConnectionRefusedError):
                continue
            peer.send(pack(READY, session, 0, 0, 0) if kind == 2 else plug.answering(session, frame))

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    plug.wait(20.0)
    yield plug
    over.set()
    thread.join()
    plug.close()
    peer.close()


def test_a_run_goes_on_under_a_flood_and_prints_few_lines(udp, free_udp_port):
    """Random junk, and frames of strangers that are right but not expected."""
    over, sent = threading.Event(), [0]

    def flood():
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
            while not over.is_set():
                for data in (b"x" * (sent[0] % 90), pack(ANSWER, udp._session, 1, 0, 0, 0, 0, ""), bytes(2000)):
                    stranger.sendto(data, ("127.0.0.1", free_udp_port))
                    sent[0] += 1

    thread = threading.Thread(target=flood, daemon=True)
    thread.start()
    try:
        answers, end = [], time.monotonic() + 30.0
        while (len(answers) < 100 or sent[0] <= 300 or sum(udp.ignored.counts.values()) <= 50) and time.monotonic() < end:
            answers.append(udp.step(len(answers), *ZERO))  # as many as the flood needs to become one, whoever got the processor
    finally:
        over.set()
        thread.join()
    assert {answer.command for answer in answers} == {(0.25, 0.0, 0.0)}
    counted = sum(udp.ignored.counts.values())
    udp.close()
    assert sent[0] > 300 and counted > 50 and udp.record()["ignored"] == udp.ignored.counts
    lines = [text for text in udp.reports if "not used" in text]
    assert 0 < len(lines) <= REASONS + 5 and " in all something came that is not used" in lines[-1]
    assert any("an answer came from a program that is not the controller" in text for text in lines)


@pytest.mark.parametrize(
    ("status", "gear", "shifting", "flags", "numbers", "sentence"),
    [
        (0, 0, 0, 0, [0.1] * 7, "its answer has 7 numbers, expected 6: command and setpoint of 3 outputs"),
        (0, 0, 0, 0, [0.1] * 5, "its answer has 5 numbers, expected 6"),
        (0, 0, 0, 0, [math.nan] + [0.0] * 5, r"command\[0\] is nan"),
        (0, 0, 0, 0, [0.0] * 5 + [math.inf], r"setpoint\[2\] is inf"),
        (0, 9, 0, 0, [0.1] * 6, "gear is 9, expected 0"),
        (0, 0, 7, 0, [0.1] * 6, "shifting is 7, expected True or False"),
        (0, 0, 0, 8, [0.1] * 6, "flags is 8, expected 0 to 7"),
        (4, 0, 0, 0, [0.1] * 6, "status is 4, expected 0"),
    ],
)
def test_an_answer_with_other_numbers_than_the_record_is_refused_with_the_reason(
    udp, status, gear, shifting, flags, numbers, sentence
):
    udp.answering = lambda session, frame: pack(ANSWER, session, frame, status, gear, shifting, flags, "", more=numbers)
    with pytest.raises(ControllerFailed, match=f"sample 0: {sentence}"):
        ask(udp)


def test_a_controller_program_prints_few_lines_of_what_it_cannot_use(capsys):
    """Frames of another rig's record, of an unknown level, and junk."""

    class Never:
        """A controller that must not be called."""

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as rig:
        rig.bind(("127.0.0.1", 0))
        client = Client(Never(), "127.0.0.1", rig.getsockname()[1])
        client.run()
        _, peer = rig.recvfrom(4096)
        rig.sendto(pack(2, 5, 0, 3, 0, 0, 0, 0, 0, 1e-3, 1.0, ""), peer)
        client.run()
        client.session, client.running, client.outputs = 5, True, ["output_1"]
        for number in range(150):
            rig.sendto(pack(6, 5, number + 1, 0, 0.0, 0, 0, more=[0.0] * 9), peer)
            client.run()
        client.socket.close()
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "frame 1 that is ignored: the run is at level 3, which is neither duty (1) nor current (2)"
    assert lines[1:] == [f"frame {n} that is ignored: a sample has 9 numbers, expected 1" for n in (10, 100)]


# ---- the seam, whatever the plug


@pytest.mark.parametrize(
    ("step", "sentence"),
    [
        ("return Out([0.1] * 3, [0.1] * 3 + [0.2])", "setpoint has 4 numbers, expected 3"),
        ("return Out([0.1] * 3, [float('nan')] * 3)", r"setpoint\[0\] is nan"),
        ("return Out(shifting=2)", "shifting is 2, expected True or False"),
        ("return Out(shifting='no')", "shifting is 'no', expected True or False"),
        ("return Out(flags=1.5)", "flags is 1.5, expected 0 to 7"),
        ("return Out(signals={'slip': 1.0, 'more': 2.0})", "signals has 'more', which is none of the signals .*: slip"),
    ],
)
@pytest.mark.parametrize("level", ["duty", "current"])
def test_no_number_too_many_or_out_of_range_is_taken_silently(python_controller, level, step, sentence):
    plug = python_controller(step, 'levels = ("duty", "current")\n    signals = ("slip",)', level)
    with pytest.raises(ControllerFailed, match=f"sample 0: {sentence}"):
        ask(plug)


def test_signals_that_were_not_declared_are_refused(python_controller):
    with pytest.raises(ControllerFailed, match="signals has 'slip', which is none of the signals that it has declared: none"):
        ask(python_controller("return Out(signals={'slip': 1.0})"))


def test_a_signal_without_a_value_is_recorded_and_said_once(python_controller):
    plug, lines = python_controller("return Out(signals={'slip': float('nan')})", 'signals = ("slip",)'), []
    plug.say = lines.append
    for sample in range(5):
        assert ask(plug, sample) is not None and math.isnan(plug.signal_values[0])
    plug.close()
    assert lines[0].endswith("its signal slip is nan; it is recorded as it is, as are others like it")
    assert plug.record()["ignored"] == {"a value of its signal slip is no finite number": 5}
    assert len(lines) == 2 and "5 times in all" in lines[1]
