"""What is linear in some symbols by its form alone: found in one walk over an expression, without a derivative."""

from __future__ import annotations

from collections.abc import Collection

import sympy as sp

from henon_ref.modes.algebra import MAX_DERIVED
from henon_ref.taylor.size import size
from henon_ref.taylor.tape import TIME


def coefficients(expression: sp.Expr, symbols: Collection[sp.Symbol]) -> dict[sp.Symbol, sp.Expr] | None:
    """Coefficients of the symbols that stand in an expression; None where it is not linear in all at once by its form.

    Examples
    --------
    >>> x, y, s, u = sp.symbols("x y s u")
    >>> coefficients(x - 2*s*(y + 1) + u, [s, u]) == {s: -2*(y + 1), u: 1}
    True
    >>> coefficients(s*u, [s, u]), coefficients(sp.sin(s), [s])
    (None, None)
    """
    wanted = set(symbols)
    found = _coefficients(expression, wanted) if expression.free_symbols & wanted else {}
    return None if found is None else {s: sp.Add(*terms) for s, terms in found.items()}


def _coefficients(expression: sp.Expr, wanted: set[sp.Symbol]) -> dict[sp.Symbol, list[sp.Expr]] | None:
    """Terms of the coefficients, of an expression that holds some of the symbols."""
    if expression in wanted:
        return {expression: [sp.S.One]}
    if not (expression.is_Add or expression.is_Mul):
        return None
    found: dict[sp.Symbol, list[sp.Expr]] = {}
    moving = [argument for argument in expression.args if argument.free_symbols & wanted]
    if expression.is_Mul and len(moving) > 1:
        return None
    for argument in moving:
        inner = _coefficients(argument, wanted)
        if inner is None:
            return None
        for symbol, terms in inner.items():
            if expression.is_Mul:
                others = [a for a in expression.args if a is not argument]
                terms = [sp.Mul(*others, sp.Add(*terms))]
            found.setdefault(symbol, []).extend(terms)
    return found


def constant_slope(surface: sp.Expr, state: sp.Symbol, states: Collection[sp.Symbol]) -> sp.Expr | None:
    """Factor of a state in which a surface is linear with a constant (neither t nor a state) factor; None elsewhere."""
    found = coefficients(surface, [state])
    if found is not None:
        slope = found.get(state)
    else:
        slope = sp.diff(surface, state) if size(surface, MAX_DERIVED) <= MAX_DERIVED else None
    return None if slope is None or slope == 0 or slope.free_symbols & {TIME, *states} else slope
