# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks of values of a rig that are right one by one but cannot be true together; rig.configuration uses them.

They run when a file has been read whole, and again when all settings of a command line have been taken.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from ..base import SAMPLE, RigError
from ..plant import part as parts
from .alfa46 import OUTPUT_KEYS, POINTS, check_point
from .driveline import inertias_of
from .sections import LOGGER_RATE
from .transmission import tied_to

if TYPE_CHECKING:
    from .configuration import RigConfig

Where = Callable[[tuple[str, ...]], str]  # returns the beginning of an error about these keys, e.g. ("w0.inertia",)


def cross_check(config: RigConfig, where: Where) -> None:
    """Refuse values that cannot be true together.

    These are plates that slide harder than they stick, a part that is heavier than the whole that contains it, a logger whose rows
    do not fall on the plant's steps, and a profile above the limit of the current.

    Parameters
    ----------
    config : RigConfig
        The rig's configuration, of rig.configuration.
    where : callable
        It returns the beginning of the error for some keys, e.g. for ("w0.inertia",).

    Raises
    ------
    RigError
        When values contradict each other.
    """
    _check_logger(config.instruments.logger_rate, config.kernel.step, where)
    if wrong := parts.not_whole(config.instruments, "resolution_bits"):
        key = f"instruments.{wrong[0]}"
        raise RigError(f"{where((key,))}{key} {wrong[1]}")
    for device in config.structure.of_role(parts.VALUES):
        plates = getattr(config, device.name)
        _not_above(
            where,
            f"{device.name}.friction_kinetic",
            plates.friction_kinetic,
            f"{device.name}.friction_static",
            plates.friction_static,
            "plates that slide hold no more than plates that stick",
        )
    for device in config.structure.devices:
        if (check := parts.part(device.part).check) and (wrong := check(getattr(config, device.name))):
            key = f"{device.name}.{wrong[0]}"
            raise RigError(f"{where((key,))}{key} {wrong[1]}")
    inertias = inertias_of(config.structure, config.sections)
    for device in config.structure.of_role(parts.METER):
        body, values = device.wires["body"], getattr(config, device.name)
        whole, axis = tied_to(config.structure, inertias, body)
        taken = f"taken to {body} by {axis:.4g}^2, " if axis != 1.0 else ""
        _not_above(
            where,
            f"{device.name}.inertia",
            values.inertia,
            f"{_owner(config, body)}.inertia",
            whole * axis**2,
            f"{taken}which counts it, in kg m2",
        )
    if config.alfa46 is None:
        return
    limit = config.alfa46.values.current_limit
    for output, points in zip(OUTPUT_KEYS, config.alfa46.profiles, strict=True):
        names = [f"alfa46.{output}.{point}" for point in POINTS]
        for k, name in enumerate(names):
            check_point(points, k, f"{where((name, 'alfa46.current_limit', *names))}{name}", limit)


def _check_logger(rate: float, step: float, where: Where) -> None:
    """Refuse a step that does not divide a sample, and a logger without whole numbers of rows in a sample and of steps in a row.

    With the usual rate any step is taken, because a run can be recorded in memory with rows at the steps.
    """
    steps = round(SAMPLE / step)
    if abs(SAMPLE / step - steps) > 1e-9:
        raise RigError(
            f"{where(('kernel.step',))}the plant's step of {step * 1e6:g} us does not divide the controller's sample of 1000 us; "
            "choose e.g. 100 us or 50 us"
        )
    fitting = [number for number in range(1, steps + 1) if steps % number == 0]
    if rate != LOGGER_RATE and rate * SAMPLE not in fitting:
        raise RigError(
            f"{where(('instruments.logger_rate', 'kernel.step'))}instruments.logger_rate of {rate * 1e-3:g} kHz does not fit the "
            f"plant's step of {step * 1e6:g} us; expected {', '.join(map(str, fitting))} kHz"
        )


def _owner(config: RigConfig, body: str) -> str:
    """The body on which the inertia of all that wheels tie to a body is stated."""
    if body not in config.structure.massless:
        return body
    return next(
        (
            one
            for mesh in config.structure.meshes
            for one in mesh.bodies
            if body in mesh.bodies and one not in config.structure.massless
        ),
        body,
    )


def _not_above(where: Where, key: str, value: float, whole: str, most: float, why: str) -> None:
    if value > most:
        raise RigError(f"{where((key, whole))}{key} is {value:g}, expected at most the {most:.4g} of {whole}, {why}")
