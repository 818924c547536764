"""Callbacks on arrays compiled by numba, for the solvers named ``+numba``.

numba is imported only here, when the first callback is compiled.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any, Literal

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.errors import UnavailableError
from henon_ref.jit.native_module import target
from henon_ref.modes.callables import Jacobian, ScalarPrinter, interpreted, with_rounded_constants
from henon_ref.taylor.tape import TIME

Callbacks = Literal["python", "numba"]
"""Kind of the callbacks for right-hand sides, Jacobians and guards: plain Python, or compiled by numba."""
Fill = Callable[[float, Any, Any], None]
"""``f(t, x, out)`` writes one value per expression into the flat array ``out``."""


def njit(function: Callable[..., Any]) -> Any:
    """Compile a function by numba, for the same processor as the reference's modes (see ``target``).

    A division by zero gives infinity or NaN (numba's ``numpy`` error model).

    Raises
    ------
    UnavailableError
        If numba is not installed.
    """
    try:
        import numba
    except ImportError as error:
        raise UnavailableError("numba is not installed: pip install 'henon-ref[numba]'") from error
    numba.core.config.CPU_NAME, numba.core.config.CPU_FEATURES = target()
    return numba.njit(function, error_model="numpy")


def compiled(states: Sequence[sp.Symbol], expressions: Iterable[sp.Expr]) -> Fill:
    """Compile expressions in time and states; an expression without a value gives NaN or infinity."""
    clock, array = sp.Symbol("clock_"), sp.IndexedBase("x_")
    names = {TIME: clock, **{x: array[k] for k, x in enumerate(states)}}
    exprs = tuple(e.xreplace(names) for e in with_rounded_constants(expressions))
    values = njit(
        sp.lambdify([clock, array], exprs, modules=[{"pow": math.pow}, "math"], printer=ScalarPrinter(), cse=True)
    )

    def fill(t: float, x: Any, out: Any) -> None:
        results = values(t, x)
        for k in range(len(results)):
            out[k] = results[k]

    made: Fill = njit(fill)
    return made


def jacobian(
    states: Sequence[sp.Symbol],
    field: Sequence[sp.Expr],
    callbacks: Callbacks,
    switches: Sequence[sp.Symbol] = (),
) -> Jacobian:
    """Return df/dx derived by SymPy, with entries in plain Python or compiled."""
    return Jacobian(states, field, switches, _filled if callbacks == "numba" else interpreted)


def _filled(symbols: Sequence[sp.Symbol], expressions: Sequence[sp.Expr]) -> Callable[[float, Any], Any]:
    fill, room = compiled(symbols, expressions), np.empty(len(expressions))

    def values(t: float, x: NDArray[np.float64]) -> NDArray[np.float64]:
        fill(t, x, room)
        return room

    return values
