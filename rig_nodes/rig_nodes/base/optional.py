# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Packages that an extra of rig_nodes installs, loaded when they are used; everything that needs such a package asks here."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING

from .errors import RigError

if TYPE_CHECKING:
    from types import ModuleType

ROS = ("rclpy", "rig_msgs")  # packages without which no node runs


class Lacking(RigError):
    """A package of an extra is missing: ``extra`` is its name, by which the launcher of a checkout can add it."""

    def __init__(self, text: str, extra: str) -> None:
        super().__init__(text)
        self.extra = extra


def optional(module: str, extra: str = "") -> ModuleType:
    """Load a module of an optional package.

    Parameters
    ----------
    module : str
        Its name in Python, e.g. ``"matplotlib.figure"``.
    extra : str
        The extra of rig_nodes that installs its package; empty for one that always comes with it, except beside a system ROS 2.

    Returns
    -------
    ModuleType
        The module.

    Raises
    ------
    Lacking
        When it cannot be loaded; the sentence says what installs it.
    """
    try:
        return import_module(module)
    except (ImportError, AttributeError) as error:  # AttributeError: rerun with a numpy that is too old for it
        package = module.partition(".")[0]
        missing = isinstance(error, ModuleNotFoundError) and (error.name or module).partition(".")[0] == package
        why = "is not installed" if missing else f"cannot be loaded ({error})"
        name = f"'rig_nodes[{extra}]'" if extra else package
        raise Lacking(f"the Python package {package} {why}; pip install {name}{_old_numpy(package)}", extra) from None


def need_ros(what: str) -> None:
    """Refuse what takes ROS 2 where it is missing.

    Parameters
    ----------
    what : str
        What needs it, as the beginning of the sentence.

    Raises
    ------
    Lacking
        When rclpy or the rig's messages are missing.
    """
    missing = [name for name in ROS if find_spec(name) is None]
    if missing:
        raise Lacking(
            f"{what} needs ROS 2 Jazzy with the rig's messages, and this Python has no {' and no '.join(missing)}; "
            "a checkout's ./rig sets both up, and docs/how_to/ros2.md shows the way beside an installed ROS 2",
            "ros",
        )


def _old_numpy(package: str) -> str:
    """What pip must be told where numpy 1 has to stay, as beside a system ROS 2."""
    import numpy

    if not numpy.__version__.startswith("1."):
        return ""
    return " 'numpy<2'" + " 'pyarrow<26'" * (package == "pyarrow")  # which does not tell pip the numpy that it was built for
