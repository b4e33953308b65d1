# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Calls of the driveline's compiled steps by their address, so that each is compiled once for all its callers.

Used by driveline/law_steps.py, driveline/run.py and plant/engine/general_step.py. The compiler copies all functions that a
function calls into its machine code and optimises them again; with the bare step inside five callers this took most of the time to
compile them. numba's own function values do without an address, but unpickle the signature of each at every call from Python.
The arrays may have any sizes, so that the machine code does not depend on a rig.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from rig_nodes.base import cgutils, intrinsic, types
from rig_nodes.driveline.kernel import driveline_step
from rig_nodes.driveline.state import Loads, State, Structure

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from llvmlite import ir
    from numba.core.base import BaseContext
    from numba.core.typing import BaseContext as TypingContext
    from numba.core.typing import Signature

    from rig_nodes.base import Compiled


def step_types() -> tuple:
    """Return the types of a step's structure, loads, losses and state, for arrays of any sizes."""
    from numba import typeof

    row, rows, whole = np.zeros(0), np.zeros((0, 0)), np.zeros(0, np.int64)
    state = State(v=row, twist=row, mode=whole, el=rows, shaft=rows, e_in=row, events=rows, count=whole, work=row)
    return tuple(map(typeof, (Structure(rows, rows, rows, rows), Loads(rows, rows), rows, state)))


@cache
def bare_types() -> tuple:
    """Return the types of the arguments of driveline.kernel.driveline_step."""
    structure, loads, loss, state = step_types()
    return types.float64, types.float64, structure, loads, loss, state


def address_of(function: Compiled, signature: tuple) -> int:
    """Return the address at which a compiled function begins in this process.

    The function is compiled or read from the cache first.

    Parameters
    ----------
    function : Compiled
        The function.
    signature : tuple
        Types of its arguments.

    Returns
    -------
    int
        The address.

    Raises
    ------
    TypeError
        When the function does not return a whole number; the compiler does not check a call by address.
    """
    function.compile(signature)
    made = function.overloads[signature]
    if made.signature.return_type != types.int64:
        raise TypeError(f"{function.__name__} returns {made.signature.return_type}; it is called for {types.int64}")
    return made.library.get_pointer_to_function(made.fndesc.llvm_func_name)


@cache
def bare_address() -> int:
    """Return the address of driveline.kernel.driveline_step."""
    return address_of(driveline_step, bare_types())


def _alike(given: types.Type, taken: types.Type) -> bool:
    """Return whether a value of one type is passed as one of the other; the sizes of a record's arrays do not matter."""
    if isinstance(taken, types.BaseTuple):
        return isinstance(given, types.BaseTuple) and len(given) == len(taken) and all(map(_alike, given, taken))
    if isinstance(taken, types.Array):
        return isinstance(given, types.Array) and (given.dtype, given.ndim, given.layout) == (taken.dtype, taken.ndim, taken.layout)
    return given == taken


def call_of(types_for: Callable[[tuple], tuple]) -> Compiled:
    """Return what compiled code calls with the address of a function and then its arguments; it returns what the function does.

    Parameters
    ----------
    types_for : callable
        Gives the types of the function's arguments, from those that it is called with.

    Returns
    -------
    Compiled
        The intrinsic; it raises a TypeError where it is compiled with arguments that the function does not take.
    """

    @intrinsic
    def call(_context: TypingContext, address: types.Type, *arguments: types.Type) -> tuple[Signature, Callable[..., ir.Value]]:
        taken = types_for(arguments)
        if len(arguments) != len(taken) or not all(map(_alike, arguments, taken)):
            raise TypeError(f"a step that takes {taken} is called with {arguments}")

        def build(context: BaseContext, builder: ir.IRBuilder, _signature: Signature, given: Sequence[ir.Value]) -> ir.Value:
            convention = context.call_conv
            function = builder.inttoptr(given[0], convention.get_function_type(types.int64, taken).as_pointer())
            return convention.call_function(builder, function, types.int64, taken, cgutils.unpack_tuple(builder, given[1]))[1]

        return types.int64(address, types.StarArgTuple.from_types(arguments)), build

    return call


bare_step = call_of(lambda _given: bare_types())
