"""Parameters that are expressions in others, where these have other values."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from graphlib import TopologicalSorter

import sympy as sp

from henon_ref.integrator.constant_program import ConstantProgram, constant_program
from henon_ref.integrator.pairs import Pair, exact_expression
from henon_ref.simulation.system import System


def following(system: System, moved: frozenset[str]) -> dict[str, sp.Expr]:
    """Parameters that are expressions in moved ones, directly or not, each behind those that it uses."""
    read = {name: expression for name, expression in system.parameter_expressions.items() if name not in moved}
    uses = {name: {s.name for s in expression.free_symbols} for name, expression in read.items()}
    changed = set(moved)
    order = [name for name in TopologicalSorter(uses).static_order() if name in read]
    found: dict[str, sp.Expr] = {}
    for name in order:
        if uses[name] & changed:
            changed.add(name)
            found[name] = read[name]
    return found


def without_others(
    expressions: Mapping[str, sp.Expr], moved: frozenset[str], exact: Mapping[str, sp.Expr]
) -> dict[str, sp.Expr]:
    """Expressions in moved parameters alone: others' own expressions and exact values put in."""
    known = {sp.Symbol(name, real=True): value for name, value in exact.items() if name not in moved}
    found: dict[str, sp.Expr] = {}
    for name, expression in expressions.items():  # each behind those that it uses
        found[name] = known[sp.Symbol(name, real=True)] = expression.xreplace(known)
    return found


def pairs_at(program: ConstantProgram, point: Sequence[float]) -> list[Pair]:
    """Expressions of a program at the decimal numbers that doubles are printed as; NaN where they are not finite."""
    nowhere = math.nan, 0.0
    if not all(map(math.isfinite, point)):
        return [nowhere] * len(program.outputs)
    exact = program.exact_values([exact_expression(v) for v in point])
    highs = [float(value) for value in exact]
    pairs = zip(highs, exact, strict=True)
    return [(high, float(value - high)) if math.isfinite(high) else nowhere for high, value in pairs]


@dataclass(frozen=True, eq=False)
class DependentParameters:
    """What follows some parameters of a system that move.

    Attributes
    ----------
    names : tuple of str
        Of the parameters that are expressions in them.
    expressions : tuple of Expr
        In those that move alone.
    """

    inputs: tuple[sp.Symbol, ...]
    names: tuple[str, ...]
    expressions: tuple[sp.Expr, ...]
    program: ConstantProgram

    @classmethod
    def of(cls, system: System, moved: frozenset[str]) -> DependentParameters:
        """Those of a system.

        Raises
        ------
        ModelError
            Where an expression has a function that no program evaluates.
        """
        exact = {symbol.name: value for symbol, value in system.model.parameters.items()}
        found = without_others(following(system, moved), moved, exact)
        expressions = tuple(found.values())
        inputs = tuple(sorted(set().union(*(e.free_symbols for e in expressions)), key=lambda s: s.name))
        return cls(inputs, tuple(found), expressions, constant_program(inputs, expressions))

    def pairs(self, values: Mapping[str, float]) -> dict[str, Pair]:
        """Their values where the others have some, each a double and what that leaves; NaN where one is not finite."""
        if not self.names:
            return {}
        return dict(zip(self.names, pairs_at(self.program, [values[s.name] for s in self.inputs]), strict=True))

    def exact(self, values: Mapping[str, float]) -> dict[str, sp.Expr]:
        """The same as exact numbers."""
        known = {symbol: exact_expression(values[symbol.name]) for symbol in self.inputs}
        return {name: e.xreplace(known) for name, e in zip(self.names, self.expressions, strict=True)}
