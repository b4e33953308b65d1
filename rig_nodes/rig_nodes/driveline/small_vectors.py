# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Vectors of a few numbers in registers, for compiled code in which the types of the arrays contain their length.

Used by driveline/quiet.py and plant/engine/step.py. A vector is a tuple of floats. Arrays are C-contiguous, of float64, and are
read from a given place on, whatever their dimensions.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rig_nodes.base import cgutils, intrinsic, ir, types

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numba.core.base import BaseContext
    from numba.core.typing import BaseContext as TypingContext
    from numba.core.typing import Signature


def _numbers(context: BaseContext, builder: ir.IRBuilder, array: types.Array, value: ir.Value) -> ir.Value:
    return context.make_array(array)(context, builder, value).data


def _at(builder: ir.IRBuilder, data: ir.Value, begin: ir.Value, i: int) -> ir.Value:
    return builder.gep(data, [builder.add(begin, ir.Constant(begin.type, i))])


@intrinsic
def vector(
    _context: TypingContext, array: types.Array, begin: types.Type, like: types.NestedArray
) -> tuple[Signature, Callable[..., ir.Value]]:
    """Return as many numbers of an array, from its place ``begin`` on, as the array ``like`` of known length has."""
    count = like.shape[0]

    def build(context: BaseContext, builder: ir.IRBuilder, _signature: Signature, arguments: Sequence[ir.Value]) -> ir.Value:
        data = _numbers(context, builder, array, arguments[0])
        return cgutils.pack_array(
            builder, [builder.load(_at(builder, data, arguments[1], i)) for i in range(count)], ty=ir.DoubleType()
        )

    return types.UniTuple(types.float64, count)(array, types.intp, like), build


@intrinsic
def put(
    _context: TypingContext, array: types.Array, begin: types.Type, values: types.UniTuple
) -> tuple[Signature, Callable[..., ir.Value]]:
    """Write the values to an array, from its place ``begin`` on."""

    def build(context: BaseContext, builder: ir.IRBuilder, _signature: Signature, arguments: Sequence[ir.Value]) -> ir.Value:
        data = _numbers(context, builder, array, arguments[0])
        for i in range(values.count):
            builder.store(builder.extract_value(arguments[2], i), _at(builder, data, arguments[1], i))
        return context.get_dummy_value()

    return types.void(array, types.intp, values), build


def _each(builder: ir.IRBuilder, of: Callable[..., ir.Value], *vectors: ir.Value) -> ir.Value:
    items = zip(*(cgutils.unpack_tuple(builder, one) for one in vectors))
    return cgutils.pack_array(builder, [of(*item) for item in items], ty=ir.DoubleType())


def _sum(builder: ir.IRBuilder, one: Callable[[int], ir.Value], other: Callable[[int], ir.Value], count: int) -> ir.Value:
    total = builder.fmul(one(0), other(0))
    for i in range(1, count):
        total = builder.fadd(total, builder.fmul(one(i), other(i)))
    return total


@intrinsic
def dot(_context: TypingContext, a: types.UniTuple, b: types.UniTuple) -> tuple[Signature, Callable[..., ir.Value]]:
    """Return the sum of a times b."""

    def build(_: BaseContext, builder: ir.IRBuilder, _signature: Signature, arguments: Sequence[ir.Value]) -> ir.Value:
        one, other = (cgutils.unpack_tuple(builder, value) for value in arguments)
        return _sum(builder, one.__getitem__, other.__getitem__, a.count)

    return types.float64(a, b), build


@intrinsic
def add(
    _context: TypingContext, a: types.UniTuple, share: types.Type, b: types.UniTuple
) -> tuple[Signature, Callable[..., ir.Value]]:
    """Return the vector a + share b."""

    def build(_: BaseContext, builder: ir.IRBuilder, _signature: Signature, arguments: Sequence[ir.Value]) -> ir.Value:
        return _each(builder, lambda x, y: builder.fadd(x, builder.fmul(arguments[1], y)), arguments[0], arguments[2])

    return a(a, types.float64, b), build


@intrinsic
def scaled(_context: TypingContext, share: types.Type, a: types.UniTuple) -> tuple[Signature, Callable[..., ir.Value]]:
    """Return the vector share times a."""

    def build(_: BaseContext, builder: ir.IRBuilder, _signature: Signature, arguments: Sequence[ir.Value]) -> ir.Value:
        return _each(builder, lambda x: builder.fmul(arguments[0], x), arguments[1])

    return a(types.float64, a), build


@intrinsic
def product(
    _context: TypingContext, array: types.Array, begin: types.Type, a: types.UniTuple
) -> tuple[Signature, Callable[..., ir.Value]]:
    """Return the product with a of the square matrix that begins at a place of an array, row by row."""
    count = a.count

    def build(context: BaseContext, builder: ir.IRBuilder, _signature: Signature, arguments: Sequence[ir.Value]) -> ir.Value:
        data, values = _numbers(context, builder, array, arguments[0]), cgutils.unpack_tuple(builder, arguments[2])
        return cgutils.pack_array(
            builder,
            [
                _sum(
                    builder, lambda j, i=i: builder.load(_at(builder, data, arguments[1], i * count + j)), values.__getitem__, count
                )
                for i in range(count)
            ],
            ty=ir.DoubleType(),
        )

    return a(array, types.intp, a), build


@intrinsic
def room(_context: TypingContext, like: types.NestedArray) -> tuple[Signature, Callable[..., ir.Value]]:
    """Return an array on the stack, not initialised, with as many numbers as the array ``like`` of known length has."""
    made, count = types.Array(types.float64, 1, "C"), like.shape[0]

    def build(context: BaseContext, builder: ir.IRBuilder, _signature: Signature, _arguments: Sequence[ir.Value]) -> ir.Value:
        with builder.goto_entry_block():  # numba's own alloca_once would fill it with zeros
            place = builder.alloca(ir.ArrayType(ir.DoubleType(), max(count, 1)))
        array = context.make_array(made)(context, builder)
        size = context.get_constant(types.intp, 8)
        context.populate_array(
            array,
            data=builder.bitcast(place, array.data.type),
            shape=[context.get_constant(types.intp, count)],
            strides=[size],
            itemsize=size,
            meminfo=None,
        )
        return array._getvalue()

    return made(like), build
