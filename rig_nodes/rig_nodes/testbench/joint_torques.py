# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Torques in all that joins the bodies of a rig, at a moment: of its gears, sets and relations too, which no step of the plant
needs.

Used by testbench.topics for a rig whose description asks for the signals `torques`.
"""

from __future__ import annotations

import numpy as np

from ..description.signals import torque_signals
from ..plant.driveline_algebra import LAM, VISC
from ..plant.driveline_inputs import Input
from ..plant.driveline_laws import MOTION, TORQUE
from ..plant.driveline_run import Result
from .rig import Rig


class JointTorques:
    """names: of the signals; :meth:`values`: what they are now."""

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
        """Torques [Nm] in the order of the names: of what ties bodies together, that which it puts on one of them."""
        now = self._now()
        return [float(now.torque(one.of, one.body)[0]) if one.body else self._rig.true(f"{one.of}.torque") for one in self._signals]

    def _now(self) -> Result:
        """A result of one row, the state of now; what no torque is found by is left out."""
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
        friction = line["el"][LAM] + (line["cap"][VISC] - system.drag) * slips  # a device's drag is none of the description
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
            0,
        )
