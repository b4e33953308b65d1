# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A Python class runs in a process of its own: whatever it does there is one sentence here, and nothing remains of it."""

import json
import os
import signal

import pytest

from rig_nodes.bags.reader import Bag
from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import main
from rig_nodes.controllers import ControllerFailed, hosted, load_controller

from .conftest import ask
from .test_own_process import is_gone

FRAME = """
import os, signal, sys, threading, time
from rig_nodes.controllers import ControllerOutputs as Out, Status
TOP
class Mine:
    def initialize(self, info):
        INITIALIZE
    def step(self, inputs):
        if inputs.sample == 3:
            STEP
        return Out([0.5, 0.0, 0.0], gear=inputs.gear_request)
    def terminate(self):
        TERMINATE
"""
STAYS = "time.sleep(1000)"


@pytest.fixture
def controller(tmp_path, config):
    """Loads a class that does something on import, or in one of its calls, in the step at sample 3."""

    def make(in_process=False, **what):
        text = FRAME
        for place in ("TOP", "INITIALIZE", "STEP", "TERMINATE"):
            text = text.replace(place, what.get(place.lower(), "pass"))
        (tmp_path / "mine.py").write_text(text)
        return load_controller(f"python:{tmp_path / 'mine.py'}:Mine{'@in-process' if in_process else ''}", config)

    return make


def failed(plug):
    """Asks for samples until the plug fails at sample 3; returns the end of its sentence."""
    for sample in range(3):
        ask(plug, sample)
    with pytest.raises(ControllerFailed) as failure:
        ask(plug, 3)
    text, begin = str(failure.value), f"controller {plug.name}, sample 3: "
    assert text.startswith(begin) and len(text) < 1500 and text.isprintable()
    plug.close()
    assert is_gone(plug.process_id, 0.0)
    return text.removeprefix(begin)


@pytest.mark.parametrize(
    ("step", "sentence"),
    [
        ("os._exit(0)", "the controller's process ended itself with exit code 0"),
        ("os.execv('/bin/true', ['true'])", "the controller's process ended itself with exit code 0"),
        ("import ctypes; ctypes.string_at(8)", "the controller's process was ended by SIGSEGV (segmentation fault)"),
        ("os.kill(os.getpid(), signal.SIGTERM)", "the controller's process was ended by SIGTERM (terminated)"),
        ("os.kill(os.getpid(), 35)", "the controller's process was ended by signal 35 (real-time signal 1)"),
        ("os.kill(os.getpid(), 32)", "the controller's process was ended by signal 32"),
        ("os.killpg(0, signal.SIGKILL)", "the controller's process was ended by SIGKILL (killed)"),
        ("os.closerange(0, 1024)", "the controller has closed or changed the rig's line to it"),
        (
            "[os.write(fd, b'garbage') for fd in range(3, 1024) if os.path.exists(f'/proc/self/fd/{fd}')]",
            "the controller wrote 7 bytes of its own into the rig's line to it",
        ),
        ("raise GeneratorExit", "step failed: mine.py line 10: GeneratorExit"),
        ("raise KeyboardInterrupt", "step failed: mine.py line 10: KeyboardInterrupt"),
        ("raise type('Bad', (Exception,), {'__str__': lambda self: 1 / 0})", "step failed: mine.py line 10: Bad"),
        ("sys.stdout.close(); print('x')", "step failed: mine.py line 10: ValueError: I/O operation on closed file."),
        (
            "input()",
            "step failed: mine.py line 10: EOFError: EOF when reading a line; it has no terminal: a debugger works with "
            "--in-process, also --step-timeout none",
        ),
        ("inputs.measured[0] = 1.0", "step failed: mine.py line 10: TypeError: 'tuple' object does not support item assignment"),
        (
            "import resource; print(len(bytearray(resource.getrlimit(resource.RLIMIT_DATA)[0])))",
            "step failed: mine.py line 10: MemoryError",
        ),
    ],
)
def test_what_a_class_does_to_its_process_is_a_sentence(controller, step, sentence):
    assert failed(controller(step=step)) == sentence


