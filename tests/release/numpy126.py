#!/usr/bin/env python3
# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Release check with numpy 1.26, the one of Ubuntu 24.04: the locked packages without the viewer, demo, tests.

Standard library only. Makes a copy of the checkout with an environment of its own in a temporary folder and
compares the bag of `rig simulate demo` there with that of the checkout. See README.md beside it.
"""

import argparse
import hashlib
import importlib.util
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from importlib.machinery import SourceFileLoader
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parents[2]
NUMPY = """numpy==1.26.4 \\
    --hash=sha256:666dbfb6ec68962c033a450943ded891bed2d54e6755e35e5835d63f4f6931d5 \\
    --hash=sha256:675d61ffbfa78604709862923189bad94014bef562cc35cf61d3a07bba02a7ed
"""
PYARROW = """pyarrow==25.0.1 \\
    --hash=sha256:25f8720bf6387d5dc2ebd2622112de630760419e4b66134405dd24110d15f37e \\
    --hash=sha256:5389cdf79447ed1515c9e31620e6e1e2302249564d603f2ad727d4f6d313e4c3
"""
LAST = {"numpy": NUMPY, "pyarrow": PYARROW}  # pyarrow 26 needs numpy 2
PYTHONS = ((3, 11), (3, 12))  # numpy 1.26.4 has no wheels for later versions, and the rig needs at least the first one
TESTS = ("plant", "alfa46", "runs", "bags", "analysis", "controllers")
GRAPH_TESTS = ("graph/test_live_graph.py",)


class CheckError(Exception):
    """The reason why the check cannot be made, in one sentence."""


def load_launcher(checkout):
    """Returns the file `rig` of a checkout as a module, whose ROOT is that checkout."""
    loader = SourceFileLoader("rig_launcher", str(checkout / "rig"))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader("rig_launcher", loader))
    sys.dont_write_bytecode = True
    loader.exec_module(module)
    return module


def copy_checkout(folder):
    """Copies the files that git tracks or would add, as they are now."""
    command = ["git", "-C", str(CHECKOUT), "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    listed = subprocess.run(command, capture_output=True, text=True)
    if listed.returncode:
        raise CheckError("git does not list the files of %s: %s" % (CHECKOUT, listed.stderr.strip()))
    for name in filter(None, listed.stdout.split("\0")):
        source, target = CHECKOUT / name, folder / name
        if source.exists() or source.is_symlink():
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(source, target, follow_symlinks=False)


def with_old_numpy(lock):
    """Returns the text of requirements.lock with numpy 1.26.4, the last pyarrow for it; nothing here asks for the viewer."""
    blocks = re.split(r"(?m)^(?=[\w.-]+==)", lock)
    names = [block.split("==")[0] for block in blocks]
    for name in LAST:
        if name not in names:
            raise CheckError("requirements.lock has no %s" % name)
    return "".join(LAST.get(name, block) for name, block in zip(names, blocks))


def make_environment(launcher, folder):
    """Makes the launcher's environment in the copy, built as the launcher builds it."""
    venv = str(folder / ".venv")
    lock = folder / "requirements.lock"
    lock.write_text(with_old_numpy(lock.read_text()))
    environment = dict(launcher.clean_environment(dict(os.environ), venv), TMPDIR=os.path.join(venv, "tmp"))
    with open(folder / "lock", "w") as held:
        steps = launcher.Steps(3, str(folder / "setup.log"), held.fileno())
        launcher.install_packages(str(folder), venv, steps, environment)
        # The ROS wheels were built with numpy 2, whose C headers lie in another folder.
        for path in folder.glob(".venv/share/*/cmake/*__rosidl_generator_pyExport.cmake"):
            path.write_text(path.read_text().replace("numpy/_core/include", "numpy/core/include"))
        launcher.build_messages(str(folder), venv, steps, environment)


