"""Variational equations of a Filippov system: tangent vectors through slip, stick and every transition.

Inside a mode a tangent vector v satisfies ``v' = (df/dx) v`` with the field of that mode; in sliding this is the
sliding field, so v stays tangent to the surface. At a transition the state is continuous but f jumps, and v is
multiplied by the saltation matrix

    S = I + (f_after - f_before) (grad g)^T / (grad g . f_before + dg/dt),

where g is the function whose zero ends the mode: the surface h for a crossing or a stick, and the release guard for an
overridden sliding. If the state jumps, x -> R(t, x), it is

    S = dR/dx + (f_after - (dR/dx) f_before - dR/dt) (grad g)^T / (grad g . f_before + dg/dt),

where f_after is taken at the state after the jump, in the next mode (at rest, if the impact takes all speed), and all
other terms before it. If impacts on h accumulate, their limit removes both h and h' (:meth:`Saltation.of_limit`). At a
Filippov release f is continuous, so S = I. If the next mode slides, (grad h)^T S is zero: one direction is lost for
good, and one Lyapunov exponent is -infinity. See Leine and Nijmeijer, *Dynamics and Bifurcations of Non-Smooth
Mechanical Systems* (2004), Ch. 7, and di Bernardo et al., *Piecewise-smooth Dynamical Systems* (2008), Sec. 2.5.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import cast

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.analysis.saltation import Matrix, Saltation, TangentSpace
from henon_ref.expressions.bounds import double_double
from henon_ref.integrator.integrator import Integrator, order_for
from henon_ref.integrator.run import Run
from henon_ref.method_cache import cached_method
from henon_ref.modes.equations import ModeEquations
from henon_ref.modes.mode import Mode
from henon_ref.modes.problem import Problem
from henon_ref.modes.switched_field import SwitchedField
from henon_ref.modes.system import FilippovSystem
from henon_ref.trajectory import Trajectory, Transition


@dataclass(frozen=True, eq=False)
class AugmentedSystem(FilippovSystem):
    """System with n tangent vectors and their volume: ``(x, V, w)' = (f, (df/dx) V, tr df/dx)``, mode by mode.

    Surfaces, guards and equivalent signs are those of the base: perturbations do not move transitions. The sliding
    field of V is the derivative of the base's sliding field, not a Filippov combination of the augmented fields; w is
    then the logarithm of volumes along the surface.
    """

    base: FilippovSystem | None = None
    """The system without tangent vectors; its states come first, then V (n, n), row-major, then w."""

    @classmethod
    def of(cls, base: FilippovSystem) -> AugmentedSystem:
        taken = {symbol.name for symbol in (*base.states, *base.signs, *base.parameters)}
        prefix = "v"
        while any(name.startswith(prefix + "_") for name in taken):
            prefix += "v"
        n = len(base.states)
        names = [f"{prefix}_{i}_{j}" for i in range(n) for j in range(n)] + [f"{prefix}_volume"]
        more = tuple(sp.Symbol(name, real=True) for name in names)
        none = (sp.S.Zero,) * len(more)  # loads do not act on tangent vectors
        overrides = {i: replace(own, push=own.push + none) if own.push else own for i, own in base.overrides.items()}
        return cls(
            states=base.states + more,
            signs=base.signs,
            surfaces=base.surfaces,
            field=_with_tangents(base, base.field, more[:-1], frozenset()),
            parameters=base.parameters,
            valid=base.valid,
            overrides=overrides,
            resets=base.resets,
            effects=base.effects,
            base=base,
        )

    @cached_property
    def switched(self) -> None:
        """None: a sliding contact of the base also changes the rates of the tangent vectors."""
        return None

    @cached_method
    def shared_equations(self, sliding: frozenset[int]) -> ModeEquations:
        """See :meth:`FilippovSystem.shared_equations`."""
        base = cast(FilippovSystem, self.base)
        equations = base.shared_equations(sliding)
        field = _with_tangents(base, equations.field, self.states[len(base.states) : -1], sliding)
        return replace(equations, field=field)

    def with_reactions(self, resting: frozenset[int]) -> SwitchedField:
        """See :meth:`FilippovSystem.with_reactions`; the contacts are those of the base."""
        return cast(FilippovSystem, self.base).with_reactions(resting)


def _with_tangents(
    base: FilippovSystem, field: tuple[sp.Expr, ...], vectors: tuple[sp.Symbol, ...], sliding: frozenset[int]
) -> tuple[sp.Expr, ...]:
    """Return a field, then (df/dx) V row by row, then the rate of the volume's logarithm."""
    n = len(base.states)
    rows: list[sp.Expr] = list(field)
    for f in field:
        gradient = [(k, slope) for k, x in enumerate(base.states) if (slope := sp.diff(f, x)) != 0]
        rows += [sp.Add(*(slope * vectors[k * n + j] for k, slope in gradient)) for j in range(n)]
    return (*rows, TangentSpace(base).divergence(field, sliding))


