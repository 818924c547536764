"""Operations of compiled loops that numba has none for, or compiles a function for each."""

from __future__ import annotations

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
def rows_of(typing, array, first, count, width):  # type: ignore[no-untyped-def]
    """A view of part of an array of doubles as rows: from place ``first`` on, ``count`` of them."""
    view = types.float64[:, ::1]

    def codegen(context, builder, sig, args):  # type: ignore[no-untyped-def]
        source = context.make_array(sig.args[0])(context, builder, value=args[0])
        made = context.make_array(view)(context, builder)
        size = context.get_constant(types.intp, 8)
        context.populate_array(
            made,
            data=builder.gep(source.data, [args[1]]),
            shape=cgutils.pack_array(builder, [args[2], args[3]]),
            strides=cgutils.pack_array(builder, [builder.mul(args[3], size), size]),
            itemsize=size,
            meminfo=None,
            parent=None,
        )
        return made._getvalue()

    return view(types.float64[::1], types.int64, types.int64, types.int64), codegen
