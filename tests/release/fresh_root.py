#!/usr/bin/env python3
# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Release check: the README's commands, as an unprivileged user, in a Debian root that is newly made for it.

With --core: the package as a wheel by pip alone, without ROS and without a compiler; its bag must be the checkout's.

Run by hand or by a release job, as root (README.md beside it). Packages and commands are read from the README of
the commit that is checked. Exit code 0: all commands passed; 1: one failed; 2: the check could not be made.
Standard library only. Mounts and processes live in namespaces of their own, so the kernel ends them with the
script in every case; nothing has to be unmounted.
"""

import argparse
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parents[2]
SECTION = "## Two commands"
USER = "rig"
HOME = "home/" + USER
BUNDLE = "rig.bundle"
DISK_MIN_GB = 5.0
LOCAL_CERTIFICATES = "usr/local/share/ca-certificates"
# Variables with which this machine reaches its package index; the commands in the root get no others from it.
ACCESS = re.compile(r"PIP_\w+|(https?|all|no)_proxy|SSL_CERT_(FILE|DIR)|REQUESTS_CA_BUNDLE", re.IGNORECASE)


# Without ROS and without a compiler: the built wheel in an environment of its own, the verbs that it is for, the bag that the
# checkout's own environment makes too, and the time of the import.
CORE_PACKAGES = ["python3", "python3-pip", "python3-venv", "git", "ca-certificates"]
BIN = "/home/rig/core/bin"
IMPORT_MOST_MS = 150
CORE = [
    "python3 -m venv /home/rig/core",
    BIN + "/pip wheel --quiet --no-deps --wheel-dir /home/rig/wheel ./rig_nodes",
    BIN + "/pip install --quiet /home/rig/wheel/rig_nodes-*-py3-none-any.whl",
    BIN + "/pip check",
    BIN + "/rig simulate demo --out /home/rig/run",
    BIN + "/rig report /home/rig/run",
    BIN + "/rig sweep demo --vary alfa46.t12='-220 ms, -100 ms' --out /home/rig/sweep",
    "! %s/rig run demo" % BIN,  # which says in a sentence that it takes ROS
    BIN + "/python -X importtime -c 'import rig_nodes' 2>&1 | awk -F'|' 'BEGIN {slow = 1} / rig_nodes$/ "
    '{print "import of rig_nodes:", $2 / 1000, "ms"; slow = $2 / 1000 > %d} END {exit slow}\'' % IMPORT_MOST_MS,
    "./rig simulate demo --out /home/rig/checkout",
    BIN + "/rig bag hash /home/rig/run /home/rig/checkout",
    "test $(%s/rig bag hash /home/rig/run /home/rig/checkout | cut -d' ' -f1 | sort -u | wc -l) = 1" % BIN,
]
TIMED = "./rig simulate demo"  # whose time from a fresh clone is looked at, beside that of the README's first command


class CheckError(Exception):
    """The reason why the check cannot be made here, in one sentence."""


# --- what is checked ------------------------------------------------------------------------------


def git(*arguments):
    """Returns the output of a git command in the checkout, which may belong to another user than root."""
    try:
        command = ["git", "-c", "safe.directory=%s" % CHECKOUT, "-C", str(CHECKOUT), *arguments]
        return subprocess.check_output(command, stderr=subprocess.PIPE, text=True).strip()
    except subprocess.CalledProcessError as e:
        why = " ".join(e.stderr.split())
        raise CheckError("git %s in %s failed: %s" % (arguments[0], CHECKOUT, why)) from None


def read_readme(text):
    """Returns (packages, commands) of the README: `apt install ...` and the first indented block of its section."""
    section = re.search(r"^%s$(.*?)(?=^## |\Z)" % re.escape(SECTION), text, re.MULTILINE | re.DOTALL)
    if not section:
        raise CheckError("README.md has no section %r, from which packages and commands are read" % SECTION)
    install = re.search(r"`(?:sudo )?apt(?:-get)? install ([^`]+)`", section[1])
    block = re.search(r"(?:^ {4}\S.*\n?)+", section[1], re.MULTILINE)
    if not install or not block:
        lost = "an indented block with the commands" if install else "`apt install ...` with the packages"
        raise CheckError("README.md, section %r, lacks %s" % (SECTION, lost))
    commands = [re.sub(r"\s+#.*", "", line).strip() for line in block[0].splitlines()]
    return [p for p in install[1].split() if not p.startswith("-")], [TIMED, "rm -rf .venv", *commands]


# --- what the machine needs -----------------------------------------------------------------------


def check_machine(folder):
    """Raise CheckError with the first reason why no root can be made in `folder`."""
    if sys.platform != "linux" or os.geteuid() != 0:
        raise CheckError("only root on Linux can make a Debian root: start this script with sudo")
    for tool, package in (
        ("debootstrap", "debootstrap"),
        ("git", "git"),
        ("chroot", "coreutils"),
        ("unshare", "util-linux"),
        ("setpriv", "util-linux"),
    ):
        if not shutil.which(tool):
            raise CheckError("%s is missing: install the Debian package %s" % (tool, package))
    probe = ["unshare", "--mount", "--pid", "--fork", "true"]
    if subprocess.run(probe, stderr=subprocess.DEVNULL).returncode:
        raise CheckError(
            "mounting is not allowed here: start this script outside of the container, or in "
            "one with the right to mount (CAP_SYS_ADMIN)"
        )
    free = shutil.disk_usage(folder).free / 1e9
    if free < DISK_MIN_GB:
        raise CheckError(
            "%.0f GB of free disk are needed in %s, there are %.1f GB: name another folder with "
            "--root" % (DISK_MIN_GB, folder, free)
        )


def make_folder(wanted):
    """Returns the empty folder for the root: the wanted one, or a temporary one."""
    if wanted is None:
        folder = Path(tempfile.mkdtemp(prefix="fresh_root_")).resolve()
        folder.chmod(0o755)  # it becomes the / of an unprivileged user
        return folder
    folder = Path(wanted).resolve()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if any(folder.iterdir()):
            raise CheckError("%s is not empty: name a new or empty folder with --root" % folder)
    except OSError as e:
        raise CheckError("%s cannot be used as a folder for the root: %s" % (folder, e.strerror)) from None
    return folder


def remove(folder):
    """Removes the root; processes that were killed a moment ago may still use it."""
    for _ in range(20):
        shutil.rmtree(folder, ignore_errors=True)
        if not folder.exists():
            return
        time.sleep(0.25)
    raise CheckError("%s cannot be removed completely: delete it by hand" % folder)


# --- the root -------------------------------------------------------------------------------------


def run_quietly(command, log, failure):
    """Run a tool with its output in the file `log`; a failure becomes a CheckError with the reason."""
    with open(log, "w+", errors="replace") as output:
        code = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=output, stderr=output).returncode
        output.seek(0)
        lines = [line.strip() for line in output if line.strip()]
    if code:
        reasons = [line[2:].strip() for line in lines if re.match(r"[EW]:", line)] or lines
        raise CheckError("%s: %s" % (failure, reasons[-1] if reasons else "no reason given"))


def make_root(root, suite, mirror, packages):
    """Makes a minimal Debian with these packages in the folder `root`, in which nothing is mounted yet."""
    command = ["debootstrap", "--variant=minbase", "--include=" + ",".join(packages), suite, str(root)]
    run_quietly(
        command + ([mirror] if mirror else []),
        root / "debootstrap.log",
        "the Debian root cannot be made (no network, or another mirror is needed: --mirror)",
    )


def mount_filesystems(root):
    """Mounts the file systems of a booted system: /proc, /sys, shared memory for DDS, terminals."""
    for kind, options, where in (
        ("proc", "nosuid,nodev,noexec", "proc"),
        ("sysfs", "ro,nosuid,nodev,noexec", "sys"),
        ("tmpfs", "nosuid,nodev,mode=1777", "dev/shm"),
        ("devpts", "newinstance,ptmxmode=666,mode=620,gid=5", "dev/pts"),
    ):
        (root / where).mkdir(exist_ok=True)
        run_quietly(
            ["mount", "-t", kind, "-o", options, kind, str(root / where)],
            root / "mount.log",
            "/%s cannot be mounted in the root" % where,
        )


def mount_indexes(root, texts):
    """Mounts the folders of this machine that pip's settings name, read-only and at the same place."""
    for name in sorted({name for text in texts for name in re.findall(r"(?<![\w/])(?:file://)?(/[\w./-]+)", text)}):
        folder, place = Path(name), root / name.lstrip("/")
        if folder.is_dir():
            place.mkdir(parents=True, exist_ok=True)
            mount = ["mount", "--bind", "-o", "ro", str(folder), str(place)]
            run_quietly(mount, root / "mount.log", "%s cannot be mounted in the root" % folder)


