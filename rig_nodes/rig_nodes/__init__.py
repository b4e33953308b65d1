# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A virtual powertrain test rig: ``load`` a rig, ``simulate`` a sequence, ``open`` a run, ``sweep`` many.

The names are found in the room api when they are asked for; docs/background/architecture.md describes the rooms.
"""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from .environments import register

if TYPE_CHECKING:
    from .api import (
        Calibrated,
        Compared,
        Rerun,
        Rig,
        Run,
        Signal,
        Signals,
        Table,
        Tuned,
        assert_events,
        assert_never,
        assert_shift,
        assert_stays,
        bench,
        bench_faults,
        calibrate,
        load,
        open,
        procedure,
        procedure_series,
        sweep,
        tune,
        validate,
    )
    from .base import RigError
    from .runs import Session

__all__ = [
    "Calibrated",
    "Compared",
    "Rerun",
    "Rig",
    "RigError",
    "Run",
    "Session",
    "Signal",
    "Signals",
    "Table",
    "Tuned",
    "assert_events",
    "assert_never",
    "assert_shift",
    "assert_stays",
    "bench",
    "bench_faults",
    "calibrate",
    "load",
    "open",
    "procedure",
    "procedure_series",
    "sweep",
    "tune",
    "validate",
]
ROOMS = {"RigError": ".base", "Session": ".runs"}  # of names that are not api's


def __getattr__(name: str) -> object:
    if name in __all__:
        return getattr(import_module(ROOMS.get(name, ".api"), __name__), name)
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")


def __dir__() -> list[str]:
    return [*__all__, "__version__"]


def _version() -> str:
    """The version of package.xml, which is its only place: read there in a checkout, and otherwise as it was installed."""
    manifest = Path(__file__).parents[1] / "package.xml"
    if manifest.is_file() and (found := re.search("<version>(.+?)</version>", manifest.read_text(encoding="utf-8"))):
        return found[1]
    from importlib.metadata import version

    return version("rig_nodes")


__version__ = _version()
register()
