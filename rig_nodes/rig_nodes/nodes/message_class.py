# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The Python class of a message type by its name; it has a file of its own, so that short commands load nothing else for it."""

from __future__ import annotations

from importlib import import_module


def message_class(ros_type: str) -> type:
    """Return the class of a message type, e.g. ``rig_msgs/msg/Event``."""
    package, kind, name = ros_type.split("/")
    return getattr(import_module(f"{package}.{kind}"), name)
