# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A C library runs in a process of its own: any fault of it becomes one sentence in this process, and nothing remains of it."""

import os
import re
import select
import signal
import subprocess
import sys

import pytest

from rig_nodes.base.errors import RigError
from rig_nodes.controllers import ControllerFailed, Status, load_controller
from rig_nodes.runs.rig import Rig
from rig_nodes.runs.rig_base import RigStatus
from rig_nodes.runs.simulation import advance_with

from .conftest import C_FRAME, ask

ENDLESS = "for (volatile int k = 0;;) k = 0;"


def frame(step, head=""):
    return f"#include <stdlib.h>\n#include <stdio.h>\n#include <unistd.h>\n{head}" + C_FRAME.replace("STEP", step)


def is_gone(pid, seconds=5.0):
    """Returns True when the process has ended, or ends within some seconds."""
    try:
        handle = os.pidfd_open(pid)
    except ProcessLookupError:
        return True
    try:
        return bool(select.select([handle], [], [], seconds)[0])
    finally:
        os.close(handle)


@pytest.mark.parametrize(
    ("step", "sentence"),
    [
        ("*(volatile int *)8 = 1;", r"ended by SIGSEGV \(segmentation fault\)"),
        ("abort();", r"ended by SIGABRT \(aborted\)"),
        ("exit(3);", "ended itself with exit code 3"),
        ("exit(0);", "ended itself with exit code 0"),
        (ENDLESS, r"no answer for 200 ms \(--step-timeout\)"),
    ],
)
def test_a_library_that_breaks_down_is_fatal_and_the_rig_lives(build, config, step, sentence):
    plug = load_controller(f"c:{build(frame(f'if (in->sample == 3) {{ {step} }}'))}", config)
    plug.pace(0.2)
    rig = Rig(config, controller="external")
    for _ in range(3):
        advance_with(rig, plug)
    assert rig.status == RigStatus.READY
    advance_with(rig, plug)
    assert rig.status == RigStatus.TRIPPED, "in the very sample"
    assert rig.reason.startswith(f"controller {plug.name}, sample 3: ")
    assert re.search(sentence + "$", rig.reason), rig.reason
    with pytest.raises(ControllerFailed, match="has ended") as failure:
        ask(plug, 4)
    assert failure.value.status == Status.FATAL
    assert is_gone(plug.process_id)
    plug.close()


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (
            frame("", "__attribute__((constructor)) static void early(void) { abort(); }\n"),
            r"ended by SIGABRT \(aborted\) while it was loaded",
        ),
        (
            frame("").replace("(void)info;", "info->size = *(volatile uint32_t *)8;"),
            r"ended by SIGSEGV \(segmentation fault\) in rig_controller_create",
        ),
    ],
)
def test_a_library_that_breaks_down_before_its_first_step_is_refused(build, config, text, sentence):
    with pytest.raises(RigError, match=sentence) as refusal:
        load_controller(f"c:{build(text)}", config)
    assert refusal.value.exit_code == 2 and "\n" not in str(refusal.value)


def test_in_real_time_a_tenth_of_a_second_is_the_end(build, config):
    plug = load_controller(f"c:{build(frame(ENDLESS))}", config)
    plug.pace(0.1, real_time=True)
    with pytest.raises(ControllerFailed, match="no answer for 100 ms$"):
        ask(plug)


def test_destroy_is_called_at_an_orderly_end_and_never_after_fatal(build, config, tmp_path):
    mark = tmp_path / "destroyed"
    text = frame("if (in->sample == 1) return RIG_FATAL;").replace(
        "destroy(void *instance) { (void)instance; }",
        f'destroy(void *instance) {{ (void)instance; fclose(fopen("{mark}", "w")); }}',
    )
    library = build(text)
    for samples, destroyed in ((2, False), (1, True)):
        plug = load_controller(f"c:{library}", config)
        try:
            for sample in range(samples):
                ask(plug, sample)
        except ControllerFailed:
            pass
        plug.close()
        assert mark.exists() is destroyed


def test_arithmetic_that_a_library_changes_is_its_own(build, config):
    """With many compilers -ffast-math sets tiny numbers to zero in the whole process, here that of the library only."""
    flush = "#include <xmmintrin.h>\n__attribute__((constructor)) static void flush(void) { _mm_setcsr(_mm_getcsr() | 0x8040); }\n"
    plug = load_controller(f"c:{build(frame('out->command[0] = rig_measured_of(in)->n_wej / 2.0 > 0.0;', flush))}", config)
    tiny = sys.float_info.min
    assert plug.step(0, (0.0, 0.0, 0.0), [tiny, 0.0, 0.0, 0.0]).command[0] == 0.0
    assert tiny / 2.0 > 0.0
    plug.close()


