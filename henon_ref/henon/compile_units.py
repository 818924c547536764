"""Functions of the compiled loop that stand apart: compiled by themselves, and called by their address.

A function that the loop contains is compiled for itself, again in whoever calls it, and again in the loop. What is not
called at every step is therefore no part of it; two processes can compile such functions and the loop at one time.

The addresses stand in a table, to which a register of each run leads. Where a function is not needed by every run
(ALWAYS says which are) its place is 0 until a run needs it: the loop asks :func:`missing`, takes back what it has done
since Python called it, and comes back with MISSING; Python loads the function (:func:`load`), and calls the loop again
as if nothing had been.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import boolean, float64, int64, types
from numba.core.errors import TypingError
from numba.extending import intrinsic

from henon_ref.henon.registers import (
    A_SIZE,
    ALWAYS,
    I_APART,
    I_MISSING,
)
from henon_ref.henon.sharing import Compiled, compile_all
from henon_ref.henon.views import INTEGERS

ROW, ROWS, COUNTS, LAYOUT = float64[::1], float64[:, ::1], int64[::1], int64[:, ::1]
TABLES, NUMBERS = int64[:, :, ::1], float64[:, :, ::1]
"""Types of arrays; what the loop itself works with are views of them (:mod:`henon_ref.henon.views`)."""
FUNCTIONS: dict[int, Compiled] = {}
"""By its place, each such function and the types that it is called with."""
_table = np.zeros(A_SIZE, dtype=np.int64)


def apart(place: int, function: Any, result: Any, *given: Any) -> Callable[..., Any]:
    """What calls a function in compiled code: with the run's integers, then what the function is given.

    The function must have been loaded, and raise nothing.

    Parameters
    ----------
    place : int
        Where its address stands in the table.
    function : Dispatcher
        Compiled by :func:`henon_ref.jit.inner`.
    result, *given : numba types
        What it returns and takes.
    """
    FUNCTIONS[place] = function, given

    @intrinsic
    def call(typing, integers, *arguments):  # type: ignore[no-untyped-def]
        if integers != INTEGERS or arguments != given:
            raise TypingError(f"{function.__name__} takes {given}, not {arguments}")

        def codegen(context, builder, signature, values):  # type: ignore[no-untyped-def]
            address = builder.load(_entry(context, builder, values[0], context.get_constant(int64, place)))
            pointer = builder.inttoptr(address, context.call_conv.get_function_type(result, given).as_pointer())
            parts = [builder.extract_value(values[1], i) for i in range(len(given))]
            return context.call_conv.call_function(builder, pointer, result, given, parts)[1]

        return result(integers, types.StarArgTuple.from_types(given)), codegen

    return call


@intrinsic
def missing(typing, integers, place):  # type: ignore[no-untyped-def]
    """True, and written down for Python, where a function has not been loaded."""

    def codegen(context, builder, signature, values):  # type: ignore[no-untyped-def]
        absent = builder.icmp_signed("==", builder.load(_entry(context, builder, *values)), values[1].type(0))
        note = _register(context, builder, values[0], I_MISSING)
        builder.store(builder.select(absent, values[1], builder.load(note)), note)
        return absent

    return boolean(INTEGERS, int64), codegen


def _register(context: Any, builder: Any, integers: Any, register: int) -> Any:
    """Where a register of a run is in memory."""
    return builder.gep(integers, [context.get_constant(int64, register)])


def _entry(context: Any, builder: Any, integers: Any, place: Any) -> Any:
    """Where a place of the table is in memory."""
    table = builder.load(_register(context, builder, integers, I_APART))
    return builder.gep(builder.inttoptr(table, place.type.as_pointer()), [place])


def load(place: int) -> None:
    """Compile a function, or read it from the disk; with one that is always needed all of those."""
    places = ALWAYS if place in ALWAYS else (place,)
    compile_all([FUNCTIONS[each] for each in places])
    for each in places:
        function, given = FUNCTIONS[each]
        made = function.overloads[given]
        _table[each] = made.library.get_pointer_to_function(made.fndesc.llvm_func_name)


def table() -> int:
    """Address of the table, in which all functions of the loop are."""
    for place in ALWAYS:
        if not _table[place]:
            load(place)
    return int(_table.ctypes.data)