def run(what, command, folder):
    """Runs a command of the check; returns True when it passed."""
    print("numpy 1.26: $ %s" % what, flush=True)
    began = time.monotonic()
    code = subprocess.run(command, cwd=str(folder), stdin=subprocess.DEVNULL).returncode
    verdict = "ok" if code == 0 else "FAILED (exit code %d)" % code
    print("numpy 1.26: %s %s after %.0f s" % (what, verdict, time.monotonic() - began), flush=True)
    return code == 0


def compare(ours, theirs):
    """Returns True when both environments wrote the same bag, and prints the differences."""
    digests = [hashlib.sha256((folder / "demo_0.mcap").read_bytes()).hexdigest() for folder in (ours, theirs)]
    same = digests[0] == digests[1]
    print(
        "numpy 1.26: demo_0.mcap is %s (sha256 %s with numpy 1.26, %s in the checkout's environment)"
        % ("the same, byte for byte" if same else "NOT the same", digests[0][:16], digests[1][:16]),
        flush=True,
    )
    return same


def check(folder, options):
    """Runs the whole check in an empty folder; returns the exit code."""
    copy_checkout(folder)
    launcher = load_launcher(folder)
    missing = launcher.find_missing(root=str(folder))
    if missing:
        raise CheckError(missing)
    try:
        make_environment(launcher, folder)
    except launcher.SetupError as error:
        raise CheckError(str(error)) from None
    rig = [sys.executable, str(folder / "rig")]
    python = str(folder / ".venv" / "bin" / "python")
    show = "import numpy, sys; print('numpy', numpy.__version__, 'Python', sys.version.split()[0])"
    passed = [
        run("versions", [python, "-c", show], folder),
        run("rig simulate demo", [*rig, "simulate", "demo", "--out", "ours"], folder),
        run("rig report", [*rig, "report", "ours"], folder),
    ]
    reference = [str(CHECKOUT / "rig"), "simulate", "demo", "--out", str(folder / "theirs")]
    if run("rig simulate demo, in the checkout", reference, CHECKOUT) and passed[1]:
        passed.append(compare(folder / "ours", folder / "theirs"))
    else:
        passed.append(False)
    tests = TESTS + (GRAPH_TESTS if options.graph else ())
    passed.append(
        run(
            "rig test " + " ".join("tests/" + name for name in tests),
            [*rig, "test", *("tests/" + name for name in tests), "-q"],
            folder,
        )
    )
    if options.graph:
        passed.append(run("rig run demo", [*rig, "run", "demo", "--out", "run"], folder))
    print("numpy 1.26: %s" % ("passed" if all(passed) else "FAILED"))
    return 0 if all(passed) else 1


def main(arguments):
    parser = argparse.ArgumentParser(description="Check the rig with numpy 1.26, without the viewer.")
    parser.add_argument("--folder", metavar="FOLDER", help="new folder for the copy (a temporary one)")
    parser.add_argument("--keep", action="store_true", help="leave the folder where it is")
    parser.add_argument("--graph", action="store_true", help="the live graph and `rig run demo` too")
    options = parser.parse_args(arguments)
    if sys.version_info[:2] not in PYTHONS:
        raise CheckError("numpy 1.26 has no wheels for this Python %d.%d: start this script with python3.12" % sys.version_info[:2])
    folder = Path(options.folder or tempfile.mkdtemp(prefix="numpy126_")).resolve()
    if options.folder:
        if folder.exists():
            raise CheckError("%s exists: name a new folder" % folder)
        folder.mkdir(parents=True)
    try:
        return check(folder, options)
    finally:
        if options.keep:
            print("numpy 1.26: left in %s" % folder)
        else:
            shutil.rmtree(folder, ignore_errors=True)


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    try:
        sys.exit(main(sys.argv[1:]))
    except CheckError as e:
        sys.stderr.write("numpy 1.26: %s\n" % e)
        sys.exit(2)
    except KeyboardInterrupt:
        sys.exit(130)
