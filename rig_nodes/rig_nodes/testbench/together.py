# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Values of a rig that are right one by one and cannot be true together; used by testbench.configuration.

Asked when a file has been read whole, and once more when all settings of a command line have been taken.
"""

from __future__ import annotations

from collections.abc import Callable

from ..alfa46.settings import OUTPUT_KEYS, POINTS, check_point
from ..catalogue import GEARBOX
from ..errors import RigError
from ..plant.wheels import REDUCTION

Where = Callable[[tuple[str, ...]], str]  # opens a sentence about these keys, e.g. ("gearbox.inertia_in",)


def check_together(config, where: Where) -> None:
    """RigError for plates that slide harder than they stick, a part heavier than its whole, a profile above the limit.

    ``config``: of either kind of rig.
    """
    plates = config.plate_pack
    _not_above(where, "plate_pack.friction_kinetic", plates.friction_kinetic, "plate_pack.friction_static",
               plates.friction_static, "plates that slide hold no more than plates that stick")
    if config.kind != GEARBOX:
        return
    gearbox = config.gearbox
    _not_above(where, "gearbox.inertia_in_gearbox", gearbox.inertia_in_gearbox, "gearbox.inertia_in",
               gearbox.inertia_in, "which counts it, in kg m2")
    on_wk = gearbox.inertia_out_z5 * REDUCTION**2
    _not_above(where, "gearbox.inertia_pump", gearbox.inertia_pump, "gearbox.inertia_out_z5", on_wk,
               f"taken to wk by {REDUCTION:.4g}^2, which counts it, in kg m2")
    limit = config.alfa46.values.current_limit
    for output, points in zip(OUTPUT_KEYS, config.alfa46.profiles, strict=True):
        names = [f"alfa46.{output}.{point}" for point in POINTS]
        for k, name in enumerate(names):
            check_point(points, k, f"{where((name, 'alfa46.current_limit', *names))}{name}", limit)


def _not_above(where: Where, key: str, value: float, whole: str, most: float, why: str) -> None:
    if value > most:
        raise RigError(f"{where((key, whole))}{key} is {value:g}, expected at most the {most:.4g} of {whole}, {why}")
