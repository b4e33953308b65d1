# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The effects that the thesis names as sources of its own errors; each can be switched off, so that its influence can be shown.

runs.plan uses them: with an effect switched off, devices have the values that their parts name for that case.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from ..plant import part as parts

if TYPE_CHECKING:
    from .configuration import RigConfig


def leave_out(config: RigConfig) -> dict[str, object]:
    """Return the sections of a rig without the effects that are switched off.

    Parameters
    ----------
    config : RigConfig
        The rig's configuration, of rig.configuration.

    Returns
    -------
    dict of str to object
        The sections by name. Effects that the engine switches itself are left as they are.
    """
    out: dict[str, Any] = dict(config.sections)
    for device in config.structure.devices:
        for effect, values in parts.part(device.part).effects.items():
            if values and not getattr(config.effects, effect):
                out[device.name] = replace(out[device.name], **values)
    return out
