# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The stages of a step: one compiled function each, which calls that stage of every part that a world has.

What each stage is for, and its arguments, stand beside parts.part.STAGES. Which parts a world has is known from the type
of its record, so the compiler makes an engine of its own for each rig, with every call resolved and inlined, and keeps it
under that type. Called by engine.step and engine.loop.
"""

from __future__ import annotations

from numba import njit
from numba.extending import overload

from ..compiled import INLINED
from ..parts.part import STAGES, part


def _parts_in(world) -> list:
    """The parts of a world by the type of its record, in the order of their stages."""
    return sorted((part(name) for name in world.typeof("parts").fields), key=lambda one: one.order)


def _calls(world, stage: str) -> list:
    """Pairs (instances, compiled stage) of the parts that take part in a stage."""
    states = world.typeof("parts")
    return [(states.typeof(one.name).shape[0], one.stages[stage]) for one in _parts_in(world) if stage in one.stages]


def _one_after_other(calls: list):
    """A function that calls stages of pairs (instances, stage); some at once, as every function costs the compiler time."""
    if not calls:
        return lambda world, *arguments: None
    if len(calls) == 1:
        ((m0, call0),) = calls

        def run(world, *arguments):
            for k in range(m0):
                call0(world, k, *arguments)
    elif len(calls) == 2:
        (m0, call0), (m1, call1) = calls

        def run(world, *arguments):
            for k in range(m0):
                call0(world, k, *arguments)
            for k in range(m1):
                call1(world, k, *arguments)
    else:
        (m0, call0), (m1, call1), others = *calls[:2], njit(**INLINED)(_one_after_other(calls[2:]))

        def run(world, *arguments):
            for k in range(m0):
                call0(world, k, *arguments)
            for k in range(m1):
                call1(world, k, *arguments)
            others(world, *arguments)

    return run


def _stage(name: str):
    """The function of compiled code that runs one stage of parts.part.STAGES, whatever parts the world has."""

    def stage(world, *arguments):
        raise TypeError(f"the stage '{name}' of the engine is called from compiled code only")

    @overload(stage, jit_options=INLINED)
    def chosen(world, *arguments):
        return _one_after_other(_calls(world, name))

    return stage


fill, command, ordered, before, bound, after, pickup = map(_stage, STAGES)
