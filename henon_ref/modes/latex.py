"""Expressions and short systems as LaTeX, with conventional names: ``vp`` is v with index p."""

from __future__ import annotations

import html
import re
from collections.abc import Sequence
from functools import lru_cache

import sympy as sp

from henon_ref.expressions.traversal import size
from henon_ref.modes.switched_field import SwitchedField
from henon_ref.text import spelled

MOST_OPERATIONS, MOST_IN_ALL = 500, 2_500
"""Largest number of operations of one expression, and of all, set as formulas: SymPy's printer is slow on long ones."""

MOST_IN_CELL = 200
"""Largest number of operations of an expression shown in a table or in a line."""

MOST_MODES = 9
"""Largest number of modes whose equations are printed."""

TOO_LONG = "too long to be printed"

_GREEK = (
    "alpha|beta|gamma|delta|epsilon|zeta|eta|theta|iota|kappa|lambda|mu|nu|xi|pi|rho|sigma|tau|upsilon|phi|chi|psi"
    "|omega|Gamma|Delta|Theta|Lambda|Xi|Pi|Sigma|Upsilon|Phi|Psi|Omega"
)
"""Letters with a LaTeX command; most capitals look like Latin letters and have none."""


def symbol(name: str) -> str:
    """LaTeX of a name: a Latin or Greek letter, with the rest as an index; a word stays a word.

    An index after an underscore is set upright, so that the state ``v_b`` is not the parameter ``vb``.

    Examples
    --------
    >>> symbol("x2"), symbol("vp"), symbol("mu0"), symbol("xi1"), symbol("q_1"), symbol("margin")
    ('x_{2}', 'v_{p}', '\\\\mu_{0}', '\\\\xi_{1}', 'q_{1}', '\\\\mathrm{margin}')
    >>> symbol("θ"), symbol("μ_k")
    ('\\\\theta', '\\\\mu_{\\\\mathrm{k}}')
    >>> symbol("s_a_belt"), symbol("Delta_x_1"), symbol("a__b"), symbol("Alpha")
    ('s_{\\\\mathrm{a,belt}}', '\\\\Delta_{\\\\mathrm{x,1}}', '\\\\mathrm{a\\\\_\\\\_b}', '\\\\mathrm{Alpha}')
    """
    head, *indices = spelled(name).split("_")
    greek = re.fullmatch(rf"({_GREEK})(\d\w*)?", head)
    latin = re.fullmatch(r"([A-Za-z])([A-Za-z]?\d*)" if not indices else r"([A-Za-z])()", head)
    found = greek or latin
    if found is None or not all(indices) or (found[2] and indices):
        return rf"\mathrm{{{name}}}".replace("_", r"\_")
    letter = f"\\{found[1]}" if greek else found[1]
    index = ",".join(indices)
    upright = rf"\mathrm{{{index}}}" if re.search("[A-Za-z]", index) else index
    return letter + (f"_{{{found[2] or upright}}}" if found[2] or index else "")


@lru_cache(maxsize=1024)
def latex(expression: sp.Expr) -> str:
    """LaTeX of an expression, starting with a term without a minus sign if there is one.

    Examples
    --------
    >>> x, vp = sp.symbols("x vp")
    >>> latex(x - vp), latex(x - 2)
    ('x - v_{p}', 'x - 2')
    """
    names = {s: symbol(s.name) for s in expression.free_symbols}
    orders = [str(sp.latex(expression, symbol_names=names, order=order)) for order in (None, "old")]
    return next((text for text in orders if not text.startswith("-")), orders[0])


def general_form(system: SwitchedField) -> str:
    """LaTeX of the field with its sign symbols, and of the surfaces; expressions that are too long are left out."""
    lines = [derivative(x, f) for x, f in zip(system.states, system.field, strict=True) if printable(f)]
    for sign, surface in zip(system.signs, system.surfaces, strict=True):
        if printable(surface):
            lines.append(rf"{symbol(sign.name)} &= \operatorname{{sgn}}\left({latex(surface)}\right)")
    return aligned(lines) if lines and few([*system.field, *system.surfaces]) else ""


def short(expression: sp.Expr) -> str:
    text = str(expression) if size(expression, MOST_IN_CELL) <= MOST_IN_CELL else "..."
    return text if len(text) <= 40 else text[:37] + "..."


def table_html(system: SwitchedField) -> str:
    """Table of a system for a notebook: rates, surfaces and parameters, with short expressions as formulas."""

    def cell(expression: sp.Expr) -> str:
        return (
            f"${html.escape(latex(expression))}$"
            if size(expression, MOST_IN_CELL) <= MOST_IN_CELL
            else "<code>...</code>"
        )

    rows = [(rf"\dot{{{latex(x)}}}", f) for x, f in zip(system.states, system.field, strict=True)]
    rows += [(rf"{latex(s)} = \mathrm{{sign}}", h) for s, h in zip(system.signs, system.surfaces, strict=True)]
    rows += [(latex(p), value) for p, value in system.parameters.items()]
    body = "".join(f"<tr><td>${left}$</td><td>{cell(right)}</td></tr>" for left, right in rows)
    return f"<table><caption>Filippov system</caption><tbody>{body}</tbody></table>"


def printable(expression: sp.Expr) -> bool:
    return size(expression, MOST_OPERATIONS) <= MOST_OPERATIONS


def few(expressions: Sequence[sp.Expr]) -> bool:
    """Check whether expressions together are short enough to be printed."""
    return size((e for e in expressions if printable(e)), MOST_IN_ALL) <= MOST_IN_ALL


def derivative(state: sp.Symbol, rate: sp.Expr) -> str:
    """Line of :func:`aligned` with a state's rate."""
    return rf"\dot{{{symbol(state.name)}}} &= {latex(rate)}"


def aligned(lines: Sequence[str]) -> str:
    """Equations below each other, aligned at ``&=``."""
    return "\\begin{aligned}\n" + " \\\\\n".join(lines) + "\n\\end{aligned}"
