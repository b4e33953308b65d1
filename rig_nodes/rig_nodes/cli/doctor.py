# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rig doctor`: it checks everything that the rig depends on, and prints what is wrong and the remedy.

It serves people before they ask for help, and scripts through --json. The exit code is 1 when a check fails.
"""

from __future__ import annotations

import argparse
import fcntl
import glob
import importlib.metadata
import importlib.util
import json
import os
import platform
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib.machinery import SourceFileLoader
from pathlib import Path

from .. import __file__ as PACKAGE_FILE

HELP = "check this machine and the environment"
OK, WARN, FAIL = "ok", "warn", "fail"
SHM = Path("/dev/shm")
DDS_TIMEOUT_S = 30.0


@dataclass(frozen=True)
class Finding:
    """One line of the doctor: ``state`` is ok, warn or fail; ``hint`` is the remedy."""

    what: str
    state: str
    detail: str
    hint: str = ""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument("--json", action="store_true", help="print the findings for a program to read")


def main(args: argparse.Namespace) -> int:
    """Run all checks and print their findings; return 1 when one fails."""
    findings = []
    for check in CHECKS:
        finding = run_check(check)
        findings.append(finding)
        if not args.json:
            hint = f"  ({finding.hint})" if finding.hint else ""
            print(f"{finding.state:<4}  {finding.what:<14}  {finding.detail}{hint}", flush=True)
    good = all(f.state != FAIL for f in findings)
    if args.json:
        print(json.dumps({"ok": good, "checks": [asdict(f) for f in findings]}, indent=2))
    return 0 if good else 1


def run_check(check: Callable[[], Finding]) -> Finding:
    """Return the finding of one check; an exception of the check becomes a finding, too."""
    try:
        return check()
    except Exception as error:  # any error must be reported instead of ending the doctor
        what = check.__name__.removeprefix("check_").replace("_", " ")
        return Finding(what, FAIL, f"{type(error).__name__}: {error}")


# --- set-up ---------------------------------------------------------------------------------------


def check_python() -> Finding:
    """Check that the interpreter's version is one that the rig supports."""
    series = sys.version_info[:2]
    detail = f"{platform.python_version()} at {sys.executable}"
    if series < (3, 11):
        return Finding("python", FAIL, detail, "the rig needs Python 3.11 or newer")
    return Finding("python", OK, detail)


def check_compiler() -> Finding:
    """Check for a C++ compiler for the messages."""
    names = [n for n in (os.environ.get("CXX"), "c++", "g++", "clang++") if n]
    compiler = next((n for n in names if shutil.which(n)), None)
    if compiler is None:
        return Finding("compiler", WARN, "no C++ compiler", "needed when msgs/ changes: install the Debian package g++")
    done = subprocess.run([compiler, "--version"], capture_output=True, text=True, timeout=10)
    return Finding("compiler", OK, (done.stdout or done.stderr).splitlines()[0])


def check_headers() -> Finding:
    """Check for Python's C headers for the messages."""
    header = Path(sysconfig.get_path("include"), "Python.h")
    if not header.is_file():
        return Finding("headers", WARN, f"no {header}", "needed when msgs/ changes: install the Debian package python3-dev")
    return Finding("headers", OK, str(header))


def check_environment() -> Finding:
    """Check that the launcher made the environment and that it is up to date."""
    launcher = Path(PACKAGE_FILE).resolve().parents[2] / "rig"
    if not launcher.is_file() or Path(sys.prefix) != launcher.parent / ".venv":
        return Finding(
            "environment",
            WARN,
            f"{sys.prefix} was not made by the launcher",
            "its packages are not the pinned ones; ./rig in a checkout makes one of its own",
        )
    spec = importlib.util.spec_from_loader("rig_launcher", SourceFileLoader("rig_launcher", str(launcher)))
    module = importlib.util.module_from_spec(spec)
    sys.dont_write_bytecode, before = True, sys.dont_write_bytecode
    spec.loader.exec_module(module)
    sys.dont_write_bytecode = before
    stale, why = module.find_stale(str(launcher.parent))
    if stale:
        return Finding("environment", FAIL, why, "the next ./rig repairs it")
    count = len(list(importlib.metadata.distributions(path=[sysconfig.get_path("purelib")])))
    return Finding("environment", OK, f"{sys.prefix}, {count} packages")


