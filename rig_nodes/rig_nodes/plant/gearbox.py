# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The HydmAG gearbox: ratios, inertias and losses, described for the general driveline.

Used by testbench.rig to build the driveline and by plant.kernel for the loss torques.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt

import numpy as np
from numba import njit

from ..config.schema import choice, param
from . import driveline_losses as losses
from .driveline import Driveline, System
from .wheels import INPUT, OUTPUT, REDUCTION, SIDES

# elements of the driveline, in this order
S1, S2, LOSS_IN, LOSS_OUT, LOAD = range(5)
RPM = pi / 30.0
# of the losses by torque: the element whose other friction each comes with, the speed that says which way power flows
OWN, WAYS = (LOSS_IN, LOSS_OUT), (0, 1)
COAST_DOWN = 49.274  # rad/s: where the coast-down of 7.3.1 began


@dataclass(frozen=True)
class GearboxConfig:
    """Inertias and losses: by speed on w0, and on both sides a parabola of the torque carried (Annex D).

    The loss by speed is ``loss_in_speed`` times Annex D's parabola, which falls above 1300 rpm, and the one that the
    printed coast-down (7.7) has: its speed is a parabola of time, so the torque's square is linear in the speed, from
    ``loss_in_at_rest`` to ``loss_in_at_470`` where it began.
    loss_by_load_side: where the loss by the load's torque brakes, behind the clutches (driven, as Annex D has it) or
    before them (driving); M_wej in steady state is the same, what the clutches carry is not.
    """

    inertia_in: float = param("inertia", 1e-3, 100.0)
    inertia_in_gearbox: float = param("inertia", 0.0, 100.0)
    inertia_out_z5: float = param("inertia", 1e-4, 100.0)
    inertia_pump: float = param("inertia", 0.0, 100.0)
    loss_in_speed: float = param("ratio", 0.0, 10.0)
    loss_in_at_rest: float = param("torque", 0.0, 100.0)
    loss_in_at_470: float = param("torque", 0.0, 100.0)
    loss_in_constant: float = param("torque", -100.0, 100.0)
    loss_in_share: float = param("ratio", -0.5, 0.5)
    loss_in_square: float = param("torque per torque squared", -0.01, 0.01)
    loss_out_constant: float = param("torque", -100.0, 100.0)
    loss_out_share: float = param("ratio", -0.5, 0.5)
    loss_out_square: float = param("torque per torque squared", -0.01, 0.01)
    loss_by_load_side: str = choice("driven", "driving")


def build_driveline(gearbox: GearboxConfig):
    """The compiled description: shafts w0 and wk, clutches S1 and S2 on their wheels, both losses, the load.

    Slip of S1 is wheel z3 (w_wej / i31) minus the intermediate shaft (w_wyj / i48); slip of S2 is w0 minus wheel
    z5 (w_wyj / i58), (6.87)-(6.92). J_od is given on the z5 axis; on wk it is multiplied by (z8/z5)^2.
    """
    d = Driveline()
    d.inertia(INPUT, gearbox.inertia_in)
    d.inertia(OUTPUT, gearbox.inertia_out_z5 * REDUCTION**2)
    for name, (driving, driven) in SIDES.items():
        d.clutch(name, INPUT, OUTPUT, ca=driving, cb=driven)
    d.brake("loss_in", INPUT)
    d.brake("loss_out", OUTPUT)
    d.brake("load", OUTPUT)
    return d.build()


def torque_losses(gearbox: GearboxConfig, system: System) -> np.ndarray:
    """The losses by torque for the driveline's step (2, loss_width), Annex D: by the torque that w0 gives the clutches,
    and by the load's at its torque meter, a parabola on the z5 axis. BASE and FACTOR are the step's to say.
    """
    out = np.zeros((2, losses.loss_width(*system.w.T.shape)))
    weights = out[:, losses.WEIGHTS:]
    z5 = REDUCTION
    out[0, :losses.OWN] = gearbox.loss_in_constant, gearbox.loss_in_share, gearbox.loss_in_square
    out[:, losses.OWN], out[:, losses.WAY], out[:, losses.FACTOR] = OWN, WAYS, 1.0
    out[0, losses.ON] = LOSS_IN
    weights[0, [S1, S2]] = system.w[[S1, S2], 0]
    out[1, :losses.OWN] = 0.0, gearbox.loss_out_share * z5, gearbox.loss_out_square * z5
    out[1, losses.ON] = LOSS_IN if gearbox.loss_by_load_side == "driving" else LOSS_OUT
    weights[1, LOAD], weights[1, len(system.elements) + 1] = 1.0, gearbox.inertia_pump
    return out


@njit(cache=True, error_model="numpy", forceinline=True)
def loss_in(speed, gearbox):
    """Loss torque on w0 [Nm] by its speed [rad/s], (6.72), (7.7) and Annex D."""
    n = abs(speed) / RPM
    by_speed = gearbox.loss_in_speed * max(0.0, -1.76e-6 * n * n + 4.58e-3 * n + 2.56)
    rest, began = gearbox.loss_in_at_rest**2, gearbox.loss_in_at_470**2
    return by_speed + sqrt(max(0.0, rest + (began - rest) * abs(speed) / COAST_DOWN))


@njit(cache=True, error_model="numpy", forceinline=True)
def loss_out(gearbox):
    """Loss torque on wk [Nm] whatever the load is, bearings and seals; given on the z5 axis as in Annex D."""
    return max(0.0, gearbox.loss_out_constant) * REDUCTION
