# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Arrays whose references compiled code does not count: those at an address, and those that somebody else keeps.

Used by driveline/record.py, and by the steps with laws. Where numba counts references, each use of an array in a function that
allocates is two locked additions, which together take more time than a small step itself.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rig_nodes.base import cgutils, intrinsic, types

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from llvmlite import ir
    from numba.core.base import BaseContext
    from numba.core.typing import BaseContext as TypingContext
    from numba.core.typing import Signature

    from rig_nodes.base import Compiled


@intrinsic
def borrowed(_context: TypingContext, value: types.Type) -> tuple[Signature, Callable[..., ir.Value]]:
    """Return an array, or a tuple of arrays, whose references are not counted; the caller keeps what has the memory."""

    def build(context: BaseContext, builder: ir.IRBuilder, _signature: Signature, arguments: Sequence[ir.Value]) -> ir.Value:
        def without(kind: types.Type, one: ir.Value) -> ir.Value:
            if isinstance(kind, types.Array):
                array = cgutils.create_struct_proxy(kind)(context, builder, value=one)
                array.meminfo = cgutils.get_null_value(array.meminfo.type)
                return array._getvalue()
            if isinstance(kind, types.BaseTuple):
                for i, part in enumerate(kind.types):
                    one = builder.insert_value(one, without(part, builder.extract_value(one, i)), i)
            return one

        return without(value, arguments[0])

    return value(value), build


@intrinsic
def address(_context: TypingContext, array: types.Type) -> tuple[Signature, Callable[..., ir.Value]]:
    """Return the address of an array's numbers; by numba's own way, which counts references, the array may be freed too soon."""

    def build(context: BaseContext, builder: ir.IRBuilder, _signature: Signature, given: Sequence[ir.Value]) -> ir.Value:
        data = cgutils.create_struct_proxy(array)(context, builder, value=given[0]).data
        return builder.ptrtoint(data, context.get_value_type(types.int64))

    return types.int64(array), build


def _arrays_of(number: str) -> Compiled:
    """Return the intrinsic that makes an array of numbers of this type at an address, with one or two sizes."""

    @intrinsic
    def at(_context: TypingContext, address: types.Type, *sizes: types.Type) -> tuple[Signature, Callable[..., ir.Value]]:
        made = types.Array(getattr(types, number), len(sizes), "C")

        def build(context: BaseContext, builder: ir.IRBuilder, _signature: Signature, given: Sequence[ir.Value]) -> ir.Value:
            array = context.make_array(made)(context, builder)
            item = size = context.get_constant(types.intp, 8)
            strides: list[ir.Value] = []
            lengths = cgutils.unpack_tuple(builder, given[1])
            for length in reversed(lengths):
                strides.insert(0, size)
                size = builder.mul(size, length)
            data = builder.inttoptr(given[0], array.data.type)
            context.populate_array(array, data=data, shape=lengths, strides=strides, itemsize=item, meminfo=None)
            return array._getvalue()

        return made(address, types.StarArgTuple.from_types(sizes)), build

    return at


floats, whole = _arrays_of("float64"), _arrays_of("int64")
