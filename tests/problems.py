"""A problem from text, so that a test reads like the problem it checks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import sympy as sp

from henon_ref.model.equations import TIME
from henon_ref.model.system import FilippovSystem
from henon_ref.trajectory import Problem


def make_problem(
    states: str,
    field: Sequence[str],
    surfaces: Mapping[str, str],
    initial: Sequence[str | int | float],
    until: str | int,
    *,
    start: str | int = 0,
    mode: Mapping[int, int] | None = None,
    valid: Sequence[str] = (),
) -> Problem:
    """A problem from trusted text (tests only; case files go through the whitelist)."""
    names = {name: sp.Symbol(name, real=True) for name in [*states.split(), *surfaces]}
    names["t"] = TIME

    def expression(text: str | int | float) -> sp.Expr:
        return sp.sympify(str(text), locals=names, rational=True)

    system = FilippovSystem(
        states=tuple(names[s] for s in states.split()),
        signs=tuple(names[s] for s in surfaces),
        surfaces=tuple(expression(h) for h in surfaces.values()),
        field=tuple(expression(f) for f in field),
        valid=tuple(expression(v) for v in valid),
    )
    return Problem(system, expression(start), tuple(expression(v) for v in initial), expression(until), mode or {})
