# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The driveline's general step, called by its address: compiled once for all rigs, and beside whatever else is compiled.

Used by engine.step where a step is not a quiet one. Its arrays are ones of any sizes, so that its machine code knows no rig,
and whoever compiles an engine needs nothing of it before the first step.
"""

from __future__ import annotations

from numba import types
from numba.extending import intrinsic

from ..plant.driveline_kernel import driveline_step

# its arguments behind the times, all in the driveline's record: name -> dimensions; mode and count are whole numbers
ARGUMENTS = {"minv": 2, "w": 2, "sh": 2, "kc": 2, "q": 2, "cap": 2, "loss": 2, "v": 1, "twist": 1, "mode": 1, "el": 2, "shaft": 2,
             "e_in": 1, "events": 2, "count": 1, "work": 1}
_RESULT = types.int64
_SIGNATURE = (types.float64, types.float64, *(
    types.Array(types.int64 if name in ("mode", "count") else types.float64, count, "C") for name, count in ARGUMENTS.items()))


def address() -> int:
    """Where the compiled step begins in this process, made or read from the cache."""
    driveline_step.compile(_SIGNATURE)
    made = driveline_step.overloads[_SIGNATURE]
    if made.signature.return_type != _RESULT:  # whoever calls by an address is not asked by the compiler
        raise TypeError(f"the driveline's step returns {made.signature.return_type}; engine.general_step calls it for {_RESULT}")
    return made.library.get_pointer_to_function(made.fndesc.llvm_func_name)


@intrinsic
def general_step(_context, begin, h, t, line):
    """Move a driveline's record from t over h by the step that begins at an :func:`address`."""
    def build(context, builder, _signature, arguments):
        call = context.call_conv
        kind = call.get_function_type(_RESULT, _SIGNATURE)
        step = builder.inttoptr(arguments[0], kind.as_pointer())
        given = [arguments[1], arguments[2]]
        given += [context.get_getattr(line, name)(context, builder, line, arguments[3], name) for name in ARGUMENTS]
        call.call_function(builder, step, _RESULT, _SIGNATURE, given)
        return context.get_dummy_value()

    return types.void(begin, h, t, line), build
