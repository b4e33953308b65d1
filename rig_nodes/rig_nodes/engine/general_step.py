# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The driveline's steps that are called by their address: compiled once for all rigs, and beside whatever else is compiled.

Used by engine.step: the general step where a step is not a quiet one, and the driven one of rigs with laws or inputs over time.
Their arrays are ones of any sizes, so that the machine code knows no rig, and whoever compiles an engine needs nothing of it
before the first step.
"""

from __future__ import annotations

from numba import types
from numba.extending import intrinsic

from ..plant.driveline_driven import INPUTS, KEPT, LAWS, WHOLE_NUMBERS, driven_step
from ..plant.driveline_kernel import driveline_step

# its arguments behind the times, all in the driveline's record: name -> dimensions; some are whole numbers
ARGUMENTS = {"minv": 2, "w": 2, "sh": 2, "kc": 2, "q": 2, "cap": 2, "loss": 2, "v": 1, "twist": 1, "mode": 1, "el": 2, "shaft": 2,
             "e_in": 1, "events": 2, "count": 1, "work": 1}
DRIVEN = {**ARGUMENTS, **LAWS, **KEPT, **INPUTS}
_RESULT = types.int64


def _signature(arguments: dict[str, int]) -> tuple:
    whole = ("mode", "count", *WHOLE_NUMBERS)
    return (types.float64, types.float64, *(
        types.Array(types.int64 if name in whole else types.float64, count, "C") for name, count in arguments.items()))


def address(driven: bool = False) -> int:
    """Where a compiled step begins in this process, made or read from the cache."""
    step, signature = (driven_step, _signature(DRIVEN)) if driven else (driveline_step, _signature(ARGUMENTS))
    step.compile(signature)
    made = step.overloads[signature]
    if made.signature.return_type != _RESULT:  # whoever calls by an address is not asked by the compiler
        raise TypeError(f"the driveline's step returns {made.signature.return_type}; engine.general_step calls it for {_RESULT}")
    return made.library.get_pointer_to_function(made.fndesc.llvm_func_name)


def _by_address(arguments: dict[str, int]):
    signature = _signature(arguments)

    def typed(_context, begin, h, t, line):
        def build(context, builder, _signature, given):
            call = context.call_conv
            kind = call.get_function_type(_RESULT, signature)
            step = builder.inttoptr(given[0], kind.as_pointer())
            values = [given[1], given[2]]
            values += [context.get_getattr(line, name)(context, builder, line, given[3], name) for name in arguments]
            call.call_function(builder, step, _RESULT, signature, values)
            return context.get_dummy_value()

        return types.void(begin, h, t, line), build
    return typed


@intrinsic
def general_step(context, begin, h, t, line):
    """Move a driveline's record from t over h by the step that begins at an :func:`address`."""
    return _by_address(ARGUMENTS)(context, begin, h, t, line)


@intrinsic
def driven_step_at(context, begin, h, t, line):
    """The same by the driven step, on the record of a driveline that has what that needs."""
    return _by_address(DRIVEN)(context, begin, h, t, line)
