# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The executor of every process of the rig that has nodes; nodes.process, nodes.replay and nodes.live_view use it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..base import RigError

if TYPE_CHECKING:
    from rclpy.executors import Executor

RCLPY = "7.1.4"  # of Jazzy, the first one with it; package.xml says so too


def events_executor() -> Executor:
    """Return a new EventsExecutor, which costs less than rclpy's other executors; RigError when this rclpy has none."""
    try:
        from rclpy.experimental import EventsExecutor
    except ImportError:
        raise RigError(
            f"this rclpy has no EventsExecutor; the rig needs rclpy {RCLPY} or newer, which the updates of "
            "Jazzy bring (package ros-jazzy-rclpy)"
        ) from None
    return EventsExecutor()
