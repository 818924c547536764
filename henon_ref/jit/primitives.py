"""Operations of compiled loops that numba has none for, or compiles a function for each."""

from __future__ import annotations

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

EPS = 2.220446049250313e-16
"""Distance from 1 to the next double."""


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
