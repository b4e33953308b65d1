# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A complete environment is not changed; an incomplete, damaged or outdated one is detected."""

import fcntl
import os
import shutil
import subprocess
import sys
import sysconfig

import pytest


def test_complete_environment_is_left_alone(launcher, small_checkout):
    assert launcher.find_stale(str(small_checkout)) == (None, None)


def test_additions_do_not_matter(launcher, small_checkout):
    (small_checkout / ".venv/lib/python3.11/site-packages/can").mkdir()
    assert launcher.find_stale(str(small_checkout)) == (None, None)


def test_no_environment(launcher, small_checkout):
    shutil.rmtree(small_checkout / ".venv")
    assert launcher.find_stale(str(small_checkout))[0] == "packages"


@pytest.mark.parametrize("content", [None, "", "{", "[]", "{}"])
def test_half_made_environment(launcher, small_checkout, content):
    stamp = small_checkout / ".venv/stamp.json"
    if content is None:
        stamp.unlink()
    else:
        stamp.write_text(content)
    assert launcher.find_stale(str(small_checkout)) == ("packages", "the environment is half made")


@pytest.mark.parametrize(
    ("lost", "stale"),
    [
        ("lib/python3.11/site-packages/numpy", "packages"),
        ("lib/python3.11/site-packages/numpy-2.4.6.dist-info", "packages"),
        ("bin/python", "packages"),
        ("lib/python3.11/site-packages/rig_msgs", "ros"),
        ("lib/librig_msgs.so", "ros"),
    ],
)
def test_lost_part(launcher, small_checkout, lost, stale):
    path = small_checkout / ".venv" / lost
    path.unlink() if path.is_symlink() or path.is_file() else path.rmdir()
    assert launcher.find_stale(str(small_checkout))[0] == stale


def test_set_up_killed_while_messages_were_built(launcher, small_checkout):
    venv = str(small_checkout / ".venv")
    launcher.write_stamp(venv, dict(launcher.read_stamp(venv), later=["view"]))
    (small_checkout / ".venv/lib/librig_msgs.so").unlink()
    assert launcher.find_stale(str(small_checkout)) == (None, None), "who does not ask for ROS does not wait for it"
    assert launcher.find_stale(str(small_checkout), ["ros"]) == ("ros", "the messages of ROS 2 are not built yet")


def test_what_is_asked_for_is_added_once(launcher, small_checkout):
    venv = str(small_checkout / ".venv")
    assert launcher.find_stale(str(small_checkout), ["view", "ros"]) == ("view", "the viewer is not installed yet")
    launcher.write_stamp(venv, dict(launcher.read_stamp(venv), later=["ros", "view"]))
    assert launcher.find_stale(str(small_checkout), ["view", "ros"]) == (None, None)


def test_uv_is_told_what_the_configuration_of_pip_says(launcher, tmp_path):
    python = tmp_path / "python"
    lines = [
        "global.index-url='https://one.example/simple'",
        "global.extra-index-url='https://two.example/simple https://three.example/simple'",
        "site.find-links='/some/where'",
        "user.timeout='60'",
        ":env:.index-url='https://four.example/simple'",
    ]
    python.write_text("#!/bin/sh\ncat <<END\n" + "\n".join(lines) + "\nEND\n")
    python.chmod(0o755)
    options = launcher.as_pip_does(str(python), dict(os.environ))
    pairs = list(zip(options[::2], options[1::2]))
    assert pairs[1:] == [
        ("--default-index", "https://four.example/simple"),
        ("--index", "https://two.example/simple"),
        ("--index", "https://three.example/simple"),
        ("--find-links", "/some/where"),
    ]


def test_moved_checkout(launcher, small_checkout):
    moved = small_checkout.with_name("moved")
    small_checkout.rename(moved)
    assert launcher.find_stale(str(moved)) == ("packages", "the checkout was moved")


def test_changed_lock(launcher, small_checkout):
    (small_checkout / "requirements.lock").write_text("numpy==2.4.7\n")
    assert launcher.find_stale(str(small_checkout)) == ("packages", "requirements.lock changed")


@pytest.mark.parametrize(
    "change",
    [
        lambda msgs: (msgs / "msg/Torque.msg").write_text("float64 value\nfloat64 other\n"),
        lambda msgs: (msgs / "msg/Torque.msg").rename(msgs / "msg/Moment.msg"),
        lambda msgs: (msgs / "msg/Speed.msg").write_text("float64 value\n"),
    ],
)
def test_changed_messages_cost_only_the_messages(launcher, small_checkout, change):
    change(small_checkout / "msgs")
    assert launcher.find_stale(str(small_checkout)) == ("ros", "msgs/ changed")


