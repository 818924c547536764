"""Sections: surfaces that no field uses, added to a system so that they are located as exactly as any event."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import sympy as sp

from henon_ref.modes.algebra import signed_form
from henon_ref.simulation.system import System


class Section(NamedTuple):
    """Where an expression stands among the surfaces of a system."""

    surface: int
    orientation: int
    """+1 or -1: the sign of the expression is that of the surface's, times this."""


def with_sections(system: System, expressions: Sequence[sp.Expr]) -> tuple[System, dict[sp.Expr, Section]]:
    """A system that has some expressions among its surfaces, and where each stands.

    An expression that is a surface times a factor which always has one sign is that surface. Fields do not depend on
    the sign of one that is added: its normal velocity is the same on both sides, and it is always crossed.

    Parameters
    ----------
    system : System
    expressions : sequence of Expr
        In time, states and parameters.
    """
    model = system.model
    added: dict[sp.Symbol, sp.Expr] = {}
    known: dict[object, tuple[int, int]] = {}
    for index, surface in enumerate(model.surfaces):
        form, way = signed_form(surface, model.parameters)
        known.setdefault(form, (index, way))
    found: dict[sp.Expr, Section] = {}
    for expression in expressions:
        if expression in found:
            continue
        form, way = signed_form(expression, model.parameters)
        if form not in known:
            known[form] = len(model.surfaces) + len(added), way
            added[sp.Symbol(f"section {len(added) + 1}", real=True)] = expression  # no name has a blank
        index, own = known[form]
        found[expression] = Section(index, way * own)
    return (system.with_surfaces(added) if added else system), found