@pytest.mark.parametrize("step", ["", ENDLESS], ids=["idle", "in an endless loop"])
def test_nothing_stays_behind_when_the_rig_is_killed(build, step):
    code = (
        "import os, sys; from rig_nodes.controllers import load_controller\n"
        "from rig_nodes.rig.configuration import load_rig\n"
        f"plug = load_controller('c:{build(frame(step))}', load_rig('hydmag'))\n"
        "print(plug.process_id, flush=True)\nplug.pace(None)\n"
        "plug.step(0, (0.0, 0.0, 0.0), [0.0, 0.0, 0.0, 0.0])\nprint('answered', flush=True)\nsys.stdin.read()"
    )
    rig = subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    host = int(rig.stdout.readline())
    if not step:
        rig.stdout.readline()
    rig.send_signal(signal.SIGKILL)
    rig.wait()
    assert is_gone(host)


def test_two_plugs_of_one_library_share_nothing(build, config):
    """Generated code with globals needs this."""
    library = build(frame("static int count; out->gear = (uint32_t)(count++ % 3);"))
    one, other = (load_controller(f"c:{library}", config) for _ in range(2))
    for sample in range(2):
        ask(one, sample)
    ask(other)
    assert (one.gear, other.gear) == (1, 0)
    one.close()
    other.close()


# ---- memory that is not the library's own


def framed(step, extra=""):
    """A library with one wanted transducer, one signal and one setting, so that it receives all kinds of memory."""
    return (
        frame(step)
        + extra
        + """
const char *const *rig_controller_wants(void) { static const char *const names[] = {"M_wej", 0}; return names; }
const char *const *rig_controller_signals(void) { static const char *const names[] = {"slip", 0}; return names; }
const rig_parameter *rig_controller_settings(void) { static const rig_parameter all[] = {{"gain", 1}, {0, 0}}; return all; }
"""
        + "".join(
            f"void {name}({kind} *values, uint32_t count) {{ (void)instance; (void)values; (void)count; {body} }}\n"
            for name, kind, body in OWN
        )
    )


OWN = [
    ("rig_controller_wanted", "void *instance, const double", "WANTED"),
    ("rig_controller_signal_values", "void *instance, double", "values[0] = 1.0; SIGNALS"),
    ("rig_controller_set", "void *instance, const double", "SET"),
]


@pytest.mark.parametrize(
    ("where", "what", "sentence"),
    [
        ("STEP", "memset(out + 1, 7, 64);", "the library wrote 64 bytes behind out of rig_controller_step"),
        ("STEP", "((char *)out)[-1] = 7;", "the library wrote 1 byte before out of rig_controller_step"),
        ("STEP", "((double *)(out + 1))[3] = 7;", "8 bytes behind out of rig_controller_step, 24 bytes away from it"),
        ("STEP", "memset((void *)(in + 1), 7, 8);", "8 bytes behind in of rig_controller_step"),
        ("STEP", "memset((char *)in - 16, 7, 16);", "16 bytes before in of rig_controller_step"),
        ("WANTED", "((double *)values)[1] = 7;", "8 bytes behind values of rig_controller_wanted"),
        ("SIGNALS", "values[1] = 7;", "8 bytes behind values of rig_controller_signal_values"),
        ("SET", "((double *)values)[-1] = 7;", "8 bytes before values of rig_controller_set"),
    ],
)
def test_memory_written_beside_what_was_handed_over_trips_the_rig(build, config, where, what, sentence):
    """From sample 3 on it writes to memory that the library does not own, beside each of the structs in turn."""
    step = f"static uint64_t now; now = in->sample; {'' if where != 'STEP' else 'if (now >= 3) { ' + what + ' }'}"
    text = "#include <string.h>\n" + framed(step)
    for name in ("WANTED", "SIGNALS", "SET"):
        text = text.replace(f"{name} }}", f"static int calls; if (++calls > 3) {{ {what} }} }}" if name == where else "}")
    plug = load_controller(f"c:{build(text, '-w')}", config)
    rig = Rig(config, controller="external")
    for _ in range(3):
        advance_with(rig, plug)
    assert rig.status == RigStatus.READY
    advance_with(rig, plug)
    assert rig.status == RigStatus.TRIPPED and rig.sample == 4, "in the very sample"
    assert sentence in rig.reason and rig.reason.endswith("; that memory is not its own"), rig.reason
    assert is_gone(plug.process_id)
    plug.close()


def test_memory_written_behind_the_info_of_create_is_refused(build, config):
    text = frame("").replace("(void)info;", "((char *)(info + 1))[0] = 7;")
    with pytest.raises(RigError, match="the library wrote 1 byte behind info of rig_controller_create; that memory is"):
        load_controller(f"c:{build(text)}", config)


