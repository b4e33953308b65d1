"""`rig test`: pytest on the checkout's tests, with ROS field checks on."""

import argparse
import os
import subprocess
import sys
from pathlib import Path

import rig_nodes
from rig_nodes.errors import RigError

HELP = "run the tests"
PASSES_ON = True


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.usage = "rig test [pytest arguments]"
    parser.epilog = ("Without a path all of tests/ runs, apart from what is marked 'campaign'. "
                     "Everything given is passed to pytest: 'rig test -x -k valve', 'rig test tests/plant'.")


def tests_root() -> Path:
    """The checkout that holds the tests; raises RigError where rig_nodes was installed without one."""
    root = Path(rig_nodes.__file__).resolve().parents[2]
    if not (root / "pytest.ini").is_file():
        raise RigError(f"no tests beside {root}: 'rig test' works in a checkout only")
    return root


def main(args: argparse.Namespace) -> int:
    root = tests_root()
    command = [sys.executable, "-m", "pytest", "--rootdir", str(root), "-c", str(root / "pytest.ini"),
               *args.passed_on]
    print("rig: " + " ".join(["ROS_PYTHON_CHECK_FIELDS=1", "pytest", *args.passed_on]), flush=True)
    # Message setters do not check types by default and send garbage; in tests a wrong type must be an error.
    env = dict(os.environ, ROS_PYTHON_CHECK_FIELDS="1")
    # Paths given are the caller's; without any, pytest.ini's testpaths count from the checkout.
    paths = [a.split("::")[0] for a in args.passed_on if not a.startswith("-")]
    given = any((Path.cwd() / p).exists() for p in paths)
    try:
        return subprocess.run(command, env=env, cwd=None if given else root).returncode
    except KeyboardInterrupt:
        return 130