@pytest.mark.parametrize(
    "step",
    [
        "raise ValueError('x' * 10_000_000 + chr(27))",
        "return Out(status=Status.ERROR, message='x' * 10_000_000)",
        "return Out(command='x' * 10_000_000)",
    ],
)
def test_a_text_of_10_mb_is_cut(controller, step):
    assert failed(controller(step=step)).endswith(" characters)")


@pytest.mark.parametrize("step", ["while True: pass", "sum(iter(int, 1))", "os.kill(os.getpid(), signal.SIGSTOP)"])
def test_a_step_without_end_is_ended(controller, step):
    plug = controller(step=step)
    plug.pace(0.2)
    assert failed(plug) == "no answer for 200 ms (--step-timeout)"


@pytest.mark.parametrize(
    ("place", "what", "sentence"),
    [
        ("top", "os._exit(0)", "the controller's process ended itself with exit code 0 while it was loaded"),
        ("top", "sys.exit(3)", "the code cannot be loaded: mine.py line 4: SystemExit: 3"),
        ("top", "while True: pass", "no answer for 0.5 s while it was loaded"),
        ("initialize", "os._exit(3)", "the controller's process ended itself with exit code 3 in initialize"),
        ("initialize", "raise KeyboardInterrupt", "initialize failed: mine.py line 7: KeyboardInterrupt"),
        ("initialize", "while True: pass", "no answer for 0.5 s in initialize"),
        ("initialize", "raise ValueError('x' * 10_000_000)", " characters)"),
    ],
)
def test_a_class_that_does_not_come_to_its_first_step_is_refused(controller, monkeypatch, capfd, place, what, sentence):
    if "while" in what:
        monkeypatch.setattr(hosted, "LOAD_TIMEOUT", 0.5)
    with pytest.raises(RigError) as refusal:
        controller(**{place: what})
    assert str(refusal.value).endswith(sentence) and len(str(refusal.value)) < 1500 and refusal.value.exit_code == 2
    assert capfd.readouterr().err == "", "no traceback"


@pytest.mark.parametrize(
    ("what", "sentence"),
    [
        (STAYS, "terminate did not return within 2 s"),
        ("os._exit(0)", "in terminate the controller's process ended itself with exit code 0"),
        ("sys.exit(3)", "terminate failed: mine.py line 13: SystemExit: 3"),
        (
            f"threading.Thread(target=lambda: {STAYS}, name='mine').start()",
            "after terminate threads of the controller still run: 'mine'",
        ),
        (f"threading.Thread(target=lambda: {STAYS}, daemon=True).start()", ""),
        ("threading.Thread(target=lambda: time.sleep(0.05)).start()", ""),
        (
            "import atexit, ctypes; atexit.register(lambda: ctypes.string_at(8))",
            "after terminate the controller's process was ended by SIGSEGV (segmentation fault)",
        ),
    ],
)
def test_an_end_that_is_not_in_order_is_told(controller, what, sentence):
    plug = controller(terminate=what)
    ask(plug)
    plug.close()
    assert plug.end_fault == sentence and is_gone(plug.process_id, 0.0)


@pytest.mark.parametrize("child", ["raise SystemExit(0)", "return Out([0.9, 0.0, 0.0])", STAYS, f"os.setsid(); {STAYS}"])
def test_a_copy_that_a_class_forks_neither_answers_nor_stays(controller, tmp_path, child):
    mark = tmp_path / "child"
    plug = controller(
        step=f"pid = os.fork()\n            if pid: open({str(mark)!r}, 'w').write(str(pid))\n            else: {child}"
    )
    assert [ask(plug, sample).command[0] for sample in range(6)] == [0.5] * 6
    plug.close()
    assert plug.end_fault == "" and is_gone(int(mark.read_text()), 0.0)


