"""A C library lives in a process of its own: whatever it does there is one sentence here, and nothing stays behind."""

import os
import re
import select
import signal
import subprocess
import sys

import pytest

from rig_nodes.controllers import ControllerFailed, Status, load_controller
from rig_nodes.errors import RigError
from rig_nodes.testbench.rig import Rig
from rig_nodes.testbench.simulate import advance_with
from rig_nodes.testbench.timed import RigStatus

from .conftest import C_FRAME, ask

ENDLESS = "for (volatile int k = 0;;) k = 0;"


def frame(step, head=""):
    return f"#include <stdlib.h>\n#include <stdio.h>\n{head}" + C_FRAME.replace("STEP", step)


def is_gone(pid, seconds=5.0):
    """True when the process has ended, or does within so many seconds."""
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
    plug = load_controller(f"c:{build(frame(f'if (in->sample == 3) {{ {step} }}'))}", config.alfa46)
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
        load_controller(f"c:{build(text)}", config.alfa46)
    assert refusal.value.exit_code == 2 and "\n" not in str(refusal.value)


def test_in_real_time_a_tenth_of_a_second_is_the_end(build, config):
    plug = load_controller(f"c:{build(frame(ENDLESS))}", config.alfa46)
    plug.pace(0.1, real_time=True)
    with pytest.raises(ControllerFailed, match="no answer for 100 ms$"):
        ask(plug)


def test_a_library_that_does_not_end_is_ended(build, config):
    text = frame("").replace("(void)instance; }", f"(void)instance; {ENDLESS} }}")
    plug = load_controller(f"c:{build(text)}", config.alfa46)
    ask(plug)
    plug.close()
    assert is_gone(plug.process_id, 0.0)


def test_destroy_is_called_at_an_orderly_end_and_never_after_fatal(build, config, tmp_path):
    told = tmp_path / "destroyed"
    text = frame("if (in->sample == 1) return RIG_FATAL;").replace(
        "destroy(void *instance) { (void)instance; }",
        f'destroy(void *instance) {{ (void)instance; fclose(fopen("{told}", "w")); }}',
    )
    library = build(text)
    for samples, destroyed in ((2, False), (1, True)):
        plug = load_controller(f"c:{library}", config.alfa46)
        try:
            for sample in range(samples):
                ask(plug, sample)
        except ControllerFailed:
            pass
        plug.close()
        assert told.exists() is destroyed


def test_arithmetic_that_a_library_changes_is_its_own(build, config):
    """As -ffast-math does with many compilers: tiny numbers become zero, in that process."""
    flush = ("#include <xmmintrin.h>\n__attribute__((constructor)) static void flush(void) "
             "{ _mm_setcsr(_mm_getcsr() | 0x8040); }\n")
    plug = load_controller(f"c:{build(frame('out->command[0] = in->n_wej / 2.0 > 0.0;', flush))}", config.alfa46)
    tiny = sys.float_info.min
    assert plug.step(0, (0.0, 0.0, 0.0), tiny, 0.0, 0.0, 0.0).command[0] == 0.0
    assert tiny / 2.0 > 0.0
    plug.close()


@pytest.mark.parametrize("step", ["", ENDLESS], ids=["idle", "in an endless loop"])
def test_nothing_stays_behind_when_the_rig_is_killed(build, step):
    code = (
        "import os, sys; from rig_nodes.controllers import load_controller\n"
        "from rig_nodes.testbench.configuration import load_rig\n"
        f"plug = load_controller('c:{build(frame(step))}', load_rig('hydmag').alfa46)\n"
        "print(plug.process_id, flush=True)\nplug.pace(None)\n"
        "plug.step(0, (0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 0.0)\nprint('answered', flush=True)\nsys.stdin.read()"
    )
    rig = subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    host = int(rig.stdout.readline())
    if not step:
        rig.stdout.readline()
    rig.send_signal(signal.SIGKILL)
    rig.wait()
    assert is_gone(host)


def test_two_plugs_of_one_library_share_nothing(build, config):
    """As generated code with globals needs it."""
    library = build(frame("static int count; out->gear = (uint32_t)(count++ % 3);"))
    one, other = (load_controller(f"c:{library}", config.alfa46) for _ in range(2))
    for sample in range(2):
        ask(one, sample)
    ask(other)
    assert (one.gear, other.gear) == (1, 0)
    one.close()
    other.close()
