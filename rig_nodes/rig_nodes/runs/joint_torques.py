# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The torques in all that joins the bodies of a rig at one moment, including gears, sets and relations.

No step of the plant needs these torques. runs.topics uses them for a rig whose description asks for the signals
`torques`.
"""

from __future__ import annotations

import numpy as np

from ..driveline import LAM, MOTION, TORQUE, VISC, Input, Result
from ..rig import torque_signals
from .rig import Rig


class JointTorques:
    """The torques in what joins the bodies of a rig: ``names`` of the signals, and their present :meth:`values`."""

    def __init__(self, rig: Rig) -> None:
        self._rig, plan = rig, rig.world.plan
        self._signals = torque_signals(rig.config.structure)
        self.names = [one.name for one in self._signals]
        self._bodies = [plan.system.bodies.index(name) for name in plan.bodies]
        self._inputs = {
            plan.system.bodies.index(name): Input(name, (table.x, table.y), rig.step)
            for name, table in plan.inputs.items()
            if name in plan.system.bodies
        }

    def values(self) -> list[float]:
        """Return the torques in the order of the names [Nm]; a tie of several bodies has one torque for each body."""
        now = self._now()
        return [float(now.torque(one.of, one.body)[0]) if one.body else self._rig.true(f"{one.of}.torque") for one in self._signals]

    def _now(self) -> Result:
        """A result of one row with the present state, without what no torque depends on."""
        rig, line, plan = self._rig, self._rig.world.line, self._rig.world.plan
        system, none = plan.system, np.zeros((1, 0))
        v = line["v"][None]
        slips = v @ system.w.T
        pushes = np.zeros((1, len(system.bodies)))
        pushes[0, self._bodies] = line["push"][1]
        laws, angles = (line["law_torque"][None], line["at"][None]) if plan.driven else (none, none)
        for body, one in self._inputs.items():
            if rig.sample:
                pushes[0, body] += one.ends(np.array([rig.time - rig.step, rig.time]), np.zeros(0))[0, 1]
        for k, law in enumerate(system.laws):
            if law.kind in (TORQUE, MOTION):
                pushes += laws[0, k] * law.bodies
        count = len(system.shafts)
        # the drag of a device is not part of the description
        friction = line["el"][LAM] + (line["cap"][VISC] - system.drag) * slips
        return Result(
            system,
            np.array([rig.time]),
            v @ system.bodies_from_speeds.T,
            none,
            slips,
            line["mode"][None],
            friction,
            line["twist"][None, :count],
            line["shaft"][:1, :count],
            pushes,
            laws,
            angles,
            *(none,) * 6,
            [],
            none,
            none,
            0,
        )
