"""Expressions and short systems as LaTeX, with conventional names (``vp``: v with index p), and as HTML."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import lru_cache
from html import escape

import sympy as sp

from henon_ref.expressions.traversal import is_longer
from henon_ref.grouping import grouped
from henon_ref.modes.problem import Problem
from henon_ref.modes.switched_field import SwitchedField
from henon_ref.text import html, listed, spelled

MOST_IN_ALL = 2_500
"""Largest number of operations of all expressions that are set as formulas: SymPy's printer is slow on long ones."""

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
    text = "..." if is_longer(expression, MOST_IN_CELL) else str(expression)
    return text if len(text) <= 40 else text[:37] + "..."


def table_html(system: SwitchedField) -> str:
    """Table of a system for a notebook: rates, surfaces and parameters, with short expressions as formulas."""

    def cell(expression: sp.Expr) -> str:
        return "<code>...</code>" if is_longer(expression, MOST_IN_CELL) else f"${escape(latex(expression))}$"

    rows = [(rf"\dot{{{latex(x)}}}", f) for x, f in zip(system.states, system.field, strict=True)]
    rows += [(rf"{latex(s)} = \mathrm{{sign}}", h) for s, h in zip(system.signs, system.surfaces, strict=True)]
    rows += [(latex(p), value) for p, value in system.parameters.items()]
    body = "".join(f"<tr><td>${left}$</td><td>{cell(right)}</td></tr>" for left, right in rows)
    return f"<table><caption>Filippov system</caption><tbody>{body}</tbody></table>"


def printable(expression: sp.Expr) -> bool:
    return not is_longer(expression, 500)


def few(expressions: Sequence[sp.Expr]) -> bool:
    """Check whether expressions together are short enough to be printed."""
    return not is_longer((e for e in expressions if printable(e)), MOST_IN_ALL)


def derivative(state: sp.Symbol, rate: sp.Expr) -> str:
    """Line of :func:`aligned` with a state's rate."""
    return rf"\dot{{{symbol(state.name)}}} &= {latex(rate)}"


def aligned(lines: Sequence[str]) -> str:
    """Equations below each other, aligned at ``&=``."""
    return "\\begin{aligned}\n" + " \\\\\n".join(lines) + "\n\\end{aligned}"


def case_html(name: str, title: str, problems: Mapping[str, Problem]) -> str:
    """Return a table of the readings' problems, followed by the equations; text of the case is escaped."""
    rows = [_row(reading, problem) for reading, problem in list(problems.items())[:12]]
    head = "".join(f"<th>{word}</th>" for word in ("reading", "states", "surfaces", "from t [s]", "to t [s]"))
    body = "".join(f"<tr>{''.join(f'<td>{html(cell)}</td>' for cell in row)}</tr>" for row in rows)
    table = f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
    more = f"<p>and {len(problems) - len(rows)} more readings</p>" if len(problems) > len(rows) else ""
    return f"<p><b>{html(name)}</b>: {html(title)}</p>{table}{more}{equations_html(problems)}"


def _row(reading: str, problem: Problem) -> tuple[str, ...]:
    states, signs = problem.system.state_names, problem.system.sign_names
    return reading, listed(states), listed(signs), f"{float(problem.start):g}", f"{float(problem.until):g}"


def equations_html(problems: Mapping[str, Problem]) -> str:
    """Return the equations of the readings as typeset formulas; equal systems are shown once."""
    systems = grouped(problems, lambda reading: general_form(problems[reading].system))
    shown = list(systems.items())[:3]
    parts = [
        (f"<p>{html(listed(readings, 6))}:</p>" if len(systems) > 1 else "")
        + (f"<div>$${escape(formula)}$$</div>" if formula else "<p>the equations are too long to be typeset</p>")
        for formula, readings in shown
    ]
    more = f"<p>and {len(systems) - len(shown)} more systems of equations</p>" if len(systems) > len(shown) else ""
    return "".join(parts) + more
