"""`rig test`: pytest on the checkout's tests, with ROS field checks on; what failed against the clock a second time."""

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path

import rig_nodes
from rig_nodes.errors import RigError

HELP = "run the tests"
PASSES_ON = True
# Tests of processes in real time: on a machine that stalls for a tenth of a second the rig they look at rightly goes to
# its safe state. They alone get a second chance, in a process of their own, and that is said.
AGAINST_THE_CLOCK = ("tests/graph/", "tests/jazzy/", "tests/view/test_live_view.py")
AT_MOST = 5


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.usage = "rig test [pytest arguments]"
    parser.epilog = ("Without a path all of tests/ runs, apart from what is marked 'campaign'. "
                     "Everything given is passed to pytest: 'rig test -x -k valve', 'rig test tests/plant'. "
                     "Without arguments, up to 5 failures of tests against the clock are tried once more and named.")


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
        code = subprocess.run(command, env=env, cwd=None if given else root).returncode
        failed = failed_tests(root)
        if code != 1 or args.passed_on or not may_try_again(failed):
            return code
        print("rig: what failed runs against the clock; once more, file by file: " + ", ".join(failed), flush=True)
        files = sorted({test.split("::")[0] for test in failed})
        code = max(subprocess.run([*command, file], env=env, cwd=root).returncode for file in files)
        print(f"rig: {'passed' if code == 0 else 'failed'} the second time, failed the first: {', '.join(failed)}")
        return code
    except KeyboardInterrupt:
        return 130


def failed_tests(root: Path) -> list[str]:
    """The tests that pytest has noted as failed, by name; none where it keeps no notes."""
    try:
        noted = json.loads((root / ".pytest_cache/v/cache/lastfailed").read_text())
    except (OSError, ValueError):
        return []
    return sorted(test for test in noted if (root / test.split("::")[0]).is_file())


def may_try_again(failed: list[str]) -> bool:
    """True for a few failures, all of them of tests against the clock."""
    return 0 < len(failed) <= AT_MOST and all(test.startswith(AGAINST_THE_CLOCK) for test in failed)
