"""Variational equations of a Filippov system: tangent vectors carried through slip, stick and every transition.

Inside a mode a tangent vector v obeys ``v' = (df/dx) v`` with the field of that mode; in sliding that is the
sliding field, so v stays tangent to the surface. At a transition the state is continuous but f jumps, and v
is multiplied by the saltation matrix

    S = I + (f_after - f_before) (grad g)^T / (grad g . f_before + dg/dt),

g being the function whose zero ends the mode: the surface h for a crossing or a stick, and for an overridden
sliding the function that releases it. Where the state jumps, x -> R(t, x), it is

    S = dR/dx + (f_after - (dR/dx) f_before - dR/dt) (grad g)^T / (grad g . f_before + dg/dt),

f_after being at the state after, in the mode that follows (at rest, where the impact takes all speed), all else before.
 A Filippov release is continuous in f, so S = I. Where the mode after
slides, ``(grad h)^T S = 0``: one direction of perturbations is lost for good, and one Lyapunov exponent is
-infinity. See Leine and Nijmeijer, *Dynamics and Bifurcations of Non-Smooth Mechanical Systems* (2004),
Ch. 7, and di Bernardo et al., *Piecewise-smooth Dynamical Systems* (2008), Sec. 2.5.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import cast

import numpy as np
import sympy as sp

from henon_ref.analysis.saltation import Matrix, Saltation
from henon_ref.errors import UnsupportedError
from henon_ref.filippov.equations import ModeEquations
from henon_ref.filippov.exact_numbers import double_double
from henon_ref.filippov.modes import Mode
from henon_ref.filippov.problem import Problem
from henon_ref.filippov.switched_field import SwitchedField
from henon_ref.filippov.system import FilippovSystem
from henon_ref.henon.integrator import Integrator
from henon_ref.henon.records import HENON
from henon_ref.henon.run import Run
from henon_ref.henon.solver import order_for
from henon_ref.trajectory import Trajectory, Transition

SINGULAR = 1e-13
"""A jump whose derivative has a singular value this small, relative to the largest, takes a direction away."""


@dataclass(frozen=True, eq=False)
class AugmentedSystem(FilippovSystem):
    """A system together with tangent vectors: ``(x, V)' = (f, (df/dx) V)``, mode by mode.

    Surfaces, guards and equivalent signs are those of the base: perturbations do not move transitions. The
    sliding part is the derivative of the base's own sliding field, not a sliding field of the pair.
    """

    base: FilippovSystem | None = None
    """The system itself; its states come first."""
    columns: int = 0
    """Number p of tangent vectors; V is (n, p), row-major after the states."""

    @classmethod
    def of(cls, base: FilippovSystem, columns: int) -> AugmentedSystem:
        """A system with ``columns`` tangent vectors beside it."""
        taken = {symbol.name for symbol in (*base.states, *base.signs, *base.parameters)}
        prefix = "v"
        while any(name.startswith(prefix + "_") for name in taken):
            prefix += "v"
        vectors = tuple(
            sp.Symbol(f"{prefix}_{i}_{j}", real=True) for i in range(len(base.states)) for j in range(columns)
        )
        return cls(
            states=base.states + vectors,
            signs=base.signs,
            surfaces=base.surfaces,
            field=_with_tangents(base.field, base.states, vectors),
            parameters=base.parameters,
            valid=base.valid,
            overrides=base.overrides,
            resets=base.resets,
            effects=base.effects,
            base=base,
            columns=columns,
        )

    def shared_equations(self, sliding: frozenset[int]) -> ModeEquations:
        """See :meth:`FilippovSystem.shared_equations`."""
        key = ("shared", sliding)
        if key not in self._cache:
            base = cast(FilippovSystem, self.base)
            equations = base.shared_equations(sliding)
            n = len(base.states)
            field = _with_tangents(equations.field, base.states, self.states[n:])
            self._cache[key] = replace(equations, field=field)
        return self._cache[key]

    def with_reactions(self, resting: frozenset[int]) -> SwitchedField:
        """See :meth:`FilippovSystem.with_reactions`: of the base, whose contacts these are."""
        return cast(FilippovSystem, self.base).with_reactions(resting)


def _with_tangents(
    field: tuple[sp.Expr, ...], states: tuple[sp.Symbol, ...], vectors: tuple[sp.Symbol, ...]
) -> tuple[sp.Expr, ...]:
    """A field, then (df/dx) V row by row."""
    columns = len(vectors) // len(states)
    rows: list[sp.Expr] = list(field)
    for f in field:
        gradient = [(k, slope) for k, x in enumerate(states) if (slope := sp.diff(f, x)) != 0]
        rows += [sp.Add(*(slope * vectors[k * columns + j] for k, slope in gradient)) for j in range(columns)]
    return tuple(rows)


@dataclass(frozen=True)
class TangentTransition:
    """A transition that tangent vectors were carried through."""

    transition: Transition
    saltation: Matrix
    """S, shape (n, n)."""
    sliding: int
    """Directions that are lost: to surfaces that the state is on, two to each that a body rests on, or to the jump."""


def lost(system: FilippovSystem, mode: Mode) -> int:
    """Directions of perturbations lost in a mode: one to a surface slid on, two to one that a body rests on."""
    return sum(1 + system.rests(i) for i, entry in enumerate(mode) if entry == 0)


class TangentFlow:
    """A trajectory and tangent vectors along it.

    Parameters
    ----------
    problem : Problem
    columns : int, optional
        Number p of tangent vectors; n if left out, starting as the identity.
    tolerance : float
        Local error of a step, of states and tangent vectors alike, each relative to its own size.

    """

    def __init__(self, problem: Problem, *, columns: int | None = None, tolerance: float) -> None:
        self._system = problem.system
        n = len(problem.system.states)
        p = n if columns is None else columns
        self._n, self._p = n, p
        self._saltation = Saltation(problem.system)
        self._integrator = Integrator(AugmentedSystem.of(problem.system, p), order_for(tolerance))
        vectors = tuple(sp.Integer(i == j) for i in range(n) for j in range(p))
        augmented = replace(problem, system=self._integrator.system, initial=problem.initial + vectors)
        start = self._integrator.start(augmented, tolerance=tolerance, landing=HENON)
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
    def lost(self) -> int:
        """Directions of perturbations that are lost in the present mode."""
        return lost(self._system, self.mode)

    @property
    def state(self) -> Matrix:
        """Present state, shape (n,): a copy."""
        return self._run.x[: self._n].copy()

    @property
    def vectors(self) -> Matrix:
        """Present tangent vectors, shape (n, p): a copy; assign to it to change them."""
        return self._run.x[self._n :].reshape(self._n, self._p).copy()

    @vectors.setter
    def vectors(self, vectors: Matrix) -> None:
        self._run.x[self._n :] = vectors.ravel()
        self._run.x_low[self._n :] = 0.0

    def advance(self, until: sp.Expr | float) -> TangentTransition | Trajectory:
        """Go to the next transition and through it, or to ``until`` if that comes first.

        Parameters
        ----------
        until : Expr or float
            [s]; exact numbers are kept to double-double.

        Returns
        -------
        TangentTransition
            Of the transition; the vectors are those just after it.
        Trajectory
            Where there was none before ``until`` (status ``ok``; go on with a later ``until``), or the run
            ended there.
        """
        self._run.until = (until, 0.0) if isinstance(until, float) else double_double(sp.sympify(until))
        event = self._run.next_event()
        if isinstance(event, Trajectory):
            return event
        transition, jumped = replace(event, state=event.state[: self._n]), self._run.last_jump()
        if jumped is None:
            matrix = self._saltation.matrix(transition)
        elif transition.time > jumped.time:
            raise UnsupportedError(f"impacts come to a limit after t = {jumped.time:.17g}: no derivative leads over it")
        else:
            own = jumped._replace(before=jumped.before[: self._n], after=jumped.after[: self._n])
            matrix = self._saltation.of_jump(own, self.mode)
        self.vectors = matrix @ self.vectors
        taken = 0 if jumped is None else self._n - int(np.linalg.matrix_rank(matrix, rtol=SINGULAR))
        return TangentTransition(transition, matrix, max(taken, self.lost))


def fundamental_matrix(problem: Problem, since: sp.Expr, until: sp.Expr, *, tolerance: float) -> tuple[Matrix, int]:
    """Derivative of the state at ``until`` by the state at ``since``, along a problem's solution.

    Parameters
    ----------
    problem : Problem
        Its own ``until`` is not used.
    since, until : Expr or float
        Times [s], problem.start <= since < until.
    tolerance : float

    Returns
    -------
    matrix : ndarray, shape (n, n)
    rank : int
        No more than this many directions are left; known from the sticks entered, not from digits.

    Raises
    ------
    UnsupportedError
        Where the solution ends before ``until``, or several surfaces change at one instant.
    """
    flow = TangentFlow(problem, tolerance=tolerance)
    rank = n = len(problem.system.states)
    for stage in (since, until):
        flow.vectors = np.eye(n)
        rank = n - lost(problem.system, flow.mode)
        while isinstance(event := flow.advance(stage), TangentTransition):
            rank = min(rank, n - event.sliding)
        if event.status != "ok":
            raise UnsupportedError(f"no derivative up to t = {float(stage):.17g}: {event.reason}")
    return flow.vectors, rank
