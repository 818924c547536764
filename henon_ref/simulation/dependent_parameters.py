"""Parameters that are expressions in other parameters, at changed values of these."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from graphlib import TopologicalSorter

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.expressions.bounds import double_double
from henon_ref.integrator.constant_program import constant_program
from henon_ref.integrator.pairs import Pair, exact_expression
from henon_ref.simulation.system import System


def following(system: System, moved: frozenset[str]) -> dict[str, sp.Expr]:
    """Return the parameters that depend on changed ones, as expressions in the changed ones only."""
    read = {name: expression for name, expression in system.parameter_expressions.items() if name not in moved}
    uses = {name: {s.name for s in expression.free_symbols} for name, expression in read.items()}
    known = {symbol: value for symbol, value in system.model.parameters.items() if symbol.name not in moved}
    found: dict[str, sp.Expr] = {}
    for name in TopologicalSorter(uses).static_order():  # each after the ones that it uses
        if name in read and uses[name] & (moved | found.keys()):
            found[name] = known[sp.Symbol(name, real=True)] = read[name].xreplace(known)
    return found


class Number:
    """Expression in parameters, evaluated exactly at the printed decimal numbers of their doubles.

    Raises
    ------
    ModelError
        If no program evaluates a function in it.
    """

    def __init__(self, expression: sp.Expr) -> None:
        symbols = tuple(sorted(expression.free_symbols, key=lambda s: s.name))
        self.names = tuple(symbol.name for symbol in symbols)
        self._expression, self._symbols = expression, symbols
        self._program = constant_program(symbols, (expression,)) if symbols else None

    def pair(self, point: Sequence[float]) -> Pair:
        """Return its value as a pair of doubles at values of ``names``; NaN if a value is not finite."""
        if self._program is None:
            return double_double(self._expression)
        if all(map(math.isfinite, point)):
            (exact,) = self._program.exact_values([exact_expression(value) for value in point])
            high = float(exact)
            if math.isfinite(high):
                return high, float(exact - high)
        return math.nan, 0.0

    def pairs(self, columns: Mapping[str, NDArray[np.float64]], count: int) -> NDArray[np.float64]:
        """Return its values at many points, given as columns by name, shape (count, 2)."""
        if self._program is None:
            return np.broadcast_to(self.pair(()), (count, 2))
        points, places = np.unique(np.column_stack([columns[n] for n in self.names]), axis=0, return_inverse=True)
        return np.array([self.pair(point) for point in points.tolist()]).reshape(-1, 2)[places.ravel()]

    def exact(self, values: Mapping[str, float]) -> sp.Expr:
        """Return its exact value at values of the parameters."""
        return self._expression.xreplace({s: exact_expression(values[s.name]) for s in self._symbols})