def check_shell() -> Finding:
    """Check whether the shell has a sourced ROS 2 or Python path, which the launcher leaves out and a user's program would get."""
    names = os.environ.get("RIG_LEFT_OUT", "").split()
    if not names:
        return Finding("shell", OK, "no other ROS 2 is sourced here")
    remedy = f"env {' '.join(f'-u {name}' for name in names)} .venv/bin/python your_node.py"
    detail = f"{' and '.join(names)} of another ROS 2 or Python: ./rig leaves out what is set here"
    return Finding("shell", WARN, detail, f"a node of yours starts with: {remedy}")


def check_disk() -> Finding:
    """Check the free space where runs are written."""
    free_gb = shutil.disk_usage(Path.cwd()).free / 1e9
    state = FAIL if free_gb < 0.1 else WARN if free_gb < 1.0 else OK
    return Finding(
        "disk", state, f"{free_gb:.1f} GB free in {Path.cwd()}", "" if state == OK else "runs are written here: make room"
    )


def check_numba_cache() -> Finding:
    """Check the place where the compiled kernel is kept between starts."""
    from ..base import cache_root

    folder = Path(os.environ.get("NUMBA_CACHE_DIR") or cache_root())
    existing = next(p for p in (folder, *folder.parents) if p.exists())
    try:
        with tempfile.TemporaryFile(dir=existing):
            pass
    except OSError as error:
        return Finding(
            "numba cache",
            WARN,
            f"{folder} cannot be written: {error.strerror}",
            "every start compiles the kernel anew: set NUMBA_CACHE_DIR to a folder of yours",
        )
    return Finding("numba cache", OK, str(folder))


# --- ROS 2 ----------------------------------------------------------------------------------------


def check_rclpy() -> Finding:
    """Check that the ROS 2 client library can be loaded."""
    if importlib.util.find_spec("rclpy") is None:
        return Finding("rclpy", WARN, "ROS 2 is not installed", "'rig simulate' does without; 'rig run' needs ROS 2 Jazzy")
    import rclpy

    try:
        version = importlib.metadata.version("ros-rclpy")
    except importlib.metadata.PackageNotFoundError:
        version = importlib.metadata.version("rclpy")
    return Finding("rclpy", OK, f"{version} at {Path(rclpy.__file__).parent}")


def check_messages() -> Finding:
    """Serialise and deserialise every message type of rig_msgs once."""
    if importlib.util.find_spec("rig_msgs") is None:
        return Finding("rig_msgs", WARN, "not built yet", "the first ./rig run builds it; 'rig simulate' does without")
    import rig_msgs.action
    import rig_msgs.msg
    from rclpy.serialization import deserialize_message, serialize_message

    messages = [t for t in vars(rig_msgs.msg).values() if isinstance(t, type)]
    actions = [t for t in vars(rig_msgs.action).values() if hasattr(t, "Goal")]
    for kind in messages + [part for a in actions for part in (a.Goal, a.Feedback, a.Result)]:
        if deserialize_message(serialize_message(kind()), kind) != kind():
            return Finding("rig_msgs", FAIL, f"{kind.__name__} changes on its way through the serialiser")
    return Finding("rig_msgs", OK, f"{len(messages)} messages and {len(actions)} actions there and back")


