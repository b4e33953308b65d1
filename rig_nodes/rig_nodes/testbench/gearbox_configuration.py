# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Configuration of the HydmAG gearbox: its inertias and losses; used by testbench.configuration and testbench.gearbox_plan."""

from __future__ import annotations

from dataclasses import dataclass

from ..config.schema import choice, param


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
