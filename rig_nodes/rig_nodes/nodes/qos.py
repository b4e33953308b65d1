"""Quality-of-service profiles of the catalogue's classes, for the side that publishes and the side that receives.

Used by every node; config/signals.yaml says which class a topic has.
"""

from __future__ import annotations

from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

DEPTH = 1000  # at 1 kHz one second; depth 10 lost 0.4 % of the messages without a word
DEADLINE = Duration(nanoseconds=100_000_000)  # of a valve command, the age at which the rig trips


def publisher_profile(qos: str, in_lockstep: bool = False) -> QoSProfile:
    """Profile with which a topic of this class is offered.

    in_lockstep: without a deadline, which is one of real time, and whose timer costs more than the message.
    """
    profile = _reliable(DEPTH)
    if qos == "latched":
        profile.durability = DurabilityPolicy.TRANSIENT_LOCAL
    if qos == "command" and not in_lockstep:
        profile.deadline = DEADLINE
    return profile


def receiver_profile(qos: str) -> QoSProfile:
    """Profile with which the device that a topic is meant for receives it: of commands only the newest counts.

    A command is therefore received best effort: a reliable reader would hold back all newer ones until a lost one
    had been sent again, and that may take longer than the rig waits for its controller.
    """
    profile = publisher_profile(qos)
    if qos == "command":
        profile.depth = 1
        profile.reliability = ReliabilityPolicy.BEST_EFFORT
    return profile


def stream_profile(qos: str) -> QoSProfile:
    """Profile of a controller that answers every sample it gets: in order, and never behind a lost one."""
    profile = publisher_profile(qos)
    profile.reliability = ReliabilityPolicy.BEST_EFFORT
    return profile


def recorder_profile(qos: str) -> QoSProfile:
    """Profile of the recorder, which wants every message and demands no deadline."""
    profile = publisher_profile(qos)
    profile.deadline = Duration()
    return profile


def _reliable(depth: int) -> QoSProfile:
    return QoSProfile(history=HistoryPolicy.KEEP_LAST, depth=depth, reliability=ReliabilityPolicy.RELIABLE,
                      durability=DurabilityPolicy.VOLATILE)
