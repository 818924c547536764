"""Sections: surfaces that no field uses, added to a system so that they are located as exactly as any event."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from typing import NamedTuple

import sympy as sp

from henon_ref.filippov.algebra import simplified
from henon_ref.filippov.switched_field import up_to_a_number
from henon_ref.simulation.system import System

DERIVED = ("structure", "content")
"""What a system works out of its model and keeps."""


class Section(NamedTuple):
    """Where an expression stands among the surfaces of a system."""

    surface: int
    orientation: int
    """+1 or -1: the sign of the expression is that of the surface's, times this."""


def with_sections(system: System, expressions: Sequence[sp.Expr]) -> tuple[System, dict[sp.Expr, Section]]:
    """A system that has some expressions among its surfaces, and where each stands.

    An expression that is a number times a surface is that surface. Fields do not depend on the sign of one that is
    added: its normal velocity is the same on both sides, and it is always crossed.

    Parameters
    ----------
    system : System
    expressions : sequence of Expr
        In time, states and parameters.
    """
    model = system.model
    surfaces, signs = list(model.surfaces), list(model.signs)
    found: dict[sp.Expr, Section] = {}
    for expression in expressions:
        if expression in found:
            continue
        known = next((s for i, h in enumerate(surfaces) if (s := _multiple(expression, h, i))), None)
        if known is None:
            known = Section(len(surfaces), 1)
            surfaces.append(expression)
            signs.append(sp.Symbol(f"section {len(surfaces) - len(model.surfaces)}", real=True))  # no name has a blank
        found[expression] = known
    if len(surfaces) == len(model.surfaces):
        return system, found
    other = copy(system)
    for name in DERIVED:
        vars(other).pop(name, None)
    other.model = replace(model, surfaces=tuple(surfaces), signs=tuple(signs))
    return other, found


def _multiple(expression: sp.Expr, surface: sp.Expr, index: int) -> Section | None:
    if expression.free_symbols != surface.free_symbols:
        return None
    (one, way), (other, back) = up_to_a_number(expression), up_to_a_number(surface)
    if one == other:
        return Section(index, way * back)
    ratio = simplified(expression / surface)  # but for long ones
    return Section(index, 1 if ratio > 0 else -1) if ratio.is_Rational else None