def test_what_a_class_changes_of_its_process_is_its_own(controller):
    before = os.getcwd(), dict(os.environ), signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM), os.umask(0o022)
    os.umask(before[-1])
    plug = controller(
        initialize="os.chdir('/'); os.environ.clear(); os.umask(0o777); signal.signal(signal.SIGTERM, signal.SIG_IGN); "
        "signal.signal(signal.SIGINT, signal.SIG_IGN)"
    )
    ask(plug)
    plug.close()
    after = os.getcwd(), dict(os.environ), signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM), os.umask(0o022)
    os.umask(after[-1])
    assert after == before and plug.end_fault == ""


def test_a_flood_of_prints_is_shown_up_to_a_limit(controller, capsys, monkeypatch):
    monkeypatch.setattr(hosted, "MOST_PRINTED", 1 << 20)
    plug = controller(step="[print('\\x1b[31m', 'spam ' * 1000) for _ in range(1000)]")
    for sample in range(5):
        ask(plug, sample)
    plug.close()
    shown = capsys.readouterr().err
    assert shown.startswith("\\u001b[31m spam spam") and 1 << 20 < len(shown) < 1.1 * (1 << 20)
    assert shown.endswith(f"controller {plug.name} has printed more than 1 MiB; the rest is not shown\n")


def test_in_process_only_a_python_class_runs_and_a_debugger_has_the_terminal(controller, config):
    plug = controller(in_process=True, step="self.seen = os.getpid()")
    for sample in range(4):
        ask(plug, sample)
    assert plug._class.user.seen == os.getpid()
    plug.close()
    with pytest.raises(RigError, match=r"only a Python class runs in the rig's process \(--in-process\)"):
        load_controller("alfa46@in-process@current", config)


def test_in_process_the_time_of_a_step_is_no_limit_of_terminate(controller):
    """Its step raises with most of its time left; by then the timer must be off, also for what terminate does."""
    plug = controller(
        in_process=True, step="raise ValueError('no')", terminate="self.left = signal.getitimer(signal.ITIMER_REAL)[0]"
    )
    plug.pace(1000.0)
    for sample in range(3):
        ask(plug, sample)
    with pytest.raises(ControllerFailed, match="step failed: .*ValueError: no"):
        ask(plug, 3)
    assert plug._class.user.left == 0.0 and plug.end_fault == ""


def test_in_process_an_alarm_of_the_class_itself_ends_its_terminate_and_not_the_rig(controller):
    plug = controller(in_process=True, terminate="os.kill(os.getpid(), signal.SIGALRM)")
    ask(plug)
    plug.close()
    assert plug.end_fault == "terminate was ended by an alarm of the controller's own"


SEQUENCE = """
description: gear I, a controller that breaks
steps:
  - oil: {pressure: 4 MPa}
  - shift: {to: I, timeout: 900 ms}
"""


@pytest.mark.parametrize(
    ("what", "options", "sentence"),
    [
        ("raise ValueError('x' * 10_000_000)", ["--in-process"], "ValueError: xxx"),
        ("os._exit(0)", [], "sample 3: the controller's process ended itself with exit code 0"),
    ],
)
def test_a_run_whose_controller_breaks_ends_with_the_reason_and_a_whole_bag(controller, tmp_path, capsys, what, options, sentence):
    name = controller(step=what).name
    (tmp_path / "sequence.yaml").write_text(SEQUENCE)
    run = ["simulate", str(tmp_path / "sequence.yaml"), "--controller", name, "--out", str(tmp_path / "run"), *options]
    assert main(run) == 1
    (last,) = capsys.readouterr().err.splitlines()[-1:]
    assert sentence in last and len(last) < 1500
    assert main(["bag", "check", str(tmp_path / "run")]) == 0
    reason = json.loads((tmp_path / "run" / "report.json").read_text())["run"]["end"]["reason"]
    assert last == f"rig: {reason}"
    assert [text for _, _, name, text, _ in Bag(tmp_path / "run").events() if name == "rig_tripped"] == [reason]
