"""A system as formulas in LaTeX, where it is short enough for a printer."""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp

from henon_ref.filippov.latex import latex, symbol
from henon_ref.filippov.switched_field import SwitchedField
from henon_ref.taylor.size import size, total_size

MOST_OPERATIONS, MOST_IN_ALL = 500, 2_500
"""Operations up to which an expression, and all that stand together, are set as formulas: a printer sorts their terms,
and asks of each many questions."""


def general_form(system: SwitchedField) -> str:
    """The field with its sign symbols, and the surfaces, as LaTeX; without those that are too long for it."""
    lines = [derivative(x, f) for x, f in zip(system.states, system.field, strict=True) if printable(f)]
    for sign, surface in zip(system.signs, system.surfaces, strict=True):
        if printable(surface):
            lines.append(rf"{symbol(sign.name)} &= \operatorname{{sgn}}\left({latex(surface)}\right)")
    return aligned(lines) if lines and few([*system.field, *system.surfaces]) else ""


def printable(expression: sp.Expr) -> bool:
    """Whether an expression is short enough to be set as a formula."""
    return size(expression, MOST_OPERATIONS) <= MOST_OPERATIONS


def few(expressions: Sequence[sp.Expr]) -> bool:
    """Whether expressions have few enough operations, all together, to be printed."""
    return total_size((e for e in expressions if printable(e)), MOST_IN_ALL) <= MOST_IN_ALL


def derivative(state: sp.Symbol, rate: sp.Expr) -> str:
    """A line of :func:`aligned`: a state's rate."""
    return rf"\dot{{{symbol(state.name)}}} &= {latex(rate)}"


def aligned(lines: Sequence[str]) -> str:
    """Equations below each other, at their ``&=``."""
    return "\\begin{aligned}\n" + " \\\\\n".join(lines) + "\n\\end{aligned}"