def give_access(root):
    """Copies name resolution, pip settings and local certificates of this machine; returns the variables."""
    access = {k: v for k, v in os.environ.items() if ACCESS.fullmatch(k)}
    local = list(Path("/", LOCAL_CERTIFICATES).glob("**/*.crt"))
    files = [Path("/etc/resolv.conf"), Path("/etc/hosts"), Path("/etc/pip.conf"), *local]
    files += [Path(v) for v in access.values() if os.path.isabs(v)]
    settings = [path.read_text() for path in (Path("/etc/pip.conf"),) if path.is_file()]
    mount_indexes(root, [*settings, *(value for name, value in access.items() if name.upper().startswith("PIP_"))])
    for path in files:
        copy = root / path.relative_to("/")
        # The root's own certificate bundle stays; the machine's additions to it come below.
        if path.is_file() and (path.parent == Path("/etc") or not copy.exists()):
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.unlink(missing_ok=True)
            shutil.copyfile(path, copy)
    if local and (root / "usr/sbin/update-ca-certificates").exists():
        run_quietly(
            ["chroot", str(root), "/usr/sbin/update-ca-certificates"],
            root / "certificates.log",
            "this machine's certificates cannot be added to the root",
        )
    return access


def clone_checkout(root, environment):
    """Clones the bundled commit into the user's home, as the user and as a reader of the README does it."""
    run_quietly(
        ["chroot", str(root), "useradd", "--create-home", "--shell", "/bin/bash", USER],
        root / "user.log",
        "the user cannot be made in the root",
    )
    quiet = "-c advice.detachedHead=false -c init.defaultBranch=main"
    command = "git %s clone --quiet /%s rig" % (quiet, BUNDLE)
    if run_as_user(root, command, root / HOME, environment, timeout=300):
        raise CheckError("the commit cannot be cloned in the root (git said why above)")


