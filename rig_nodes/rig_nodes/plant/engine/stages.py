# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The stages of a step: one compiled function for each, which calls this stage of every part that a world has.

The purpose and the arguments of each stage are described beside plant.parts.part.STAGES. The type of a world's record contains its
parts, so the compiler makes a separate engine for each rig, with every call resolved and inlined, and stores it under that type.
Called by plant.engine.step and plant.engine.loop.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from numba.extending import overload

from ...base import INLINED, njit
from ..parts.part import STAGES, part

if TYPE_CHECKING:
    from collections.abc import Callable

    from numba import types

    from ...base import Record
    from ..parts.part import Part


def _parts_in(world: types.Record) -> list[Part]:
    """Return the parts of a world by the type of its record, in the order of their stages."""
    return sorted((part(name) for name in world.typeof("parts").fields), key=lambda one: one.order)


def _calls(world: types.Record, stage: str) -> list[tuple[int, Callable]]:
    """Return pairs (instances, compiled stage) of the parts that take part in a stage."""
    states = world.typeof("parts")
    return [(states.typeof(one.name).shape[0], one.stages[stage]) for one in _parts_in(world) if stage in one.stages]


def _one_after_other(calls: list[tuple[int, Callable]]) -> Callable[..., None]:
    """Return a function that calls the stages of pairs (instances, stage).

    One function calls several of them, because every function takes the compiler time.
    """
    if not calls:
        return lambda world, *arguments: None
    if len(calls) == 1:
        ((m0, call0),) = calls

        def run(world, *arguments) -> None:  # noqa: ANN001, ANN002, see below
            for k in range(m0):
                call0(world, k, *arguments)
    elif len(calls) == 2:
        (m0, call0), (m1, call1) = calls

        def run(world, *arguments) -> None:  # noqa: ANN001, ANN002, see below
            for k in range(m0):
                call0(world, k, *arguments)
            for k in range(m1):
                call1(world, k, *arguments)
    else:
        (m0, call0), (m1, call1), others = *calls[:2], njit(**INLINED)(_one_after_other(calls[2:]))

        def run(world, *arguments) -> None:  # noqa: ANN001, ANN002, see below
            for k in range(m0):
                call0(world, k, *arguments)
            for k in range(m1):
                call1(world, k, *arguments)
            others(world, *arguments)

    return run


def _stage(name: str) -> Callable[..., None]:
    """Return the function of compiled code that runs one stage of plant.parts.part.STAGES, whatever parts the world has."""

    def stage(world: Record, *arguments: object) -> None:
        raise TypeError(f"the stage '{name}' of the engine is called from compiled code only")

    # numba compares the parameters of this function, with their annotations, with those of the function that it returns. The
    # parameters here are types and those there are values, so neither function has annotations
    @overload(stage, jit_options=INLINED)
    def chosen(world, *arguments) -> Callable[..., None]:  # noqa: ANN001, ANN002, see above
        return _one_after_other(_calls(world, name))

    return stage


fill, command, ordered, before, bound, after, pickup = map(_stage, STAGES)