def check_dds() -> Finding:
    """Check DDS with two nodes in two separate processes, so that a crash of the middleware becomes a finding."""
    from ..controllers import allocate, environment

    if importlib.util.find_spec("rclpy") is None:
        return Finding("DDS loopback", WARN, "not tried", "it needs ROS 2")
    with allocate() as domain:
        env = environment(domain)
        command = [sys.executable, "-P", "-m", "rig_nodes.cli.dds_probe"]
        quiet = subprocess.DEVNULL
        pong = subprocess.Popen([*command, "pong"], env=env, stdout=quiet, stderr=quiet)
        try:
            ping = subprocess.run([*command, "ping"], env=env, capture_output=True, text=True, timeout=DDS_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            return Finding(
                "DDS loopback", FAIL, f"no answer within {DDS_TIMEOUT_S:.0f} s", "is a firewall between programs on this host?"
            )
        finally:
            pong.kill()  # it holds no data, and a middleware that hangs at its end must not block the doctor
            pong.wait()
    if ping.returncode:
        lines = (ping.stderr or ping.stdout).strip().splitlines() or [f"exit code {ping.returncode}"]
        return Finding("DDS loopback", FAIL, lines[-1], "UDP on 127.0.0.1 must be usable")
    return Finding("DDS loopback", OK, f"{ping.stdout.strip()}, domain {domain.number}")


def check_loopback() -> Finding:
    """Check the flags of the loopback interface; the rig itself needs no multicast on it."""
    path = Path("/sys/class/net/lo/flags")
    if not path.is_file():
        return Finding("loopback", WARN, "no interface lo is listed", "processes talk through 127.0.0.1")
    flags = int(path.read_text(), 16)
    if not flags & 0x1:
        return Finding("loopback", FAIL, "the interface lo is down", "ip link set lo up")
    multicast = "on" if flags & 0x1000 else "off"
    return Finding("loopback", OK, f"up, multicast {multicast} (not needed: discovery stays on this host)")


def check_shared_memory() -> Finding:
    """Check for files that Fast DDS left in shared memory: those of a killed process are never removed."""
    if not os.access(SHM, os.W_OK):
        return Finding("shared memory", WARN, f"{SHM} cannot be written", "messages go the slow way, through UDP")
    names = glob.glob(str(SHM / "*fastrtps_*"))
    left = [p for p in names if p.endswith("_el") and is_left(p)]
    detail = f"{len(names)} files of Fast DDS, {len(left)} segments left by killed processes"
    if left:
        return Finding("shared memory", WARN, detail, f"when no ROS 2 program runs: rm -f {SHM}/*fastrtps_*")
    return Finding("shared memory", OK, detail)


def is_left(lock_file: str) -> bool:
    """Return True when the segment of this lock file has no living owner; owners hold the lock while they live."""
    try:
        with open(lock_file, "rb") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        return True
    except OSError:
        return False


# --- viewer ---------------------------------------------------------------------------------------


def check_viewer() -> Finding:
    """Check the viewer and what it needs to draw."""
    if importlib.util.find_spec("rerun") is None:
        return Finding("viewer", WARN, "rerun is not installed yet", "in a checkout the first ./rig view installs it")
    import rerun

    detail = f"rerun-sdk {rerun.__version__}"
    hints = []
    if find_vulkan_drivers():
        detail += ", Vulkan driver found"
    else:
        detail += ", no Vulkan driver"
        hints.append("install the Debian package mesa-vulkan-drivers to see or draw anything")
    if os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
        detail += ", display there"
    else:
        detail += ", no display"
        hints.append("without a display 'rig view' writes the recording and a picture")
    return Finding("viewer", OK if find_vulkan_drivers() else WARN, detail, "; ".join(hints))


def find_vulkan_drivers() -> list[str]:
    """Return the installable client drivers that a Vulkan loader would find."""
    named = os.environ.get("VK_DRIVER_FILES") or os.environ.get("VK_ICD_FILENAMES")
    if named:
        return [p for p in named.split(os.pathsep) if Path(p).is_file()]
    data = os.environ.get("XDG_DATA_DIRS", "/usr/local/share:/usr/share").split(os.pathsep)
    folders = ["/etc", "/usr/local/etc", "/usr/share", *data]
    return sorted({p for f in folders for p in glob.glob(os.path.join(f, "vulkan", "icd.d", "*.json"))})


CHECKS = (
    check_python,
    check_compiler,
    check_headers,
    check_environment,
    check_shell,
    check_disk,
    check_rclpy,
    check_messages,
    check_dds,
    check_loopback,
    check_shared_memory,
    check_numba_cache,
    check_viewer,
)
