# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The Python class of a message type by its name; it has a file of its own, so that short commands load nothing else for it."""

from __future__ import annotations

from importlib import import_module

from rclpy.type_support import check_for_type_support


def message_class(ros_type: str) -> type:
    """Return the class of a message type, e.g. ``rig_msgs/msg/Event``.

    ImportError, AttributeError or ValueError when it is not installed here, or its libraries cannot be loaded.
    """
    package, kind, name = ros_type.split("/")
    found = getattr(import_module(f"{package}.{kind}"), name)
    try:
        check_for_type_support(found)
    except Exception as error:  # rosidl and rclpy raise classes of their own
        raise ImportError(f"{type(error).__name__}: {error}") from None
    return found
