"""Conversion of SymPy expressions to operations, for systems from Python.

Symbols are identified by name, whatever their assumptions; a float is converted to the decimal number that it prints
as. Sums and products keep the order in which SymPy prints them; kinks are numbered in this order.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

import sympy as sp

from henon_ref.errors import ExpressionError
from henon_ref.expressions.grammar import CONSTANTS, EULER, MAX_DEPTH, NAME, check_name
from henon_ref.expressions.operations import Operation
from henon_ref.text import shortened

_CALLS = {sp.Abs: "abs", sp.Max: "max", sp.Min: "min"}
"""Functions of SymPy -> their names in case files, if different."""
_COMPARISONS = (sp.StrictLessThan, sp.LessThan, sp.StrictGreaterThan, sp.GreaterThan)


def operation_of(expression: sp.Expr, names: Collection[str], functions: Mapping[str, int]) -> Operation:
    """Return the operations of a SymPy expression; ``names``, ``functions`` as in :func:`expressions.parser.parsed`."""
    found = _Reader().of(expression, 0)
    for part in found.parts():
        if part.kind == "name":
            check_name(str(part.value), names, functions, 0)
        elif part.kind == "call" and part.value not in functions:
            check_name(str(part.value), (), functions, 0)
    return found


def spelled_out(expression: sp.Expr) -> str:
    """Return a SymPy expression as text of a case file."""
    return _Reader().of(expression, 0).text()


class _Reader:
    def of(self, e: sp.Basic, depth: int) -> Operation:
        if depth > MAX_DEPTH:
            raise ExpressionError(f"nested deeper than {MAX_DEPTH}")
        if isinstance(e, sp.Symbol):
            if not NAME.fullmatch(e.name):
                raise ExpressionError(
                    f"the symbol {shortened(e.name)} is not a name: a letter, then letters, digits and underscores"
                )
            return Operation("name", (), e.name)
        if e.is_Rational:
            return Operation("number", (), sp.Rational(e))
        if e.is_Float and e.is_finite:
            return Operation("number", (), sp.Rational(repr(float(e)) if e._prec == 53 else str(e)))
        if e.is_Add:
            return Operation("+", tuple(self.of(term, depth + 1) for term in e.as_ordered_terms()))
        if e.is_Mul:
            return self._product(e, depth)
        if e.is_Pow:
            return self._power(e, depth)
        if isinstance(e, sp.Heaviside):
            above = Operation(">", (self.of(e.args[0], depth + 1), Operation("number", (), sp.S.Zero)))
            one, none = (Operation("number", (), number) for number in (sp.S.One, sp.S.Zero))
            return Operation("call", (one, above, none), "piecewise")
        if isinstance(e, sp.Piecewise):
            return self._chosen([(value, condition) for value, condition in e.args], depth)
        return self._other(e, depth)

    def _other(self, e: sp.Basic, depth: int) -> Operation:
        """Convert a function; other objects are refused by their name."""
        if e is sp.E or e is sp.pi:
            return Operation("name", (), EULER if e is sp.E else CONSTANTS[0])
        if not e.args:
            check_name(str(e), (), {}, 0)
        if isinstance(e, sp.cot):  # SymPy writes tan(x + pi/2) as -cot(x)
            return self.of(sp.cos(e.args[0]) / sp.sin(e.args[0]), depth)
        name = _CALLS.get(e.func, e.func.__name__)
        ordered = sorted(e.args, key=sp.default_sort_key) if isinstance(e, sp.Max | sp.Min) else e.args
        if not ordered or not all(isinstance(a, sp.Expr) for a in ordered):
            raise ExpressionError(f"{shortened(str(e))} is not an expression")
        return Operation("call", tuple(self.of(a, depth + 1) for a in ordered), name)

    def _product(self, e: sp.Mul, depth: int) -> Operation:
        factors = [self.of(factor, depth + 1) for factor in e.as_ordered_factors()]
        return Operation("*", tuple(sorted(factors, key=lambda factor: factor.kind == "/")))

    def _power(self, e: sp.Pow, depth: int) -> Operation:
        base, exponent = e.args
        below = exponent.is_Rational and exponent.is_negative
        exponent = -exponent if below else exponent
        found = self.of(base, depth + 1)
        if exponent != 1:
            found = Operation("^", (found, self.of(exponent, depth + 1)))
        return Operation("/", (found,)) if below else found

    def _chosen(self, pairs: list[tuple[sp.Expr, sp.Basic]], depth: int) -> Operation:
        """Convert a Piecewise; a condition with And or Or becomes a choice within a choice."""
        if not pairs:
            raise ExpressionError("a Piecewise has no value if none of its conditions holds; end it with (value, True)")
        if depth > MAX_DEPTH:
            raise ExpressionError(f"nested deeper than {MAX_DEPTH}")
        (value, condition), *others = pairs
        if condition == sp.true:
            return self.of(value, depth + 1)
        if isinstance(condition, sp.And | sp.Or):
            first, *rest = sorted(condition.args, key=sp.default_sort_key)
            within = self._chosen([(value, condition.func(*rest)), *others], depth + 1)
            if isinstance(condition, sp.Or):
                return self._choice(self.of(value, depth + 1), first, within, depth)
            return self._choice(within, first, self._chosen(others, depth + 1), depth)
        return self._choice(self.of(value, depth + 1), condition, self._chosen(others, depth + 1), depth)

    def _choice(self, value: Operation, condition: sp.Basic, otherwise: Operation, depth: int) -> Operation:
        if not isinstance(condition, _COMPARISONS):
            raise ExpressionError(f"a condition must compare with <, <=, > or >=, not {shortened(str(condition))}")
        sides = tuple(self.of(side, depth + 1) for side in (condition.lhs, condition.rhs))
        return Operation("call", (value, Operation(condition.rel_op, sides), otherwise), "piecewise")
