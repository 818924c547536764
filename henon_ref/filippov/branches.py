"""Branches of a field that a mode does not use: their operations are no part of the mode's equations.

Equations that several modes share hold the signs as symbols, and a branch that a mode does not use is multiplied by
zero there. Of a term that is linear in time and states that leaves nothing; of any other it need not: zero times the
root of a negative number, or times what has overflowed, is no number.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

import sympy as sp


def leaves_out(
    shared: sp.Expr, own: sp.Expr, signs: Mapping[sp.Symbol, sp.Expr], moving: Collection[sp.Symbol]
) -> bool:
    """Whether a mode's own expression lacks an operation of the shared one that is not linear.

    Parameters
    ----------
    shared : Expr
        With symbols for the signs.
    own : Expr
        The same with the signs put in.
    signs : mapping
        What is put in for the symbols.
    moving : collection of Symbol
        Time and states.
    """
    if shared.free_symbols.isdisjoint(signs):
        return False
    kept, values = _operations(own, moving), dict(signs)
    images = ((e, e.xreplace(values)) for e in _operations(shared, moving))
    return any(e not in kept and _core(image, moving) not in kept for e, image in images)


def _operations(expression: sp.Expr, moving: Collection[sp.Symbol]) -> set[sp.Basic]:
    """Its powers and functions of what moves, and products of several things that do, without constant factors."""
    found: set[sp.Basic] = set()
    known: dict[sp.Basic, bool] = dict.fromkeys(moving, True)

    def moves(e: sp.Basic) -> bool:
        if e not in known:
            own = [a for a in e.args if moves(a)]
            known[e] = bool(own)
            if own and (e.is_Pow or e.is_Function):
                found.add(e)
            elif len(own) > 1 and e.is_Mul:
                found.add(e if len(own) == len(e.args) else sp.Mul(*own))
        return known[e]

    moves(expression)
    return found


def _core(expression: sp.Expr, moving: Collection[sp.Symbol]) -> sp.Expr:
    """An expression without the factors that are constant."""
    if not expression.is_Mul:
        return expression
    return sp.Mul(*(f for f in expression.args if not f.free_symbols.isdisjoint(moving)))
