"""Functions of the compiled loop that stand apart: compiled by themselves, and called by their address.

A function that the loop contains is compiled for itself, again in whoever calls it, and again in the loop. What is not
called at every step is therefore no part of it; two processes can compile such functions and the loop at one time.

The addresses stand in registers of a run. Where a function is not needed by every run (ALWAYS says which are) its
register is 0 until the first one needs it: the loop asks :func:`missing`, takes back what it has done since Python
called it, and comes back with MISSING; Python loads the function (:func:`load`), and calls the loop again as if nothing
had been.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from numba import boolean, float64, int64, types
from numba.core.errors import TypingError
from numba.extending import intrinsic

from henon_ref.henon.registers import A_LAND, ALWAYS, I_MISSING, I_SIZE
from henon_ref.jit import compiling

ROW, ROWS, COUNTS, LAYOUT = float64[::1], float64[:, ::1], int64[::1], int64[:, ::1]
"""Types of the arrays that the loop works with."""
FUNCTIONS: dict[int, tuple[Any, tuple[Any, ...]]] = {}
"""By its register, each such function and the types that it is called with."""
_addresses: dict[int, int] = {}


def apart(register: int, function: Any, result: Any, *given: Any) -> Callable[..., Any]:
    """What calls a function in compiled code: with the run's integers, then what the function is given.

    The function must have been loaded, and raise nothing.

    Parameters
    ----------
    register : int
        Where its address stands among the run's integers.
    function : Dispatcher
        Compiled by :func:`henon_ref.jit.inner`.
    result, *given : numba types
        What it returns and takes.
    """
    FUNCTIONS[register] = function, given

    @intrinsic
    def call(typing, integers, *arguments):  # type: ignore[no-untyped-def]
        if integers != COUNTS or arguments != given:
            raise TypingError(f"{function.__name__} takes {given}, not {arguments}")

        def codegen(context, builder, signature, values):  # type: ignore[no-untyped-def]
            address = builder.load(_place(context, builder, values[0], context.get_constant(int64, register)))
            pointer = builder.inttoptr(address, context.call_conv.get_function_type(result, given).as_pointer())
            parts = [builder.extract_value(values[1], i) for i in range(len(given))]
            return context.call_conv.call_function(builder, pointer, result, given, parts)[1]

        return result(integers, types.StarArgTuple.from_types(given)), codegen

    return call


@intrinsic
def missing(typing, integers, register):  # type: ignore[no-untyped-def]
    """True, and written down for Python, where the function of a register has not been loaded."""

    def codegen(context, builder, signature, values):  # type: ignore[no-untyped-def]
        absent = builder.icmp_signed("==", builder.load(_place(context, builder, *values)), values[1].type(0))
        note = _place(context, builder, values[0], context.get_constant(int64, I_MISSING))
        builder.store(builder.select(absent, values[1], builder.load(note)), note)
        return absent

    return boolean(COUNTS, int64), codegen


def _place(context: Any, builder: Any, integers: Any, register: Any) -> Any:
    """Where a register of a run is in memory."""
    return builder.gep(context.make_array(COUNTS)(context, builder, value=integers).data, [register])


def load(register: int) -> int:
    """Address of a function, compiled on the first call, or read from the disk."""
    if register not in _addresses:
        function, given = FUNCTIONS[register]
        with compiling():
            function.compile(given)
        made = function.overloads[given]
        _addresses[register] = made.library.get_pointer_to_function(made.fndesc.llvm_func_name)
    return _addresses[register]


def addresses() -> Sequence[int]:
    """What the registers of a run begin with, from the first of them on: 0 for functions that are not loaded."""
    for register in ALWAYS:
        load(register)
    return [_addresses.get(register, 0) for register in range(A_LAND, I_SIZE)]
