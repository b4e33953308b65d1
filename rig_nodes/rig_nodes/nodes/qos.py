# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Quality-of-service profiles of the catalogue's classes, for the side that publishes and the side that receives.

Used by every node; description.signals says which class a topic has, catalogue.QOS how a class is offered.
"""

from __future__ import annotations

from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from ..catalogue import QOS

COMMANDS = 100  # of a topic that wait for their receiver: at 1 kHz, those of the time after which the rig trips


def publisher_profile(qos: str, in_lockstep: bool = False) -> QoSProfile:
    """Profile with which a topic of this class is offered.

    in_lockstep: without a deadline, which is one of real time, and whose timer costs more than the message.
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
    """Profile with which the device that a topic is meant for receives it.

    No deadline is asked for: a publisher that offers none, as `ros2 topic pub`, would not be heard, and the rig watches
    the age of its commands itself. A command is received best effort: a reliable reader would hold back all newer ones
    until a lost one had been sent again, and that may take longer than the rig waits for its controller.
    """
    profile = recorder_profile(qos)
    if qos == "command":
        profile.depth = COMMANDS
        profile.reliability = ReliabilityPolicy.BEST_EFFORT
    return profile


def stream_profile(qos: str) -> QoSProfile:
    """Profile of a controller that answers every sample it gets: in order, and never behind a lost one."""
    profile = recorder_profile(qos)
    profile.reliability = ReliabilityPolicy.BEST_EFFORT
    return profile


def recorder_profile(qos: str) -> QoSProfile:
    """Profile of the recorder, which wants every message and demands no deadline."""
    profile = publisher_profile(qos)
    profile.deadline = Duration()
    return profile
