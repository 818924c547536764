"""Branches of a field that a mode does not use: their operations are no part of the mode's equations.

Equations that several modes share hold the signs as symbols, and a branch that a mode does not use is multiplied by
zero there. Of a term that is linear in time and states that leaves nothing; of any other it need not: zero times the
root of a negative number, or times what has overflowed, is no number.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping

import sympy as sp

from henon_ref.modes.bounds import terms

MAX_TERMS = 1_000
"""Terms, multiplied out, of an argument that is looked at whether it is negative."""


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


def has_no_value(expression: sp.Expr, positive: Iterable[sp.Expr]) -> bool:
    """Whether an expression has no real value wherever some others are positive.

    So it is where the argument of a logarithm, or of a power that is not whole, is at most a negative multiple of one
    of them: ``sqrt(-2*x - 1)`` where x is positive.
    """
    arguments = [p.base for p in expression.atoms(sp.Pow) if p.exp.is_integer is not True and p.base.free_symbols]
    arguments += [logarithm.args[0] for logarithm in expression.atoms(sp.log)]
    known = list(positive) if arguments else []
    return any(_below_multiple(argument, other) for argument in arguments for other in known)


def _below_multiple(argument: sp.Expr, positive: sp.Expr) -> bool:
    """Whether an expression is a negative multiple of another one, or is below one by a number."""
    if max(terms(argument, MAX_TERMS), terms(positive, MAX_TERMS)) > MAX_TERMS:
        return False
    coefficients, own = (sp.expand(e).as_coefficients_dict() for e in (positive, argument))
    factor = next((-own[term] / c for term, c in coefficients.items() if term.free_symbols), sp.S.Zero)
    rest = sp.expand(argument + factor * positive)
    return bool(factor.is_positive and rest.is_number and not rest.is_positive)
