"""Expressions as LaTeX, with the names that a reader expects: ``vp`` is v with the index p."""

from __future__ import annotations

import re
from functools import lru_cache

import sympy as sp

from henon_ref.text import spelled

_GREEK = (
    "alpha|beta|gamma|delta|epsilon|zeta|eta|theta|iota|kappa|lambda|mu|nu|xi|pi|rho|sigma|tau|upsilon|phi|chi|psi"
    "|omega|Gamma|Delta|Theta|Lambda|Xi|Pi|Sigma|Upsilon|Phi|Psi|Omega"
)
"""Letters that LaTeX has a command for: most capitals are Latin ones, and have none."""


def symbol(name: str) -> str:
    """LaTeX of a name: a letter, Latin or Greek, and what follows it as an index; a word stays a word.

    What stands behind an underscore is set upright, so that the state ``v_b`` is not the parameter ``vb``.

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
