# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The stages of a step: one compiled function each, which calls that stage of every part that a world has.

Which parts these are is known from the type of the world's record, so the compiler makes an engine of its own for each
rig, with every call resolved and inlined, and keeps it under that type. Called by engine.step and engine.loop.
"""

from __future__ import annotations

from numba import njit
from numba.extending import overload

from ..parts.part import part

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


def fill(world, h):
    """What the step's length makes of all parts' values."""
    raise NotImplementedError("compiled code only")


@overload(fill, jit_options=_OPTIONS)
def _fill(world, h):
    run = _calls(world, "fill")
    return lambda world, h: run(world, h)


def command(world, outputs, drive):
    """The controller's newest answer to all parts that its wires go to."""
    raise NotImplementedError("compiled code only")


@overload(command, jit_options=_OPTIONS)
def _command(world, outputs, drive):
    run = _calls(world, "command")
    return lambda world, outputs, drive: run(world, outputs, drive)


def ordered(world, outputs, steps_per_sample, h):
    """What the embedded law has just begun."""
    raise NotImplementedError("compiled code only")


@overload(ordered, jit_options=_OPTIONS)
def _ordered(world, outputs, steps_per_sample, h):
    run = _calls(world, "ordered")
    return lambda world, outputs, steps_per_sample, h: run(world, outputs, steps_per_sample, h)


def before(world, h, t):
    """All parts from t over h, but for the driveline."""
    raise NotImplementedError("compiled code only")


@overload(before, jit_options=_OPTIONS)
def _before(world, h, t):
    run = _calls(world, "before")
    return lambda world, h, t: run(world, h, t)


def bound(world):
    """Changes of speeds that are in no torque."""
    raise NotImplementedError("compiled code only")


@overload(bound, jit_options=_OPTIONS)
def _bound(world):
    run = _calls(world, "bound")
    return lambda world: run(world)


def after(world, h):
    """All parts once more, with what the driveline's step gave."""
    raise NotImplementedError("compiled code only")


@overload(after, jit_options=_OPTIONS)
def _after(world, h):
    run = _calls(world, "after")
    return lambda world, h: run(world, h)


def pickup(world, h, index, shown):
    """What all parts induce in the wires of transducers."""
    raise NotImplementedError("compiled code only")


@overload(pickup, jit_options=_OPTIONS)
def _pickup(world, h, index, shown):
    run = _calls(world, "pickup")
    return lambda world, h, index, shown: run(world, h, index, shown)
