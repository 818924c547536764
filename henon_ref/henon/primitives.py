"""Operations of compiled loops that numba has none for, or compiles a function for each."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic


@intrinsic
def bits(typing, number):  # type: ignore[no-untyped-def]
    """The bits of a double as an integer."""
    signature = types.int64(types.float64)

    def codegen(context, builder, sig, args):  # type: ignore[no-untyped-def]
        return builder.bitcast(args[0], ir.IntType(64))

    return signature, codegen


@intrinsic
def from_bits(typing, pattern):  # type: ignore[no-untyped-def]
    """The double with these bits."""
    signature = types.float64(types.int64)

    def codegen(context, builder, sig, args):  # type: ignore[no-untyped-def]
        return builder.bitcast(args[0], ir.DoubleType())

    return signature, codegen


@intrinsic
def fma(typing, a, b, c):  # type: ignore[no-untyped-def]
    """a b + c, rounded once: compiled loops fuse nothing that is not said to be fused."""

    def codegen(context, builder, sig, args):  # type: ignore[no-untyped-def]
        return builder.fma(*args)

    return types.float64(types.float64, types.float64, types.float64), codegen


@intrinsic
def smaller(typing, a, b):  # type: ignore[no-untyped-def]
    """The smaller one of two doubles."""

    def codegen(context, builder, sig, args):  # type: ignore[no-untyped-def]
        return builder.select(builder.fcmp_ordered("<", args[1], args[0]), args[1], args[0])

    return types.float64(types.float64, types.float64), codegen


@intrinsic
def larger(typing, a, b):  # type: ignore[no-untyped-def]
    """The larger one of two doubles."""

    def codegen(context, builder, sig, args):  # type: ignore[no-untyped-def]
        return builder.select(builder.fcmp_ordered(">", args[1], args[0]), args[1], args[0])

    return types.float64(types.float64, types.float64), codegen


@intrinsic
def array_of(typing, row, count):  # type: ignore[no-untyped-def]
    """So many numbers of a row, as an array."""
    kind = row.dtype[::1]

    def codegen(context, builder, sig, args):  # type: ignore[no-untyped-def]
        return _numbers(context, builder, kind, args[0], [args[1]])

    return kind(row, types.int64), codegen


@intrinsic
def doubles_at(typing, address, count, width):  # type: ignore[no-untyped-def]
    """The doubles at an address as rows."""
    return types.float64[:, ::1](types.int64, types.int64, types.int64), _view


@intrinsic
def integers_at(typing, address, count, width):  # type: ignore[no-untyped-def]
    """The integers at an address as rows."""
    return types.int64[:, ::1](types.int64, types.int64, types.int64), _view


def _view(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    pointer = context.get_data_type(sig.return_type.dtype).as_pointer()
    return _numbers(context, builder, sig.return_type, builder.inttoptr(args[0], pointer), args[1:])


def _numbers(context: Any, builder: Any, kind: Any, data: Any, shape: Any) -> Any:
    """An array of numbers of eight bytes that are kept elsewhere."""
    made = context.make_array(kind)(context, builder)
    size = context.get_constant(types.intp, 8)
    strides = [size]
    for count in reversed(shape[1:]):
        strides.insert(0, builder.mul(count, strides[0]))
    context.populate_array(
        made,
        data=data,
        shape=cgutils.pack_array(builder, shape),
        strides=cgutils.pack_array(builder, strides),
        itemsize=size,
        meminfo=None,
        parent=None,
    )
    return made._getvalue()
