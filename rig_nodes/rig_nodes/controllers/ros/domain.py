# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A ROS domain of its own for every run, so that two runs, or a run and its tests, never receive each other's messages.

The supervisor, nodes started without one, replays and tests use it. A domain is reserved by the name of a socket, which
the kernel frees when its process dies. A second such name shows that a rig or a replay is in the domain; there is at
most one.
"""

from __future__ import annotations

import os
import re
import secrets
import socket
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

from ...base import RigError, package_file

# Domain 101 is the last one whose ports are below the ephemeral ports of Linux (32768).
FIRST, LAST = 1, 101
HIGHEST = 232  # highest domain that ROS accepts
BASE_PORT, PORTS = 7400, 250  # RTPS 9.6.1.1: first port of domain 0, ports of one domain
RESERVED, RIG = "rig-ros-domain", "rig-in-ros-domain"  # begins of socket names: a reserved domain, a domain with a rig
LOOK_TIMEOUT = 20.0  # s
GLANCE = 0.02  # s between two looks for the end of a rig


def busy_domains() -> set[int]:
    """Return the domains in which some process of this host has a UDP port open, reserved or not."""
    busy = set()
    for table in ("/proc/net/udp", "/proc/net/udp6"):
        try:
            lines = Path(table).read_text().splitlines()[1:]
        except OSError:
            continue
        for line in lines:
            port = int(line.split()[1].rpartition(":")[2], 16)
            if BASE_PORT <= port < BASE_PORT + PORTS * (HIGHEST + 1):
                busy.add((port - BASE_PORT) // PORTS)
    return busy


def participants(number: int) -> int:
    """Return how many DDS participants of this host are in a domain: each has a port of its own (RTPS 9.6.1.1)."""
    ports = set()
    for table in ("/proc/net/udp", "/proc/net/udp6"):
        with suppress(OSError):
            ports |= {int(line.split()[1].rpartition(":")[2], 16) for line in Path(table).read_text().splitlines()[1:]}
    first = BASE_PORT + PORTS * number + 10
    return len(ports & set(range(first, first + PORTS - 10, 2)))


class Domain:
    """One domain, reserved until :meth:`release`; a context manager. ``number`` is the value for ROS_DOMAIN_ID."""

    def __init__(self, number: int, *locks: socket.socket) -> None:
        self.number, self._locks = number, list(locks)

    def lead(self, look: bool = True) -> Domain:
        """Become the only rig, or replay, of the domain until :meth:`release`.

        Parameters
        ----------
        look : bool
            True: also look over DDS for a rig without a socket here; this takes 2 s when a process of this host is in the
            domain.

        Returns
        -------
        Domain
            This domain.

        Raises
        ------
        RigError
            When there is a rig or a replay in it already.
        """
        lock = _lock(RIG, self.number)
        sender = "it runs on this machine" if lock is None else ""
        if lock is not None:
            self._locks.append(lock)
            if look and self.number in busy_domains() and (names := _senders(self)):
                sender = f"/rig/state is sent by {', '.join(names)}"
        if sender:
            raise RigError(
                f"there is a rig or a replay in ROS domain {self.number} already ({sender}), and two would "
                "take each other's orders; end that one, or take another domain with ROS_DOMAIN_ID"
            )
        return self

    def release(self) -> None:
        """Release the domain; it may be called twice."""
        while self._locks:
            self._locks.pop().close()

    def __enter__(self) -> Domain:
        return self

    def __exit__(self, *_: object) -> None:
        self.release()


def allocate() -> Domain:
    """Return a domain that no other run and no other ROS process of this host uses; RigError when all are in use."""
    busy = busy_domains()
    for number in range(FIRST, LAST + 1):
        if number not in busy:
            held, rig = _lock(RESERVED, number), _lock(RIG, number)
            if rig is not None:
                rig.close()
            if held is not None and rig is not None:
                return Domain(number, held)
            if held is not None:
                held.close()
    raise RigError(f"all ROS domains from {FIRST} to {LAST} are in use on this machine; end another run or set ROS_DOMAIN_ID")


def _senders(domain: Domain) -> list[str]:
    """Return the names of the nodes that send /rig/state in a domain."""
    try:
        looked = subprocess.run(
            [sys.executable, "-P", "-m", "rig_nodes.controllers.ros.look_for_rig"],
            env=environment(domain),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=LOOK_TIMEOUT,
        )
    except subprocess.TimeoutExpired:
        raise RigError(
            f"no ROS node can be started in ROS domain {domain.number}: nothing came within "
            f"{LOOK_TIMEOUT:.0f} s; './rig doctor' gives details"
        ) from None
    if looked.returncode:
        lines = looked.stderr.strip().splitlines()
        why = lines[-1] if lines else "without a word"
        raise RigError(f"no ROS node can be started in ROS domain {domain.number} ({why}); './rig doctor' gives details")
    return looked.stdout.splitlines()


def _lock(name: str, number: int) -> socket.socket | None:
    # An abstract name belongs to the network namespace, as the domain's ports do: all its users and folders share it.
    held = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    try:
        held.bind(f"\0{name}-{number}")
    except OSError:
        held.close()
        return None
    return held


def announce(number: int) -> socket.socket:
    """Let :func:`running_rigs` find the rig of this process in a domain, until the returned socket is closed."""
    sign = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    sign.bind(f"\0rig-runs-in-domain-{number}-{secrets.token_hex(4)}")
    return sign


def running_rigs() -> list[int]:
    """Return the domains in which a rig of this host runs, sorted; it does not matter how the rig was started."""
    names = Path("/proc/net/unix").read_text(encoding="utf-8", errors="replace")
    return sorted({int(number) for number in re.findall(r"@rig-runs-in-domain-(\d+)-", names)})


def until_free(number: int, seconds: float) -> bool:
    """Wait until the rig or replay of a domain, with its report, is done; return False when it is not after so many seconds."""
    deadline = time.monotonic() + seconds
    while f"@{RIG}-{number}\n" in Path("/proc/net/unix").read_text(encoding="utf-8", errors="replace"):
        if time.monotonic() > deadline:
            return False
        time.sleep(GLANCE)
    return True


def numbered(number: int) -> Domain:
    """Return the domain that --domain names; RigError when the number is not from 0 to 232."""
    if not 0 <= number <= 232:
        raise RigError(f"--domain {number}: expected a number from 0 to 232")
    return Domain(number)


def of_running_rig(number: int | None) -> Domain:
    """Return the domain of the rig that a command is for: --domain, else ROS_DOMAIN_ID, else that of this host's only rig.

    Parameters
    ----------
    number : int or None
        The number of --domain.

    Returns
    -------
    Domain
        The domain.

    Raises
    ------
    RigError
        When no rig runs there, or several rigs run and none is named.
    """
    rigs = running_rigs()
    if number is not None or os.environ.get("ROS_DOMAIN_ID"):
        domain = numbered(number) if number is not None else from_environment()
        if domain.number not in rigs:
            where = f"the others run in {', '.join(map(str, rigs))}" if rigs else "no rig runs on this host"
            raise RigError(f"no rig runs in ROS domain {domain.number}; {where}")
        return domain
    if not rigs:
        raise RigError("no rig runs on this host, or none has started yet; start one with: ./rig run")
    if len(rigs) > 1:
        raise RigError(f"rigs run in the ROS domains {', '.join(map(str, rigs))}; choose one with --domain N")
    return Domain(rigs[0])


def from_environment(keep: bool = False) -> Domain:
    """Return the domain of a run: ROS_DOMAIN_ID when it is set, else a domain of its own.

    Parameters
    ----------
    keep : bool
        True: without ROS_DOMAIN_ID return domain 0 in place of one of its own.

    Returns
    -------
    Domain
        The domain.

    Raises
    ------
    RigError
        When ROS_DOMAIN_ID is no number from 0 to 232.
    """
    text = os.environ.get("ROS_DOMAIN_ID", "")
    if not text and not keep:
        return allocate()
    if not (text or "0").isdecimal() or not 0 <= int(text or "0") <= HIGHEST:
        raise RigError(f"ROS_DOMAIN_ID is '{text}', expected a number from 0 to 232")
    return Domain(int(text or "0"))


def check_namespace(namespace: str, where: str) -> None:
    """Raise RigError for a namespace other than the root; ``where`` begins its sentence."""
    if namespace.strip("/"):
        raise RigError(
            f"{where}: the rig has no namespace, for its topics, actions and services have absolute names; "
            "give it a ROS domain of its own (ROS_DOMAIN_ID) to have it beside others"
        )


def environment(domain: Domain) -> dict[str, str]:
    """Return the environment of one of the rig's processes in this domain; fastdds.xml configures its DDS.

    SYSTEM_DEFAULT leaves the transports to that file, which keeps them on this host; LOCALHOST would add shared memory.
    """
    env = dict(os.environ)
    for name in ("ROS_LOCALHOST_ONLY", "FASTDDS_BUILTIN_TRANSPORTS"):
        env.pop(name, None)  # these would override the variables below
    profiles = str(package_file("fastdds.xml"))
    env.update(
        ROS_DOMAIN_ID=str(domain.number),
        ROS_AUTOMATIC_DISCOVERY_RANGE="SYSTEM_DEFAULT",
        ROS_STATIC_PEERS="",
        FASTRTPS_DEFAULT_PROFILES_FILE=profiles,
        FASTDDS_DEFAULT_PROFILES_FILE=profiles,
    )
    return env


def use_own_transports() -> None:
    """Configure DDS in this process as :func:`environment` does, in its terminal's domain, before ROS is started.

    It is for nodes that `ros2 run` or a launch file starts. A profiles file that the user has set stays in force.
    """
    if os.environ.get("FASTDDS_DEFAULT_PROFILES_FILE") or os.environ.get("FASTRTPS_DEFAULT_PROFILES_FILE"):
        return
    wanted = environment(from_environment(keep=True))
    for name in set(os.environ) - set(wanted):
        del os.environ[name]
    os.environ.update(wanted)
