# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The kinds of steps of which a page composes a sequence, from the rig's setpoints and gears; nodes.panel.description tells them.

Each is a line of a sequence's file with VALUE in it, and a value to begin with.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from ...base import SI
from ...plant import part as parts
from ..running_rig import read_in

if TYPE_CHECKING:
    from ...rig import RigConfig, Setting
    from .loads import Load

VALUE = "VALUE"
SHARE = 0.4  # of the highest value, to begin with


def steps_of(config: RigConfig, loads: Mapping[str, Load], drive: list[dict[str, str]]) -> list[dict[str, str]]:
    """Return the kinds of steps.

    Parameters
    ----------
    config : RigConfig
        The rig.
    loads : mapping
        Its loads that are given as a torque too.
    drive : list of dict
        The ``node`` of each setpoint and its ``role``, in the order in which a first run needs them.

    Returns
    -------
    list of dict
        ``kind``, its name for people, ``line`` and ``value``; those with which a sequence begins come up to "wait".
    """
    nodes, roles = [one["node"] for one in drive], {one["node"]: one["role"] for one in drive}
    found = [one for one in config.settings.steps.values() if one.live and not one.lacking]
    found.sort(key=lambda one: nodes.index(one.owner))
    most = {one.relief.setpoint.step: one.torque.high for one in loads.values()}
    steps = {role: [step for one in found if roles[one.owner] == role for step in _set(one, most)] for role in set(roles.values())}
    oil, source = steps.pop(parts.OIL, []), steps.pop(parts.SOURCE, [])
    box = config.transmission if config.structure.shifts else None
    gear = [_step("gear", f"shift: {{to: {VALUE}, timeout: 10 s}}", box.names[1])] if box else []
    others = [*source[1:], *(step for ones in steps.values() for step in ones)]
    off = [_step(f"{one.setpoint.step} off", f"{one.setpoint.step}: {{off: true}}") for one in found]
    return [*oil, *gear, *source[:1], _step("wait", f"wait: {{for: {VALUE}}}", "2 s"), *others, *off]


def _set(one: Setting, most: Mapping[str, float]) -> Iterator[dict[str, str]]:
    """Yield a kind of step for each way in which a setpoint is given."""
    command = one.setpoint.command
    for key, dimension in command.takes.items():
        high = one.high if key == command.value else most[command.step]
        unit, scale = read_in(SI[dimension])
        value = float(f"{SHARE * high * scale:.2g}")
        yield _step(f"{command.step} {key.replace('_', ' ')}", f"{command.step}: {{{key}: {VALUE}}}", f"{value:g} {unit}")


def _step(kind: str, line: str, value: str = "") -> dict[str, str]:
    return {"kind": kind, "line": line, "value": value}