@dataclass(frozen=True)
class TangentTransition:
    """Transition reached by the tangent vectors."""

    transition: Transition
    saltation: Matrix
    """S, shape (n, n): factor of the tangent vectors."""
    begin: tuple[Mode, float, tuple[float, ...]]
    """Mode, time [s] and state just before it."""
    jumps: bool
    """Whether the state jumps, so that S may remove directions."""


class TangentFlow:
    """Trajectory with n tangent vectors, which start as the identity.

    ``tolerance``: local error of a step, of states and tangent vectors, each relative to its own size.
    """

    def __init__(self, problem: Problem, *, tolerance: float) -> None:
        self._n = n = len(problem.system.states)
        self._saltation = Saltation(problem.system)
        self.spaces = self._saltation.spaces
        self._integrator = Integrator(AugmentedSystem.of(problem.system), order_for(tolerance))
        more = (*(sp.Integer(i == j) for i in range(n) for j in range(n)), sp.Integer(0))
        augmented = replace(problem, system=self._integrator.system, initial=problem.initial + more)
        start = self._integrator.start(augmented, tolerance=tolerance)
        self.refused = start.refused
        self._run = Run(self._integrator, start, block=1)

    @property
    def time(self) -> float:
        """Present time [s]."""
        return self._run.time

    @property
    def mode(self) -> Mode:
        """Present mode."""
        return self._run.mode

    @property
    def state(self) -> Matrix:
        """Present state, shape (n,): a copy."""
        return self._run.x[: self._n].copy()

    @property
    def vectors(self) -> Matrix:
        """Present tangent vectors, shape (n, n): a copy. Assigned columns restart the volume; missing ones are zero."""
        return self._run.x[self._n : -1].reshape(self._n, self._n).copy()

    @vectors.setter
    def vectors(self, vectors: Matrix) -> None:
        filled = np.zeros((self._n, self._n))
        filled[:, : vectors.shape[1]] = vectors
        self._run.x[self._n :] = [*filled.ravel(), 0.0]
        self._run.x_low[self._n :] = 0.0

    @property
    def log_volume(self) -> float:
        """Divergence in the mode's tangent space, integrated since vectors were assigned."""
        return float(self._run.x[-1])

    def saved(self) -> NDArray[np.float64]:
        """Return the state of the run for :meth:`go_back`."""
        return self._run.state.copy()

    def go_back(self, saved: NDArray[np.float64]) -> None:
        self._run.go_back(saved)

    def advance(self, until: sp.Expr | float) -> TangentTransition | Trajectory:
        """Advance to the next transition, or to ``until`` [s] if that is earlier (exact numbers: to double-double).

        At a transition, state and mode are those just after it, the vectors those just before it. A trajectory is
        returned if no transition was before ``until`` (status ``ok``; a later one continues), or if the run ended.
        """
        self._run.until = (until, 0.0) if isinstance(until, float) else double_double(sp.sympify(until))
        event = self._run.next_event()
        if isinstance(event, Trajectory):
            return event
        transition, jumped = replace(event, state=event.state[: self._n]), self._run.last_jump()
        if jumped is None:
            begin = transition.from_mode, transition.time, transition.state
            return TangentTransition(transition, self._saltation.matrix(transition), begin, jumps=False)
        own = jumped._replace(before=jumped.before[: self._n], after=jumped.after[: self._n])
        rests = transition.time > own.time
        matrix = self._saltation.of_jump(own, transition.from_mode if rests else self.mode)
        if rests:
            matrix = self._saltation.of_limit(transition) @ matrix
        return TangentTransition(transition, matrix, (own.mode, own.time, own.before), jumps=True)