# --- the commands ---------------------------------------------------------------------------------


def run_as_user(root, command, folder, environment, timeout):
    """Runs a shell command as the root's user in `folder`; returns its exit code, 124 when it took too long."""

    def ordinary_login():
        # Root's shell may have rights that a login does not have; with real-time rights the check would not be strict enough.
        for right in (resource.RLIMIT_RTPRIO, resource.RLIMIT_NICE):
            resource.setrlimit(right, (0, 0))

    inside = "cd /%s && %s" % (folder.relative_to(root), command)
    # The user's PATH, in which a name would be looked up here, has no chroot.
    process = subprocess.Popen(
        [shutil.which("chroot"), "--userspec=%s:%s" % (USER, USER), str(root), "/bin/sh", "-c", inside],
        stdin=subprocess.DEVNULL,
        env=environment,
        preexec_fn=ordinary_login,
        start_new_session=True,
    )
    end = time.monotonic() + timeout
    # This is process 1 of its namespace, so it has to collect all processes there that lose their parent.
    while True:
        pid, status = os.waitpid(-1, os.WNOHANG)
        if pid == process.pid:
            process.returncode = os.waitstatus_to_exitcode(status)
            return process.returncode
        if pid == 0:
            if time.monotonic() > end:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()
                return 124
            time.sleep(0.05)


