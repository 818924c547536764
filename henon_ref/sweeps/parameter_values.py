"""Values of all parameters of a system where some of them are swept: those that are expressions in them follow."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import sympy as sp

from henon_ref.casefile.expressions import parse_expression
from henon_ref.filippov.exact_numbers import double_double
from henon_ref.henon.constant_program import constant_program
from henon_ref.henon.pairs import decimal_pairs
from henon_ref.simulation.dependent_parameters import following, pairs_at, without_others
from henon_ref.simulation.system import System
from henon_ref.simulation.written import written
from henon_ref.sweeps.runs import Vector


def parameter_values(system: System, swept: Mapping[str, Vector], count: int) -> dict[str, Vector]:
    """Every parameter -> its values as pairs of doubles (:mod:`henon_ref.henon.pairs`), shape (count, 2).

    Parameters
    ----------
    system : System
    swept : mapping
        Parameter -> values, shape (count,).
    count : int
    """
    exact = {symbol.name: value for symbol, value in system.model.parameters.items()}
    found = {name: np.tile(double_double(value), (count, 1)) for name, value in exact.items() if name not in swept}
    found |= {name: decimal_pairs(values) for name, values in swept.items()}
    for name, expression in without_others(following(system, frozenset(swept)), frozenset(swept), exact).items():
        found[name] = _evaluated(expression, swept, count)
    return found


def _evaluated(expression: sp.Expr, swept: Mapping[str, Vector], count: int) -> Vector:
    """An expression at the decimal numbers that swept parameters are printed as, to the last bit; shape (count, 2)."""
    symbols = sorted(expression.free_symbols, key=lambda s: s.name)
    if not symbols:
        return np.tile(double_double(expression), (count, 1))
    points, places = np.unique(np.column_stack([swept[s.name] for s in symbols]), axis=0, return_inverse=True)
    program = constant_program(tuple(symbols), (expression,))
    pairs = [pairs_at(program, point) for point in points.tolist()]
    return np.array(pairs).reshape(-1, 2)[places.ravel()]


def number_values(system: System, value: object, swept: Mapping[str, Vector]) -> Vector:
    """A number at each point as a pair of doubles, shape (K, 2) or (1, 2): one that is text follows swept parameters.

    Parameters
    ----------
    system : System
    value : number or str
    swept : mapping
        Parameter -> values, shape (K,).
    """
    names = {name: sp.Symbol(name, real=True) for name in system.parameters}
    exact = {symbol.name: own for symbol, own in system.model.parameters.items()}
    read = {**following(system, frozenset(swept)), "": parse_expression(written(value, "a number"), names)}
    count = len(next(iter(swept.values()))) if swept else 1
    return _evaluated(without_others(read, frozenset(swept), exact)[""], swept, count)
