"""Problems from short text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import sympy as sp

from henon_ref.casefile.case import parse_case
from henon_ref.modes.problem import Problem
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.tape import TIME


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


HEAD = "schema: 1\nname: made_up\ntitle: Made up\n"
"""What a case file begins with."""


def read_problem(text: str) -> Problem:
    """The problem of a case file, without its head."""
    return parse_case(HEAD + text, file="case.yaml").readings[0].problem


LEAVING_SLIDE = """
schema: 1
name: leaving_slide
title: Leaving a slide
system:
  state: [x]
  surfaces: {s: "x"}
  field: ["t - s"]
initial: {x: 0}
until: 3
exact: {transition_times: ["1"]}
"""
"""A case file with a closed form."""
