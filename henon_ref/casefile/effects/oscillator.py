"""The belt oscillator: one block on a belt, on springs to a support (Figs. 1 and 5 of the paper).

``x1' = x2``, ``m x2' = forces - friction``, with the sliding velocity ``x2 - belt`` as the surface.
"""

from __future__ import annotations

from collections.abc import Mapping

import sympy as sp

from henon_ref.casefile.effects.base import Contact


class Oscillator(Contact):
    """A belt oscillator under construction.

    Attributes
    ----------
    elongation : Expr
        Length change z of the springs; the position unless the support moves.
    force : Expr
        Sum of all forces but friction, along the belt.
    """

    def __init__(self, values: Mapping[str, sp.Expr]) -> None:
        self.position = sp.Symbol("x1", real=True)
        super().__init__(sp.Symbol("x2", real=True))
        self.mass = values["m"]
        self.elongation: sp.Expr = self.position
        self.force: sp.Expr = sp.Integer(0)

    @property
    def states(self) -> tuple[sp.Symbol, ...]:
        return (self.position, self.velocity)

    def field(self) -> tuple[sp.Expr, ...]:
        return (self.velocity, (self.force - self.friction) / self.mass)

    def stuck_field(self) -> tuple[sp.Expr, ...]:
        return (self.belt, self.belt_acceleration)

    def holding_load(self) -> sp.Expr:
        return self.force.xreplace({self.velocity: self.belt}) - self.mass * self.belt_acceleration
