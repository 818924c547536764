"""Values of all parameters of a system where some of them are swept: those that are expressions in them follow."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import sympy as sp

from henon_ref.casefile.expressions import parse_expression
from henon_ref.integrator.constant_program import constant_program
from henon_ref.integrator.pairs import decimal_pairs
from henon_ref.modes.exact_numbers import double_double
from henon_ref.simulation.dependent_parameters import following, pairs_at, without_others
from henon_ref.simulation.system import System
from henon_ref.simulation.written import as_given
from henon_ref.sweeps.runs import Vector


class PointNumbers:
    """The numbers of points: what is written of them is read once, and evaluated wherever parameters are swept.

    Parameters
    ----------
    system : System
    swept : frozenset of str
        Parameters whose values the points have.
    numbers : mapping
        Further numbers by name; one that is text follows swept parameters.
    """

    def __init__(self, system: System, swept: frozenset[str], numbers: Mapping[str, object]) -> None:
        exact = {symbol.name: value for symbol, value in system.model.parameters.items()}
        names = {name: sp.Symbol(name, real=True) for name in system.parameters}
        read = following(system, swept)
        self.moved = swept | read.keys()
        """Parameters that differ from point to point."""
        own = without_others(read, swept, exact)
        known = {names[name]: value for name, value in {**exact, **own}.items() if name not in swept}
        self._parameters = {name: _Number(own.get(name, exact[name])) for name in exact if name not in swept}
        self._numbers = {
            name: _Number(parse_expression(as_given(value, "a number"), names).xreplace(known))
            for name, value in numbers.items()
        }

    def parameters(self, swept: Mapping[str, Vector], count: int) -> dict[str, Vector]:
        """Every parameter -> its values as pairs of doubles (:mod:`henon_ref.integrator.pairs`), shape (count, 2).

        Parameters
        ----------
        swept : mapping
            Parameter -> values, shape (count,).
        count : int
        """
        found = {name: number.pairs(swept, count) for name, number in self._parameters.items()}
        return found | {name: decimal_pairs(values) for name, values in swept.items()}

    def number(self, name: str, swept: Mapping[str, Vector], count: int) -> Vector:
        """Another number likewise, shape (count, 2)."""
        return self._numbers[name].pairs(swept, count)


class _Number:
    """An expression in swept parameters, at the decimal numbers that these are printed as, to the last bit."""

    def __init__(self, expression: sp.Expr) -> None:
        symbols = sorted(expression.free_symbols, key=lambda s: s.name)
        self._names = [symbol.name for symbol in symbols]
        self._constant = np.zeros(2) if symbols else np.array(double_double(expression))
        self._program = constant_program(tuple(symbols), (expression,)) if symbols else None

    def pairs(self, swept: Mapping[str, Vector], count: int) -> Vector:
        if self._program is None:
            return np.broadcast_to(self._constant, (count, 2))
        points, places = np.unique(np.column_stack([swept[n] for n in self._names]), axis=0, return_inverse=True)
        pairs = [pairs_at(self._program, point) for point in points.tolist()]
        return np.array(pairs).reshape(-1, 2)[places.ravel()]