# ---- the end


DESTROY = "void rig_controller_destroy(void *instance) { (void)instance; }"
ENDS = [
    (
        "*(volatile int *)8 = 1;",
        r"in rig_controller_destroy the library's process was ended by SIGSEGV "
        r"\(segmentation fault\)",
    ),
    ("exit(3);", "in rig_controller_destroy the library's process ended itself with exit code 3"),
    ("exit(0);", "in rig_controller_destroy the library's process ended itself with exit code 0"),
    ("for (;;) pause();", "rig_controller_destroy did not return within 2 s"),
    ("atexit(abort);", r"after rig_controller_destroy the library's process was ended by SIGABRT \(aborted\)"),
]


def breaking_at_its_end(what):
    return frame("").replace(DESTROY, DESTROY.replace("(void)instance;", f"(void)instance; {what}"))


@pytest.mark.parametrize(("what", "sentence"), ENDS)
def test_a_library_that_breaks_down_at_its_end_is_told(build, config, what, sentence):
    plug = load_controller(f"c:{build(breaking_at_its_end(what))}", config)
    ask(plug)
    plug.close()
    assert re.fullmatch(sentence, plug.end_fault), plug.end_fault
    assert is_gone(plug.process_id, 0.0)


def test_an_orderly_end_is_none_to_tell_of(build, config):
    plug = load_controller(f"c:{build(frame(''))}", config)
    ask(plug)
    plug.close()
    assert plug.end_fault == ""


# ---- children of the library


CHILDREN = """
#include <unistd.h>
#include <fcntl.h>
#include <sys/wait.h>
static void leave_children(const char *path) { /* one in a session of its own, that nobody waits for, and its child */
  int fd = open(path, O_WRONLY | O_CREAT | O_APPEND, 0600), done[2];
  char byte;
  (void)!pipe(done);
  if (fork() == 0) {
    setsid();
    for (int k = 0; k < 2; k++) {
      if (fork() == 0) {
        dprintf(fd, "%d\\n", (int)getpid());
        close(fd);
        (void)!write(done[1], "x", 1);
        for (;;) pause();
      }
    }
    _exit(0);
  }
  wait(NULL);
  for (int k = 0; k < 2; k++) (void)!read(done[0], &byte, 1);
}
"""


def with_children(build, path, then=""):
    head = CHILDREN + f'static void go(void) {{ leave_children("{path}"); {then} }}\n'
    return build(frame("if (in->sample == 0) go();", head))


@pytest.mark.parametrize("end", ["in order", "crash", "fatal", "endless loop"])
def test_children_of_a_library_end_with_it(build, config, tmp_path, end):
    """The children have a session of their own, and their parent has ended."""
    then = {"in order": "", "crash": "abort();", "fatal": "", "endless loop": ENDLESS}[end]
    plug = load_controller(f"c:{with_children(build, tmp_path / 'pids', then)}", config)
    plug.pace(5.0 if end != "endless loop" else 0.5)
    try:
        ask(plug)
    except ControllerFailed:
        assert end in ("crash", "endless loop")
    children = [int(pid) for pid in (tmp_path / "pids").read_text().split()]
    assert len(children) == 2
    if end == "fatal":
        plug._abandon()  # as after a fatal status
    plug.close()
    assert all(is_gone(pid, 0.0) for pid in [plug.process_id, *children])


def test_children_of_a_library_end_when_the_rig_is_killed(build, tmp_path):
    code = (
        "import sys; from rig_nodes.controllers import load_controller\n"
        "from rig_nodes.rig.configuration import load_rig\n"
        f"plug = load_controller('c:{with_children(build, tmp_path / 'pids')}', load_rig('hydmag'))\n"
        "plug.step(0, (0.0, 0.0, 0.0), [0.0, 0.0, 0.0, 0.0])\nprint('answered', flush=True)\nsys.stdin.read()"
    )
    rig = subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert rig.stdout.readline() == "answered\n"
    children = [int(pid) for pid in (tmp_path / "pids").read_text().split()]
    assert len(children) == 2 and not any(is_gone(pid, 0.0) for pid in children)
    rig.send_signal(signal.SIGKILL)
    rig.wait()
    assert all(is_gone(pid) for pid in children)


def test_a_crash_leaves_no_core_file(build, config):
    plug = load_controller(f"c:{build(frame(''))}", config)
    with open(f"/proc/{plug.process_id}/limits", encoding="utf-8") as limits:
        assert re.search(r"^Max core file size +0 +0 ", limits.read(), re.M)
    plug.close()
