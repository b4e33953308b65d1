# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The driveline's steps as the engine calls them: by their address, with the arrays of a rig's record.

Used by plant.engine.step: the general step where a step is not a quiet one, and the driven step for rigs with laws or inputs over
time. Both are compiled once for all rigs, in parallel with the rest, and are not needed before the first step.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...base.compiled import intrinsic, types
from ...driveline.calls import ARGUMENTS, address_of, array_types, bare_address, bare_types, call_at
from ...driveline.driven import INPUTS, KEPT, LAWS, WHOLE_NUMBERS, driven_step
from ...driveline.law_steps import settled_address
from ...driveline.quick import QUICK, quick_address

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from llvmlite import ir
    from numba.core.base import BaseContext
    from numba.core.typing.context import BaseContext as TypingContext
    from numba.core.typing.templates import Signature

DRIVEN = {**ARGUMENTS, **LAWS, **KEPT, **INPUTS}  # arrays of the driveline's record, which follow the addresses and times in a call
_DRIVEN = (types.int64, types.int64, types.float64, types.float64, *array_types(DRIVEN, WHOLE_NUMBERS))
NONE = (0, 0, 0, 0)


def addresses(driven: bool = False) -> tuple[int, int, int, int]:
    """Return the addresses at which compiled steps begin in this process; the steps are compiled or read from the cache.

    Parameters
    ----------
    driven : bool
        Whether the driveline has laws or inputs over time.

    Returns
    -------
    tuple of int
        Addresses of the bare, the settled, the driven and the quick step; for a driveline that is not driven all but the first are
        0.
    """
    if not driven:
        return bare_address(), 0, 0, 0
    return bare_address(), settled_address(), address_of(driven_step, _DRIVEN), quick_address()


def _fields(
    context: BaseContext, builder: ir.IRBuilder, kind: types.Record, line: ir.Value, names: Iterable[str]
) -> list[ir.Value]:
    return [context.get_getattr(kind, name)(context, builder, kind, line, name) for name in names]


@intrinsic
def general_step(
    context: TypingContext, at: types.Type, h: types.Type, t: types.Type, line: types.Record
) -> tuple[Signature, Callable]:
    """Move a driveline's record from t over h by the bare step; `at` are :func:`addresses`."""

    def build(context: BaseContext, builder: ir.IRBuilder, signature: Signature, given: Sequence[ir.Value]) -> ir.Value:
        at, h, t, line = given
        values = [h, t, *_fields(context, builder, signature.args[3], line, ARGUMENTS)]
        call_at(context, builder, builder.extract_value(at, 0), bare_types(), values)
        return context.get_dummy_value()

    return types.void(at, h, t, line), build


@intrinsic
def driven_step_at(
    context: TypingContext, at: types.Type, h: types.Type, t: types.Type, line: types.Record
) -> tuple[Signature, Callable]:
    """Move a driveline's record from t over h by the driven step; the record must have the arrays that this step needs."""

    def build(context: BaseContext, builder: ir.IRBuilder, signature: Signature, given: Sequence[ir.Value]) -> ir.Value:
        at, h, t, line = given
        bare, settled, driven = (builder.extract_value(at, k) for k in range(3))
        values = [settled, bare, h, t, *_fields(context, builder, signature.args[3], line, DRIVEN)]
        call_at(context, builder, driven, _DRIVEN, values)
        return context.get_dummy_value()

    return types.void(at, h, t, line), build


@intrinsic
def quick_step_at(
    context: TypingContext, at: types.Type, h: types.Type, t: types.Type, line: types.Record
) -> tuple[Signature, Callable]:
    """Move a driveline's record from t over h by the quick step, and return whether that has done it."""

    def build(context: BaseContext, builder: ir.IRBuilder, signature: Signature, given: Sequence[ir.Value]) -> ir.Value:
        at, h, t, line = given
        base = builder.ptrtoint(line, context.get_value_type(types.int64))
        values = [base, *_fields(context, builder, signature.args[3], line, ["layout"]), h, t]
        done = call_at(context, builder, builder.extract_value(at, 3), QUICK, values)
        return builder.icmp_signed("!=", done, done.type(0))

    return types.boolean(at, h, t, line), build
