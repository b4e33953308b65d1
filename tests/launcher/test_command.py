# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The command line: quick help, one sentence for each mistake, foreign shell settings."""

import json
import os
import re
import subprocess
import sys
import time

import pytest

from rig_nodes.cli.main import VERBS, usage

pytestmark = pytest.mark.skipif(os.path.basename(sys.prefix) != ".venv", reason="not in the launcher's environment")


def rig(checkout, *arguments, **options):
    return subprocess.run([checkout / "rig", *arguments], capture_output=True, text=True, timeout=60, **options)


def test_help_is_quick_and_names_every_verb(checkout):
    def seconds():
        began = time.monotonic()
        done = rig(checkout, "--help")
        took = time.monotonic() - began
        assert done.returncode == 0 and done.stderr == ""
        assert all(re.search(rf"^  {verb} ", done.stdout, re.M) for verb in VERBS.own)
        return took

    assert any(seconds() < 1.0 for _ in range(3))


def test_help_imports_nothing_heavy():
    code = (
        "import sys; from rig_nodes.cli.main import main; main(['--help']); "
        "heavy = {'numpy', 'numba', 'rclpy', 'mcap', 'rerun'}; "
        "print(sorted(heavy & set(sys.modules)), file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=30)
    assert done.stderr.strip() == "[]"


@pytest.mark.parametrize("verb", VERBS.own)
def test_help_line_is_that_of_the_module(verb):
    assert f" {verb} " in usage() and usage().count(f" {VERBS.own_module(verb).HELP}\n") == 1


@pytest.mark.parametrize(
    ("arguments", "words"),
    [(["simulat"], "did you mean 'simulate'?"), (["xyzzy"], "known are bag, bench"), (["doctor", "--jsn"], "--jsn")],
)
def test_mistake_is_one_sentence_and_exit_code_2(checkout, arguments, words):
    done = rig(checkout, *arguments)
    assert done.returncode == 2
    assert words in done.stderr and done.stderr.startswith("rig: ") and done.stderr.count("\n") == 1


def test_test_passes_its_arguments_on(checkout, tmp_path):
    (tmp_path / "test_one.py").write_text("def test_a(): pass\ndef test_b(): pass\n")
    path = str(tmp_path / "test_one.py")
    done = rig(checkout, "test", "-q", path, "-k", "test_a", "-p", "no:cacheprovider")
    assert done.returncode == 0 and "1 passed, 1 deselected" in done.stdout


def test_foreign_shell_settings_and_no_home_do_not_matter(checkout, tmp_path):
    (tmp_path / "numpy.py").write_text("raise SystemExit('the wrong numpy')\n")
    env = {
        "PATH": "/usr/bin:/bin:" + os.path.dirname(sys.executable),
        "PYTHONPATH": str(tmp_path),
        "LD_LIBRARY_PATH": "/opt/ros/jazzy/lib",
        "AMENT_PREFIX_PATH": "/opt/ros/jazzy",
        "RMW_IMPLEMENTATION": "rmw_none",
        "_ROS_WHEELS_BOOTSTRAP_COMPLETE": "1",
    }
    # Without HOME and with a python3 on the path that is not the environment's own.
    done = rig(checkout, "doctor", "--json", env=env, cwd=tmp_path)
    findings = {c["what"]: c for c in json.loads(done.stdout)["checks"]}
    for what in ("environment", "rclpy", "rig_msgs", "DDS loopback"):
        assert findings[what]["state"] == "ok", findings[what]
    assert findings["shell"]["state"] == "warn"
    left_out = ("PYTHONPATH", "AMENT_PREFIX_PATH", "RMW_IMPLEMENTATION")
    assert all(f"-u {name}" in findings["shell"]["hint"] for name in left_out)
    assert findings["shell"]["detail"].startswith(" and ".join(left_out))


def test_closed_pipe_is_quiet(checkout):
    done = subprocess.run(
        f"{checkout / 'rig'} list trips | head -c 1 | wc -c", shell=True, capture_output=True, text=True, timeout=60
    )
    assert done.stdout.strip() == "1" and done.stderr == ""
