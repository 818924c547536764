"""Compile units: functions of the compiled loop that are compiled by themselves, and called by symbol.

A function that the loop contains is compiled for itself, again in whoever calls it, and again in the loop. What is not
called at every step is therefore no part of it: the caller's machine code has its name only, which the linker looks up
among the symbols of the process. All units are there before the loop is compiled or read from the disk; two processes
can compile them at one time.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import llvmlite.binding as llvm
from numba import float64, int64, types
from numba.core import cgutils
from numba.core.errors import TypingError
from numba.extending import intrinsic

from henon_ref.jit.shared_compiling import Compiled, compile_all

ROW, ROWS, TABLES, NUMBERS = float64[::1], float64[:, ::1], int64[:, :, ::1], float64[:, :, ::1]
"""Types of the loop's arrays; what it works with inside are views of them (:mod:`henon_ref.jit.views`)."""
UNITS: dict[str, Compiled] = {}
"""By symbol, each such function and the types that it is called with."""
_linked: set[str] = set()


def compile_unit(function: Any, result: Any, *given: Any) -> Callable[..., Any]:
    """What calls a function by its symbol, in compiled code, with the function's own arguments.

    The function must raise nothing.

    Parameters
    ----------
    function : Dispatcher
        Compiled by :func:`henon_ref.jit.njit.inner`.
    result, *given : numba types
        What it returns and takes.
    """
    symbol = f"henon_ref.{function.__name__}"
    assert symbol not in UNITS, f"two compile units are called {symbol}"
    UNITS[symbol] = function, given
    return call_symbol(symbol, result, *given)


def compile_on_demand(function: Any, result: Any, *given: Any) -> tuple[Callable[[], int], Callable[..., Any]]:
    """The same for a function that few systems need: it is compiled where one asks for its address.

    Returns
    -------
    address : callable
        Compiles it, or reads it from the disk, and returns its address.
    call : callable
        In compiled code, from the address and the function's own arguments its result.
    """

    def address() -> int:
        compile_all([(function, given)])
        return _address(function, given)

    @intrinsic
    def call(typing, place, *arguments):  # type: ignore[no-untyped-def]
        if arguments != given:
            raise TypingError(f"{function.__name__} takes {given}, not {arguments}")

        def codegen(context, builder, signature, values):  # type: ignore[no-untyped-def]
            kind = context.call_conv.get_function_type(result, given)
            parts = [builder.extract_value(values[1], i) for i in range(len(given))]
            returned, raised = (cgutils.alloca_once(builder, pointer.pointee) for pointer in kind.args[:2])
            words = context.get_arg_packer(given).as_arguments(builder, parts)
            builder.call(builder.inttoptr(values[0], kind.as_pointer()), [returned, raised, *words])
            return context.get_returned_value(builder, result, builder.load(returned))

        return result(int64, types.StarArgTuple.from_types(given)), codegen

    return address, call


def call_symbol(symbol: str, result: Any, *given: Any) -> Callable[..., Any]:
    """What calls, in compiled code, the function that :func:`add_symbol` has given a name; see :func:`compile_unit`."""

    @intrinsic
    def call(typing, *arguments):  # type: ignore[no-untyped-def]
        if arguments != given:
            raise TypingError(f"{symbol} takes {given}, not {arguments}")

        def codegen(context, builder, signature, values):  # type: ignore[no-untyped-def]
            kind = context.call_conv.get_function_type(result, given)
            callee = cgutils.get_or_insert_function(builder.module, kind, symbol)
            parts = [builder.extract_value(values[0], i) for i in range(len(given))]
            return context.call_conv.call_function(builder, callee, result, given, parts)[1]

        return result(types.StarArgTuple.from_types(given)), codegen

    return call


def link() -> None:
    """Compile all units, or read them from the disk, and tell the linker where they are."""
    compile_all([made for symbol, made in UNITS.items() if symbol not in _linked])
    for symbol in UNITS.keys() - _linked:
        add_symbol(symbol, *UNITS[symbol])
        _linked.add(symbol)


def add_symbol(symbol: str, function: Any, given: tuple[Any, ...]) -> None:
    """Tell the linker where a function is that has been compiled for some types."""
    llvm.add_symbol(symbol, _address(function, given))


def _address(function: Any, given: tuple[Any, ...]) -> int:
    """Where a function is that has been compiled for some types."""
    made = function.overloads[given]
    return int(made.library.get_pointer_to_function(made.fndesc.llvm_func_name))
