# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the thesis names as the sources of its own errors, each to be switched off, so that its effect can be shown.

Used by testbench.plan: a switched-off effect is a rig whose devices have the values that their parts name for it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from ..parts import part as parts

if TYPE_CHECKING:
    from .configuration import RigConfig


def leave_out(config: RigConfig) -> dict[str, object]:
    """The sections of a rig (testbench.configuration.RigConfig) without what is switched off; what the engine switches stays."""
    out = dict(config.sections)
    for device in config.structure.devices:
        for effect, values in parts.part(device.part).effects.items():
            if values and not getattr(config.effects, effect):
                out[device.name] = replace(out[device.name], **values)
    return out