def test_other_python_below_the_environment(launcher, small_checkout, tmp_path):
    python = small_checkout / ".venv/bin/python"
    python.unlink()
    other = tmp_path / "python3.99"
    other.write_text("#!/bin/sh\necho 3.99\n")
    other.chmod(0o755)
    os.symlink(other, python)
    stale = launcher.find_stale(str(small_checkout))
    assert stale == ("packages", "the Python below the environment changed")


def test_patch_release_of_python_needs_nothing(launcher, small_checkout, tmp_path):
    python = small_checkout / ".venv/bin/python"
    python.unlink()
    other = tmp_path / "python-patched"
    other.write_text("#!/bin/sh\necho %d.%d\n" % sys.version_info[:2])
    other.chmod(0o755)
    os.symlink(other, python)
    assert launcher.find_stale(str(small_checkout)) == (None, None)


def test_second_start_waits_for_the_first_and_says_so(launcher, small_checkout):
    """The second start must find nothing to do and return as soon as the first has finished."""
    stamp = small_checkout / ".venv/stamp.json"
    complete = stamp.read_text()
    stamp.unlink()
    lock = launcher.take_lock(str(small_checkout))
    code = f"import runpy; rig = runpy.run_path({launcher.__file__!r}); rig['set_up']({str(small_checkout)!r}); print('ready')"
    second = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert "waiting" in second.stderr.readline()
        stamp.write_text(complete)
        os.close(lock)
        output, errors = second.communicate(timeout=30)
    finally:
        second.kill()
    assert (output, errors) == ("ready\n", "")


def test_failing_tool_ends_in_a_sentence_and_leaves_no_stamp(launcher, small_checkout, tmp_path):
    lock = launcher.take_lock(str(small_checkout))
    steps = launcher.Steps(1, str(tmp_path / "setup.log"), lock)
    steps.start("trying")
    with pytest.raises(launcher.SetupError, match="trying failed: error: no such thing"):
        steps.run(["sh", "-c", "echo fine; echo 'error: no such thing' >&2; exit 3"], dict(os.environ), "trying failed")
    os.close(lock)


def test_killed_start_keeps_the_lock_until_its_tool_has_ended(launcher, small_checkout, tmp_path):
    """Otherwise the next start would remove the environment that a still running pip uses."""
    code = (
        f"import runpy; rig = runpy.run_path({launcher.__file__!r}); "
        f"lock = rig['take_lock']({str(small_checkout)!r}); "
        f"steps = rig['Steps'](1, {str(tmp_path / 'log')!r}, lock); "
        "steps.start('x'); steps.run(['sh', '-c', 'read line < fifo'], None, 'failed')"
    )
    os.mkfifo(tmp_path / "fifo")
    first = subprocess.Popen([sys.executable, "-c", code], cwd=tmp_path, stderr=subprocess.DEVNULL)
    # Opening the writing end returns when the tool has opened the reading end, that is, when it runs.
    with open(tmp_path / "fifo", "w") as fifo:
        first.kill()
        first.wait()
        folder = os.open(small_checkout, os.O_RDONLY)
        with pytest.raises(BlockingIOError):
            fcntl.flock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB)
        fifo.write("end\n")
    fcntl.flock(folder, fcntl.LOCK_EX)
    os.close(folder)


@pytest.mark.parametrize("prefix", ["/opt/python/cp311-cp311", "/home/other/checkout/.venv"], ids=["wheel", "another checkout's"])
def test_the_files_that_an_environment_shares_with_a_cache_stay_as_they_are(launcher, tmp_path, prefix):
    cached, venv = tmp_path / "cached.cmake", tmp_path / ".venv"
    text = f'X "{prefix}/include/python3.11;{prefix}/lib/python3.11/site-packages/numpy/_core/include;${{HERE}}/include/std_msgs"\n'
    cached.write_text(text)
    shared = venv / "share" / "std_msgs" / "cmake" / "export_std_msgs__rosidl_generator_pyExport.cmake"
    shared.parent.mkdir(parents=True)
    os.link(cached, shared)
    launcher.correct_exports(str(venv), "/here/site-packages")
    include = sysconfig.get_path("include")
    assert shared.read_text() == f'X "{include};/here/site-packages/numpy/_core/include;${{HERE}}/include/std_msgs"\n'
    assert cached.read_text() == text and [one.name for one in shared.parent.iterdir()] == [shared.name]
