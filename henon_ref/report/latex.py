"""Expressions as LaTeX, with the names that a reader expects: ``vp`` is v with the index p."""

from __future__ import annotations

import re
from functools import lru_cache

import sympy as sp

_GREEK = (
    "alpha|beta|gamma|delta|epsilon|zeta|eta|theta|iota|kappa|lambda|mu|nu|xi|pi|rho|sigma|tau|upsilon|phi|chi|psi"
    "|omega"
)


def symbol(name: str) -> str:
    """LaTeX of a name: a letter, Latin or Greek, and what follows it as an index; a word stays a word.

    Examples
    --------
    >>> symbol("x2"), symbol("vp"), symbol("mu0"), symbol("xi1"), symbol("q_1"), symbol("margin")
    ('x_{2}', 'v_{p}', '\\\\mu_{0}', '\\\\xi_{1}', 'q_{1}', '\\\\mathrm{margin}')
    """
    greek = re.fullmatch(rf"({_GREEK})(?:_?(\d\w*)|_(\w+))?", name, re.IGNORECASE)
    if greek:
        head, index = "\\" + greek[1], greek[2] or greek[3]
    else:
        latin = re.fullmatch(r"([A-Za-z])(_\w+|[A-Za-z]?\d*)", name)
        if latin is None:
            return rf"\mathrm{{{name}}}".replace("_", r"\_")
        head, index = latin[1], latin[2].lstrip("_")
    return f"{head}_{{{index}}}" if index else head


@lru_cache(maxsize=1024)
def latex(expression: sp.Expr) -> str:
    """LaTeX of an expression, begun with a term that has no minus where there is one.

    Examples
    --------
    >>> x, vp = sp.symbols("x vp")
    >>> latex(x - vp), latex(x - 2)
    ('x - v_{p}', 'x - 2')
    """
    names = {s: symbol(s.name) for s in expression.free_symbols}
    orders = [str(sp.latex(expression, symbol_names=names, order=order)) for order in (None, "old")]
    return next((text for text in orders if not text.startswith("-")), orders[0])
