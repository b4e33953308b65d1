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

from ..parts.part import STAGES, part

_OPTIONS = {"error_model": "numpy", "forceinline": True}


def _parts_in(world) -> list:
    """The parts of a world by the type of its record, in the order of their stages."""
    return sorted((part(name) for name in world.typeof("parts").fields), key=lambda one: one.order)


_AT_ONCE = 4


@njit(**_OPTIONS)
def _nothing(world, *arguments):
    pass


def _calls(world, stage: str):
    """One compiled function that calls a stage of each part that has it, for each of its instances."""
    states = world.typeof("parts")
    calls = [(states.typeof(one.name).shape[0], one.stages[stage]) for one in _parts_in(world) if stage in one.stages]
    return _one_after_other(calls) if calls else _nothing


def _one_after_other(calls: list):
    """As :func:`_calls`, of pairs (instances, stage); some at once, because every function costs the compiler time."""
    (m0, call0), (m1, call1), (m2, call2), (m3, call3) = (calls + [(0, _nothing)] * _AT_ONCE)[:_AT_ONCE]
    others = _one_after_other(calls[_AT_ONCE:]) if len(calls) > _AT_ONCE else _nothing

    @njit(**_OPTIONS)
    def run(world, *arguments):
        for k in range(m0):
            call0(world, k, *arguments)
        for k in range(m1):
            call1(world, k, *arguments)
        for k in range(m2):
            call2(world, k, *arguments)
        for k in range(m3):
            call3(world, k, *arguments)
        others(world, *arguments)
    return run


def _stage(name: str):
    """The function of compiled code that runs one stage of parts.part.STAGES, whatever parts the world has."""
    def stage(world, *arguments):
        raise TypeError(f"the stage '{name}' of the engine is called from compiled code only")

    @overload(stage, jit_options=_OPTIONS)
    def chosen(world, *arguments):
        run = _calls(world, name)
        return lambda world, *arguments: run(world, *arguments)
    return stage


fill, command, ordered, before, bound, after, pickup = map(_stage, STAGES)
