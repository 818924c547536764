"""The least and the largest value of an expression along a run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, ClassVar

import numpy as np
import sympy as sp

from henon_ref.errors import ArgumentError, ModelError
from henon_ref.filippov.algebra import measured
from henon_ref.filippov.equations import along
from henon_ref.henon.points import Keep
from henon_ref.simulation.system import System
from henon_ref.sweeps.observations import Observation
from henon_ref.sweeps.runs import Columns, Runs, Vector
from henon_ref.taylor.tape import TIME

MOST_SURFACES = 3
"""With more surfaces there are too many modes, each with a time derivative of its own."""


@dataclass(frozen=True)
class Extremes(Observation):
    """See :func:`henon_ref.sweeps.observe.extremes`.

    An extreme lies at an end of the time that is looked at, at a transition, or where the time derivative in the mode
    is zero: zeros of the derivatives in all modes are located, and the expression is evaluated at all of these.
    """

    of: str
    after: float | None = None
    name: str | None = None
    kind: ClassVar[str] = "extremes"

    def names(self, system: System) -> tuple[list[str], dict[str, list[str]]]:
        return [f"min_{self.name or self.of}", f"max_{self.name or self.of}"], {}

    def check(self, system: System) -> None:
        if len(system.model.surfaces) > MOST_SURFACES:
            raise ArgumentError(f"extremes are found of systems with {MOST_SURFACES} surfaces at most")
        if not self._expression(system).free_symbols & {TIME, *system.model.states}:
            raise ArgumentError(f"the extremes of {self.of[:60]!r}: it never changes, it holds no state and no t")

    def _expression(self, system: System) -> sp.Expr:
        return system.expression(self.of, f"the expression {self.of[:60]!r}")

    def sections(self, system: System) -> Sequence[sp.Expr]:
        model, expression = system.model, self._expression(system)
        found: dict[sp.Expr, None] = {}
        for mode in product((-1, 1, 0), repeat=len(model.surfaces)):
            try:
                field = model.equations(mode).field
            except ModelError:  # no mode slides like that
                continue
            numerator = _without_poles(along(expression, model.states, field), field)
            if numerator.free_symbols & {TIME, *model.states}:
                found[numerator] = None
        return [*found, *([] if self.after is None else [TIME - _exact(self.after)])]

    def kept(self, system: System) -> Keep:
        return Keep() if self.after is None else Keep(after=self.after)

    def columns(self, runs: Runs) -> Columns:
        after = -np.inf if self.after is None else self.after
        later = np.nonzero(runs.records["time"] >= after)[0]
        ends = runs.end_time >= after
        everyone = np.arange(len(runs))
        run = np.concatenate([runs.run[later], everyone[ends]])
        times = np.concatenate([runs.records["time"][later], runs.end_time[ends]])
        states = np.concatenate([runs.records["state"][later], runs.end_state[ends]])
        begins = np.nonzero(runs.start >= after)[0]
        run = np.concatenate([run, begins])
        times = np.concatenate([times, runs.start[begins]])
        states = np.concatenate([states, runs.start_state[begins]])
        values = evaluated(runs, self._expression(runs.system), run, times, states)
        name = self.name or self.of
        least, largest = np.full(len(runs), np.inf), np.full(len(runs), -np.inf)
        with np.errstate(invalid="ignore"):
            np.minimum.at(least, run, values)
            np.maximum.at(largest, run, values)
        nothing = np.isinf(least) & np.isinf(largest) & (least > largest)
        least[nothing] = largest[nothing] = np.nan
        return {f"min_{name}": least, f"max_{name}": largest}


def evaluated(runs: Runs, expression: sp.Expr, run: Any, times: Vector, states: Vector) -> Vector:
    """An expression in time, states and parameters at some points of some runs."""
    symbols = sorted(expression.free_symbols, key=lambda s: s.name)
    names = runs.system.state
    at: list[Vector] = []
    for symbol in symbols:
        if symbol == TIME:
            at.append(times)
        elif symbol.name in names:
            at.append(states[:, names.index(symbol.name)])
        else:
            at.append(runs.parameters[symbol.name][run])
    with np.errstate(all="ignore"):
        value = sp.lambdify(symbols, expression, "numpy")(*at)
    return np.broadcast_to(np.asarray(value, dtype=np.float64), times.shape)


def _without_poles(slope: sp.Expr, field: Sequence[sp.Expr]) -> sp.Expr:
    """What is zero where a slope is, without poles: they belong to no motion of that mode, but lie in those of others.

    A long slope keeps those of the expression that is looked at, and loses those of the field.
    """
    if measured(slope) is not None:
        return sp.fraction(sp.together(slope))[0]
    poles = {sp.fraction(rate)[1] for rate in field}
    return sp.Add(*(sp.Mul(term, *poles) for term in sp.Add.make_args(slope)))


def _exact(number: float) -> sp.Expr:
    return sp.Rational(str(number)) if np.isfinite(number) else sp.Float(number)
