# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The HydmAG virtual powertrain test rig as ROS 2 nodes; see docs/background/architecture.md for the walls."""

import re
from pathlib import Path


def _version() -> str:
    """The version of package.xml, which is its only place: read there in a checkout, and otherwise as it was installed."""
    manifest = Path(__file__).parents[1] / "package.xml"
    if manifest.is_file() and (found := re.search("<version>(.+?)</version>", manifest.read_text(encoding="utf-8"))):
        return found[1]
    from importlib.metadata import version

    return version("rig_nodes")


__version__ = _version()
