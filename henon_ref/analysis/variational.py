"""Variational equations of a Filippov system: tangent vectors carried through slip, stick and every transition.

Inside a mode a tangent vector v obeys ``v' = (df/dx) v`` with the field of that mode; in sliding that is the
sliding field, so v stays tangent to the surface. At a transition the state is continuous but f jumps, and v
is multiplied by the saltation matrix

    S = I + (f_after - f_before) (grad g)^T / (grad g . f_before + dg/dt),

g being the function whose zero ends the mode: the surface h for a crossing or a stick, and for an overridden
sliding the function that releases it. A Filippov release is continuous in f, so S = I. Where the mode after
slides, ``(grad h)^T S = 0``: one direction of perturbations is lost for good, and one Lyapunov exponent is
-infinity. See Leine and Nijmeijer, *Dynamics and Bifurcations of Non-Smooth Mechanical Systems* (2004),
Ch. 7, and di Bernardo et al., *Piecewise-smooth Dynamical Systems* (2008), Sec. 2.5.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.errors import UnsupportedError
from henon_ref.filippov.equations import Guard, ModeEquations
from henon_ref.filippov.exact_numbers import double_double
from henon_ref.filippov.modes import Mode
from henon_ref.filippov.problem import Problem
from henon_ref.filippov.system import FilippovSystem
from henon_ref.henon.integrator import Integrator
from henon_ref.henon.records import HENON
from henon_ref.henon.run import Run
from henon_ref.henon.solver import order_for
from henon_ref.taylor.tape import TIME
from henon_ref.trajectory import Trajectory, Transition

Matrix = NDArray[np.float64]
_Function = Callable[..., list[float]]


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


class Saltation:
    """Saltation matrices of one system in double precision.

    Parameters
    ----------
    system : FilippovSystem
        The system itself, without tangent vectors.
    """

    def __init__(self, system: FilippovSystem) -> None:
        self.system = system
        self._fields: dict[Mode, _Function] = {}
        self._guards: dict[sp.Expr, _Function] = {}

    def matrix(self, transition: Transition) -> Matrix:
        """The saltation matrix of a transition, shape (n, n).

        A touch (``graze``) is given the identity: the limit from the side that misses the surface. From the
        other side the flow is not differentiable there.

        Raises
        ------
        UnsupportedError
            Where several surfaces change at one instant: the flow has no derivative there, only one a
            direction.
        """
        before, after = transition.from_mode, transition.to_mode
        changed = [i for i, (a, b) in enumerate(zip(before, after, strict=True)) if a != b]
        if len(changed) > 1:
            raise UnsupportedError(
                f"{len(changed)} surfaces change at t = {transition.time:.17g}: the flow has no saltation matrix there"
            )
        identity = np.eye(len(self.system.states))
        if not changed or self._continuous(transition):
            return identity
        t, x = transition.time, transition.state
        f_before = np.array(self._field(before)(t, *x))
        f_after = np.array(self._field(after)(t, *x))
        _, rate, *gradient = self._guard(self._reached(transition))(t, *x)
        normal = np.array(gradient)
        return identity + np.outer(f_after - f_before, normal) / (normal @ f_before + rate)

    def _continuous(self, transition: Transition) -> bool:
        """A Filippov release: the equivalent sign reaches +-1, where the sliding field is the field beyond."""
        return transition.kind == "release" and transition.surface not in self.system.overrides

    def _reached(self, transition: Transition) -> sp.Expr:
        """The function that fell to zero."""
        index = transition.surface
        if transition.kind != "release":
            return self.system.surfaces[index]
        ways: list[Guard] = [
            g
            for g in self.system.equations(transition.from_mode).guards
            if g.kind == "release" and g.index == index and g.to_sign == transition.to_mode[index]
        ]
        return min((g.expression for g in ways), key=lambda e: abs(self._relative(e, transition)))

    def _relative(self, expression: sp.Expr, transition: Transition) -> float:
        value, rate, *gradient = self._guard(expression)(transition.time, *transition.state)
        return value / (abs(rate) + sum(map(abs, gradient)) + 1e-300)

    def _field(self, mode: Mode) -> _Function:
        if mode not in self._fields:
            self._fields[mode] = self._lambdified(list(self.system.equations(mode).field))
        return self._fields[mode]

    def _guard(self, g: sp.Expr) -> _Function:
        """Value, rate of change in time, gradient."""
        if g not in self._guards:
            self._guards[g] = self._lambdified([g, sp.diff(g, TIME), *(sp.diff(g, x) for x in self.system.states)])
        return self._guards[g]

    def _lambdified(self, expressions: list[sp.Expr]) -> _Function:
        numeric = [self.system.numeric(e) for e in expressions]
        return cast(_Function, sp.lambdify([TIME, *self.system.states], numeric, "math", cse=True))


@dataclass(frozen=True)
class TangentTransition:
    """A transition that tangent vectors were carried through."""

    transition: Transition
    saltation: Matrix
    """S, shape (n, n)."""
    sliding: int
    """Surfaces that the state slides on afterwards: no more than n - sliding directions are left."""


class TangentFlow:
    """A trajectory and tangent vectors along it.

    Parameters
    ----------
    problem : Problem
    columns : int, optional
        Number p of tangent vectors; n if left out, starting as the identity.
    tolerance : float
        Local error of a step, of states and tangent vectors alike, each relative to its own size.

    Raises
    ------
    UnsupportedError
        Where the state jumps.
    """

    def __init__(self, problem: Problem, *, columns: int | None = None, tolerance: float) -> None:
        if problem.system.resets:
            raise UnsupportedError("tangent vectors are not carried through jumps of the state yet")
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
        self._run.blocks.clear()  # transitions handed out already
        event = self._run.next_event()
        if isinstance(event, Trajectory):
            return event
        transition = replace(event, state=event.state[: self._n])
        matrix = self._saltation.matrix(transition)
        self.vectors = matrix @ self.vectors
        return TangentTransition(transition, matrix, sum(s == 0 for s in transition.to_mode))


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
        rank = n - sum(s == 0 for s in flow.mode)
        while isinstance(event := flow.advance(stage), TangentTransition):
            rank = min(rank, n - event.sliding)
        if event.status != "ok":
            raise UnsupportedError(f"no derivative up to t = {float(stage):.17g}: {event.reason}")
    return flow.vectors, rank
