# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Calls of the driveline's compiled steps by their address, so that each is compiled once for all its callers.

Used by driveline/law_steps.py, driveline/run.py and plant/engine/general_step.py. The compiler copies all functions that a
function calls into its machine code and optimises them again; with the bare step inside five callers this took most of the time to
compile them. The arrays may have any sizes, so that the machine code does not depend on a rig.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from rig_nodes.base.compiled import intrinsic, types
from rig_nodes.driveline.kernel import driveline_step

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from llvmlite import ir
    from numba.core.base import BaseContext
    from numba.core.typing import BaseContext as TypingContext
    from numba.core.typing import Signature

    from rig_nodes.base.compiled import Compiled

# arrays that the bare step takes after h and t: name -> number of dimensions; some are arrays of whole numbers
ARGUMENTS = {
    "minv": 2,
    "w": 2,
    "sh": 2,
    "kc": 2,
    "q": 2,
    "cap": 2,
    "loss": 2,
    "v": 1,
    "twist": 1,
    "mode": 1,
    "el": 2,
    "shaft": 2,
    "e_in": 1,
    "events": 2,
    "count": 1,
    "work": 1,
}


def array_types(arguments: dict[str, int], whole: tuple[str, ...] = ()) -> tuple:
    """Return the compiler's types of arrays that are given as name -> dimensions.

    Parameters
    ----------
    arguments : dict of str to int
        Number of dimensions of each array by its name.
    whole : tuple of str
        Names of arrays of whole numbers, in addition to mode and count.

    Returns
    -------
    tuple
        Types of the arrays.
    """
    return tuple(
        types.Array(types.int64 if name in ("mode", "count", *whole) else types.float64, count, "C")
        for name, count in arguments.items()
    )


@cache
def bare_types(losses: bool = True) -> tuple:
    """Return the types of the arguments of driveline.kernel.driveline_step, for a driveline with or without losses."""
    arrays = dict(zip(ARGUMENTS, array_types(ARGUMENTS)))
    return types.float64, types.float64, *(arrays if losses else arrays | {"loss": types.none}).values()


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
def bare_address(losses: bool = True) -> int:
    """Return the address of driveline.kernel.driveline_step, for a driveline with or without losses."""
    return address_of(driveline_step, bare_types(losses))


def call_at(context: BaseContext, builder: ir.IRBuilder, address: ir.Value, signature: tuple, values: list) -> ir.Value:
    """Build, for an intrinsic, the call of the function that begins at an address, and return what it returns."""
    convention = context.call_conv
    function = builder.inttoptr(address, convention.get_function_type(types.int64, signature).as_pointer())
    return convention.call_function(builder, function, types.int64, signature, values)[1]


def calling(signature: tuple) -> tuple:
    """Return (signature, builder) of an intrinsic that takes an address and then the arguments of a signature."""

    def build(context: BaseContext, builder: ir.IRBuilder, _signature: Signature, given: Sequence[ir.Value]) -> ir.Value:
        call_at(context, builder, given[0], signature, list(given[1:]))
        return context.get_dummy_value()

    return types.void(types.int64, *signature), build


@intrinsic
def bare_step(
    context: TypingContext,
    address: types.Type,
    h: types.Type,
    t: types.Type,
    minv: types.Type,
    w: types.Type,
    sh: types.Type,
    kc: types.Type,
    q: types.Type,
    cap: types.Type,
    loss: types.Type,
    v: types.Type,
    twist: types.Type,
    mode: types.Type,
    el: types.Type,
    shaft: types.Type,
    e_in: types.Type,
    events: types.Type,
    count: types.Type,
    work: types.Type,
) -> tuple[Signature, Callable[..., ir.Value]]:
    """Call driveline_step by its address; where None is given for the losses, it is the step compiled without them."""
    return calling(bare_types(loss != types.none))
