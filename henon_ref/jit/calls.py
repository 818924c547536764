"""Calls from compiled loops into machine code that is known by its address."""

from __future__ import annotations

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from henon_ref.jit.views import begin_of


@intrinsic
def call_expand(typing, address, t, low, unit, x, constants, out):  # type: ignore[no-untyped-def]
    """Call compiled Taylor coefficients by address (of views, or of arrays that are C-contiguous)."""
    signature = types.void(types.int64, types.float64, types.float64, types.float64, x, constants, out)

    def codegen(context, builder, sig, args):  # type: ignore[no-untyped-def]
        double = ir.DoubleType()
        pointer = double.as_pointer()
        kind = ir.FunctionType(ir.VoidType(), [double, double, double, pointer, pointer, pointer])
        function = builder.inttoptr(args[0], kind.as_pointer())
        rows = [begin_of(context, builder, sig.args[i], args[i]) for i in range(4, 7)]
        builder.call(function, [args[1], args[2], args[3], *rows])
        return context.get_dummy_value()

    return signature, codegen


@intrinsic
def call_closing(typing, address, theta, c, out):  # type: ignore[no-untyped-def]
    """Call the compiled end of a step by address (of views, or of arrays that are C-contiguous)."""
    signature = types.void(types.int64, types.float64, c, out)

    def codegen(context, builder, sig, args):  # type: ignore[no-untyped-def]
        double = ir.DoubleType()
        pointer = double.as_pointer()
        kind = ir.FunctionType(ir.VoidType(), [double, pointer, pointer])
        function = builder.inttoptr(args[0], kind.as_pointer())
        rows = [begin_of(context, builder, sig.args[i], args[i]) for i in (2, 3)]
        builder.call(function, [args[1], *rows])
        return context.get_dummy_value()

    return signature, codegen


@intrinsic
def call_bernstein(typing, address, q, powers, degree, a, b):  # type: ignore[no-untyped-def]
    """Call :mod:`henon_ref.roots.bernstein` by address (of views, or of arrays that are C-contiguous)."""
    signature = types.int64(types.int64, q, powers, types.int64, a, b)

    def codegen(context, builder, sig, args):  # type: ignore[no-untyped-def]
        pointer, integer = ir.DoubleType().as_pointer(), ir.IntType(64)
        kind = ir.FunctionType(integer, [pointer, pointer, integer, pointer, pointer])
        function = builder.inttoptr(args[0], kind.as_pointer())
        q, powers, a, b = (begin_of(context, builder, sig.args[i], args[i]) for i in (1, 2, 4, 5))
        return builder.call(function, [q, powers, args[3], a, b])

    return signature, codegen
