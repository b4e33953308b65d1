# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Registers the environment with gymnasium; `import rig_nodes` calls it, before or after gymnasium is imported.

gymnasium finds environments in its registry alone, and to import it takes half a second, which `import rig_nodes` does not spend.
"""

from __future__ import annotations

import sys
from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence
    from importlib.machinery import ModuleSpec
    from types import ModuleType

GYMNASIUM = "gymnasium"
SHIFT = "rig_nodes/Shift-v0"
DEFAULTS = {"rig": "hydmag", "sequence": "demo"}


class _AtImport:
    """A finder that lets gymnasium be imported as ever, and registers the environment afterwards."""

    def find_spec(self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None) -> ModuleSpec | None:
        """Return what the other finders find; of gymnasium, with a loader that calls :func:`register` at its end."""
        if name != GYMNASIUM:
            return None
        found = (one.find_spec(name, path, target) for one in sys.meta_path if one is not self)
        spec = next(filter(None, found), None)
        if spec is not None and spec.loader is not None:
            execute = spec.loader.exec_module

            def then_register(module: ModuleType) -> None:
                execute(module)
                sys.meta_path.remove(self)
                register()

            spec.loader.exec_module = then_register
        return spec


def register() -> None:
    """Register the environment now where gymnasium is imported already, else as soon as it is."""
    if GYMNASIUM not in sys.modules:
        sys.meta_path.insert(0, _AtImport())
        return
    gymnasium = import_module(GYMNASIUM)
    if SHIFT not in gymnasium.registry:
        gymnasium.register(SHIFT, entry_point="rig_nodes.api.shift_env:ShiftEnv", kwargs=DEFAULTS)