def check(root, options):
    """Make the root, run the commands, print the summary; runs as process 1 of its own namespaces."""
    began = time.monotonic()
    git("bundle", "create", "--quiet", str(root / BUNDLE), "HEAD")
    commit = git("bundle", "list-heads", str(root / BUNDLE)).split()[0]
    packages, commands = (CORE_PACKAGES, CORE) if options.core else read_readme(git("show", commit + ":README.md"))
    packages = [*packages, *(p for p in options.extra if p not in packages)]
    what = "Debian %s in %s with %s" % (options.suite, root, " ".join(packages))
    print("fresh root: making " + what, flush=True)
    make_root(root, options.suite, options.mirror, packages)
    mount_filesystems(root)
    environment = {
        "HOME": "/" + HOME,
        "USER": USER,
        "LOGNAME": USER,
        "SHELL": "/bin/bash",
        "LANG": "C.UTF-8",
        "PATH": "/usr/local/bin:/usr/bin:/bin",
        "TERM": os.environ.get("TERM", "dumb"),
        **give_access(root),
    }
    clone_checkout(root, environment)
    version = (root / "etc/debian_version").read_text().strip()
    python = subprocess.check_output(["chroot", str(root), "python3", "--version"], text=True).strip()
    print("fresh root: Debian %s with %s in %.0f s" % (version, python, time.monotonic() - began), flush=True)

    results, failed = [], False
    for command in commands:
        print("fresh root: $ %s" % command, flush=True)
        began = time.monotonic()
        code = run_as_user(root, command, root / HOME / "rig", environment, options.timeout)
        failed |= code != 0
        why = "ok" if code == 0 else "took too long, ended" if code == 124 else "FAILED (exit code %d)" % code
        results.append("%s %s after %.0f s" % (command, why, time.monotonic() - began))
    verdict = "FAILED" if failed else "passed"
    print("fresh root: %s on Debian %s, %s, commit %s: %s" % (verdict, version, python, commit[:12], "; ".join(results)))
    return int(failed)


# --- the start ------------------------------------------------------------------------------------


def read_options(arguments):
    parser = argparse.ArgumentParser(description="Run the README's commands in a Debian root made for it.")
    parser.add_argument("--root", metavar="FOLDER", help="new or empty folder for the root (a temporary one)")
    parser.add_argument("--keep", action="store_true", help="leave the root where it is, to look into it")
    parser.add_argument("--suite", default="trixie", help="Debian release (trixie, which is Debian 13)")
    parser.add_argument(
        "--mirror",
        default=os.environ.get("DEBIAN_MIRROR"),
        metavar="URL",
        help="where Debian packages come from (DEBIAN_MIRROR, else what debootstrap takes)",
    )
    parser.add_argument(
        "--with",
        dest="extra",
        action="append",
        default=[],
        metavar="PACKAGE",
        help="a Debian package beside those of the README's `apt install`; may be repeated",
    )
    parser.add_argument("--core", action="store_true", help="the package without ROS and without a compiler, by pip alone")
    parser.add_argument("--timeout", type=float, default=1800.0, metavar="S", help="longest time of one command (1800)")
    parser.add_argument("--inside", metavar="FOLDER", help=argparse.SUPPRESS)
    return parser.parse_args(arguments)


def main(arguments):
    options = read_options(arguments)
    os.umask(0o022)  # root's own mask may be stricter, and then the user in there could not read anything
    if options.inside:
        return check(Path(options.inside), options)

    place = Path(options.root or tempfile.gettempdir()).resolve()
    check_machine(next(p for p in (place, *place.parents) if p.is_dir()))
    if git("status", "--porcelain"):
        print("fresh root: the checkout has changes that are not committed; they take no part", flush=True)
    folder = make_folder(options.root)
    inside = None
    try:
        # Each of the two ends with its parent, and all other processes end with process 1 of the namespaces.
        inside = subprocess.Popen(
            [
                "setpriv",
                "--pdeathsig",
                "KILL",
                "unshare",
                "--mount",
                "--pid",
                "--fork",
                "--kill-child",
                sys.executable,
                os.path.abspath(__file__),
                *arguments,
                "--inside",
                str(folder),
            ]
        )
        return inside.wait()
    finally:
        if inside and inside.poll() is None:
            inside.kill()
            inside.wait()
        if options.keep:
            print("fresh root: left in %s" % folder)
        else:
            remove(folder)


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    try:
        sys.exit(main(sys.argv[1:]))
    except CheckError as e:
        sys.stderr.write("fresh root: %s\n" % e)
        sys.exit(2)
    except KeyboardInterrupt:
        sys.exit(130)
