# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Quality-of-service profiles of the catalogue's classes, for the side that publishes and the side that receives.

Every node uses them; rig.signals sets the class of a topic, and catalogue.QOS how a class is offered.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rclpy.duration import Duration, Infinite
from rclpy.qos import DurabilityPolicy, HistoryPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy

from ..base import RigError, load_yaml, unknown
from ..rig import QOS

COMMANDS = 100  # messages that wait for their receiver: at 1 kHz, those of the time after which the rig trips


def publisher_profile(qos: str, in_lockstep: bool = False) -> QoSProfile:
    """Return the profile with which a topic of a class is offered.

    Parameters
    ----------
    qos : str
        Name of the class.
    in_lockstep : bool
        True to leave out the deadline, which counts real time and whose timer costs more than the message.

    Returns
    -------
    QoSProfile
        The profile.
    """
    offer = QOS[qos]
    profile = QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=offer.depth,
        reliability=ReliabilityPolicy.RELIABLE if offer.reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if offer.latched else DurabilityPolicy.VOLATILE,
    )
    if offer.deadline_ms and not in_lockstep:
        profile.deadline = Duration(nanoseconds=offer.deadline_ms * 1_000_000)
    return profile


def receiver_profile(qos: str) -> QoSProfile:
    """Return the profile with which the device for which a topic is meant receives it.

    No deadline is requested: a publisher that offers none, such as `ros2 topic pub`, would not be received, and the rig watches the
    age of its commands itself. A command is received best effort: a reliable reader would hold back all newer commands until a lost
    one had been sent again, and that may take longer than the rig waits for its controller.
    """
    profile = recorder_profile(qos)
    if qos == "command":
        profile.depth = COMMANDS
        profile.reliability = ReliabilityPolicy.BEST_EFFORT
    return profile


def stream_profile(qos: str) -> QoSProfile:
    """Return the profile of a controller that answers every sample it gets: in order, and without waiting for a lost one."""
    profile = recorder_profile(qos)
    profile.reliability = ReliabilityPolicy.BEST_EFFORT
    return profile


def recorder_profile(qos: str) -> QoSProfile:
    """Return the profile of the recorder, which receives every message and requests no deadline."""
    profile = publisher_profile(qos)
    profile.deadline = Duration()
    return profile


def beyond(offered: QoSProfile, asked: QoSProfile) -> str:
    """Return what a subscription asks for beyond what a publisher offers, in words; empty when the two are connected."""
    found = []
    if asked.reliability == ReliabilityPolicy.RELIABLE and offered.reliability == ReliabilityPolicy.BEST_EFFORT:
        found.append("reliable messages")
    if asked.durability == DurabilityPolicy.TRANSIENT_LOCAL and offered.durability == DurabilityPolicy.VOLATILE:
        found.append("messages from before it came (transient local)")
    if _seconds(asked.deadline) < _seconds(offered.deadline):
        found.append(f"a deadline of {_seconds(asked.deadline):g} s")
    if asked.liveliness == LivelinessPolicy.MANUAL_BY_TOPIC and offered.liveliness != LivelinessPolicy.MANUAL_BY_TOPIC:
        found.append("manual liveliness")
    if _seconds(asked.liveliness_lease_duration) < _seconds(offered.liveliness_lease_duration):
        found.append(f"liveliness within {_seconds(asked.liveliness_lease_duration):g} s")
    return " and ".join(found)


def _seconds(duration: Duration) -> float:
    """Return a duration of a profile [s]; 0 is none, and what DDS writes for none is above 60 years."""
    seconds = duration.nanoseconds * 1e-9
    return seconds if 0.0 < seconds < 2e9 else math.inf


WORDS = {"history": HistoryPolicy, "reliability": ReliabilityPolicy, "durability": DurabilityPolicy, "liveliness": LivelinessPolicy}
DURATIONS = ("deadline", "lifespan", "liveliness_lease_duration")
SWITCHES = ("avoid_ros_namespace_conventions",)
INFINITE = "infinite"


def read_overrides(path: Path) -> dict[str, dict[str, Any]]:
    """Read the file of `ros2 bag play --qos-profile-overrides-path`: for topics, fields of the profiles to offer.

    Parameters
    ----------
    path : Path
        YAML file: topic, and below it fields of rosbag2's profiles (WORDS, DURATIONS, SWITCHES, ``depth``).

    Returns
    -------
    dict of str to dict
        By topic, attributes of a QoSProfile and their values.

    Raises
    ------
    RigError
        When the file cannot be read, or names a field or a value that there is not.
    """
    given = load_yaml(path)
    if not isinstance(given, Mapping) or not all(isinstance(fields, Mapping) for fields in given.values()):
        raise RigError(f"{path}: expected topics with fields of their profiles, as '/motor/state: {{reliability: best_effort}}'")
    return {
        str(topic): {
            name: _value(name, value, f"{path}: {topic}")
            for name, value in fields.items()
            if not (name == "depth" and value is not False and value == 0)  # of a recorded profile: none was known
        }
        for topic, fields in given.items()
    }


def _value(name: str, value: Any, where: str) -> Any:
    """Return the value of a field of a QoSProfile; RigError when there is no such field or value."""
    if name in WORDS:
        policies = [policy for policy in WORDS[name] if policy.short_key not in ("unknown", "best_available")]
        values = {policy.short_key: policy for policy in policies} | {policy.value: policy for policy in policies}
        default, none = WORDS[name].SYSTEM_DEFAULT, WORDS[name].UNKNOWN
        values |= {none.short_key: default, none.value: default}  # so recorded profiles say that it was not known
        if isinstance(value, bool) or value not in values:
            words = [f"{policy.short_key} ({policy.value})" for policy in policies]
            raise RigError(f"{where}: {name} is {value}; expected {' or '.join(words)}")
        return values[value]
    if name == "depth":
        if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value <= 1_000_000:
            raise RigError(f"{where}: depth is {value}; expected a whole number from 0 to 1000000")
        return value
    if name in DURATIONS:
        return _duration(name, value, where)
    if name in SWITCHES:
        if not isinstance(value, bool):
            raise RigError(f"{where}: {name} is {value}; expected true or false")
        return value
    fields = [*WORDS, "depth", *DURATIONS, *SWITCHES]
    raise RigError(f"{where}: {unknown('field of a profile', str(name), fields)}")


def _duration(name: str, value: Any, where: str) -> Duration:
    """Return a duration; 0 and ``infinite`` are none at all."""
    if value == INFINITE:
        return Infinite
    expected = f"expected 'sec' and 'nsec', whole numbers from 0, or {INFINITE}"
    try:
        seconds, nanoseconds = value["sec"], value["nsec"]
        if type(seconds) is not int or type(nanoseconds) is not int or min(seconds, nanoseconds) < 0:
            raise ValueError(value)
        return Duration(seconds=seconds, nanoseconds=nanoseconds)
    except OverflowError:
        return Infinite
    except (TypeError, KeyError, ValueError):
        raise RigError(f"{where}: {name} is {value}; {expected}") from None
