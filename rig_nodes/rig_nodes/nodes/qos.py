# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Quality-of-service profiles of the catalogue's classes, for the side that publishes and the side that receives.

Every node uses them; description.signals sets the class of a topic, and catalogue.QOS how a class is offered.
"""

from __future__ import annotations

from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from ..catalogue import QOS

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
