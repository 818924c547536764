"""Conditioning of a transition: how far an earlier error moves its time.

The conditioning of transition i is::

    c_i = max over j of || d t_i / d x(t_j+) ||_2      [s per unit of state]

where t_j runs over the start and every earlier instant at which modes change, and x(t_j+) is the state just after
t_j. An error of size e in the state at any of these instants moves t_i by up to about c_i e. With the flow's
derivative Phi and, at each event k with guard g (which falls through zero), the saltation matrix::

    S_k = I + (f+ - f-) grad(g)^T / g',        g' = dg/dt + grad(g) . f-

the derivative is ``-grad(g_i)^T / g_i' . Phi_i S_{i-1} Phi_{i-1} ... S_{j+1} Phi_{j+1} P_j``. P_j projects onto the
surfaces that slide after t_j: an error off them does not count, because sliding keeps the state on them. Landing on a
surface makes S rank-deficient, so conditioning decreases at every stick. Saltation: Aizerman and Gantmakher (1958);
Leine and Nijmeijer, *Dynamics and Bifurcations of Non-Smooth Mechanical Systems* (2004), Sec. 7.5.

If several surfaces change at one instant, their saltations are applied in the order of the surfaces, through the modes
in between. The flow is not differentiable then, and the conditioning is one of several one-sided values. If a guard
touches zero without falling through it (graze), the time depends on the state like a square root: the conditioning is
infinite, and the graze itself passes earlier errors on unchanged.

If the state jumps, x -> R(t, x), the saltation matrix is ``DR + (f+ - DR f- - dR/dt) grad(g)^T / g'``, with f+ at the
state after the jump and all other terms at the state before it.

Double precision is enough, because only a few digits of c_i are used. The points are those of the truth.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from math import inf
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.sparse import csr_array

from henon_ref.harness.truth.reference import ReferenceTransition, instants
from henon_ref.method_cache import cached_method
from henon_ref.modes.equations import Guard
from henon_ref.modes.mode import Mode, replaced
from henon_ref.modes.problem import Problem
from henon_ref.modes.resets import impact_of, jump_of, turning_in_flight
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.tape import TIME

Vector = NDArray[np.float64]

TOLERANCE = 1e-12
"""Tolerance of the variational equations, relative to the size of each component on the interval."""
AT_ONCE = 1e-9
"""A guard counts as fallen if its root is nearer than this part of the mode's duration."""


def conditioning(problem: Problem, transitions: Sequence[ReferenceTransition]) -> list[float]:
    """Compute the conditioning of every transition.

    Parameters
    ----------
    problem : Problem
    transitions : sequence of ReferenceTransition
        All of them, from the start on.

    Returns
    -------
    list of float
        c_i [s / unit of state]; ``inf`` for a graze.
    """
    transitions = tuple(transitions)
    flow, n = _Variations(problem.system), len(problem.initial)
    time, state = float(problem.start), np.array([float(v) for v in problem.initial])
    mode = transitions[0].from_mode if transitions else (1,) * len(problem.system.surfaces)
    found, repeated = np.zeros(len(transitions)), []
    intervals: list[tuple[list[tuple[int, Vector]], Vector, Vector]] = []
    """Rows d t_i / d x(begin+) of the transitions at an interval's end, d x(end+) / d x(begin+), and P(begin)."""
    for group in instants(transitions):
        first, projector = transitions[group[0]], flow.projector(mode, time, state)
        length = first.time - time
        landed = np.array([float(v) for v in first.state])
        resets = tuple(transitions[i].surface for i in group if transitions[i].kind == "reset")
        origin = time, state
        change, arrived = flow.derivative(mode, time, state, first.time, landed)
        time, state = first.time, arrived if resets else landed
        falls = _fallen_guards(flow, mode, first.to_mode, [transitions[i].surface for i in group], time, state, length)
        rests = [i for i in group if transitions[i].kind == "stick" and transitions[i].surface in problem.system.resets]
        rows: list[tuple[int, Vector]] = []
        for i in group:
            own = [f for f in falls if f[0].index == transitions[i].surface] or falls
            by_guards = [-gradient / rate @ change for _, gradient, rate in own if rate]
            if rests and not resets and not length > 0:  # an impact without rebound: the rest begins at once
                repeated.append(i)
            elif rests and not resets:
                rows.append((i, flow.time_of_rest(transitions[rests[0]].surface, mode, *origin)))
            elif transitions[i].kind == "graze" or not by_guards:
                found[i] = inf
            else:
                rows += [(i, row) for row in by_guards]
        if resets:
            saltation = flow.jump(mode, first.to_mode, resets, falls, time, state, landed)
        else:
            saltation = flow.saltation(mode, first.to_mode, falls, time, state)
        intervals.append((rows, saltation @ change, projector))
        mode, state = first.to_mode, landed
    later, owners = np.empty((0, n)), np.empty(0, dtype=np.intp)
    for rows, change, projector in reversed(intervals):
        later = np.vstack([later @ change, *(row for _, row in rows)])
        owners = np.append(owners, [i for i, _ in rows]).astype(np.intp)
        np.maximum.at(found, owners, np.linalg.norm(later @ projector, axis=1))
    for i in repeated:
        found[i] = found[i - 1]
    return [float(f"{c:.4g}") if np.isfinite(c) else inf for c in found.tolist()]


Fall = tuple[Guard, Vector, float]
"""(guard, its gradient, its rate along the field before the event); rate 0 for a graze."""


def _fallen_guards(
    flow: _Variations, mode: Mode, after: Mode, surfaces: Sequence[int], time: float, state: Vector, length: float
) -> list[Fall]:
    """The guards that end a mode: of the candidates, those at their root."""
    candidates: list[tuple[float, Fall]] = []
    _, values, gradients, rates = flow.at(mode, time, state)
    for guard, value, gradient, rate in zip(flow.system.equations(mode).guards, values, gradients, rates, strict=True):
        if guard.ends or guard.index not in surfaces:
            continue
        if guard.kind == "release" and guard.to_sign != after[guard.index]:
            continue
        away = abs(value / rate) if rate < 0 else inf
        candidates.append((away, (guard, gradient, rate if rate < 0 else 0.0)))
    nearest = min((away for away, _ in candidates), default=inf)
    limit = max(2 * nearest, AT_ONCE * length)
    return [fall for away, fall in candidates if away <= limit]


class _Variations:
    """Flow derivatives, guards and saltation matrices of one system in double precision."""

    def __init__(self, system: FilippovSystem) -> None:
        self.system = system
        self._shared = system.shared

    def derivative(self, mode: Mode, begin: float, state: Vector, end: float, landed: Vector) -> tuple[Vector, Vector]:
        """Phi, the derivative of the state at ``end`` by that at ``begin`` within a mode, and the state at ``end``.

        ``landed``: approximate state at ``end``, which scales the error tolerance.
        """
        n, length = len(state), end - begin
        if not length > 0:
            return np.eye(n), state
        (_, flow, jacobian), switches = self._functions(self._key(mode)), self._switches(mode)

        def rates(passed: float, values: Vector) -> Vector:
            field, entries = flow(np.float64(begin + passed), *values[:n], *switches)
            jacobian.data[:] = entries
            growth = jacobian @ values[n:].reshape(n, n)
            return np.concatenate([np.array(field, dtype=float), growth.ravel()])

        start = np.concatenate([state, np.eye(n).ravel()])
        with np.errstate(all="ignore"):
            size = np.max(np.abs([state, landed, rates(0.0, start)[:n] * length]), axis=0)
            size[~(size > 0)] = 1.0
            sizes = np.concatenate([size, np.divide.outer(size, size).ravel()])
            run = solve_ivp(rates, (0.0, length), start, "DOP853", rtol=TOLERANCE, atol=TOLERANCE * sizes)
        if run.status != 0:
            return np.full((n, n), np.nan), landed  # integration fails near a singularity: unknown
        return run.y[n:, -1].reshape(n, n), run.y[:n, -1]

    def saltation(self, before: Mode, after: Mode, falls: Sequence[Fall], time: float, state: Vector) -> Vector:
        """S, the product over the guards that fall at one instant (of several surfaces of one contact: the first)."""
        total = np.eye(len(state))
        mode = before
        multiples = self.system.multiples
        falls = [fall for fall in falls if fall[0].index not in multiples]
        for position, (guard, gradient, rate) in enumerate(falls):
            last = position == len(falls) - 1
            following = after if last else replaced(mode, guard.index, after[guard.index])
            for j, (i, _) in multiples.items():
                following = replaced(following, j, after[j]) if i == guard.index else following
            if rate and following != mode:
                jump = self.at(following, time, state)[0] - self.at(mode, time, state)[0]
                total = (np.eye(len(state)) + np.outer(jump, gradient) / rate) @ total
            mode = following
        return total

    def jump(
        self,
        before: Mode,
        after: Mode,
        surfaces: tuple[int, ...],
        falls: Sequence[Fall],
        time: float,
        state: Vector,
        landed: Vector,
    ) -> Vector:
        """S of a reset, with the states before it and after it (``landed``).

        If several guards fall at one instant, the first guard of a reset surface is used.
        """
        drift, matrix = self._map(surfaces, time, state)
        _, gradient, rate = next(fall for fall in falls if fall[0].index in surfaces)
        if not rate:
            return matrix
        change = self.at(after, time, landed)[0] - matrix @ self.at(before, time, state)[0] - drift
        return matrix + np.outer(change, gradient) / rate

    def time_of_rest(self, surface: int, mode: Mode, time: float, state: Vector) -> Vector:
        """Derivative of the time of the limit of impacts by the state just after the last impact, shape (n,).

        From height h and speed v the limit is ``v / a + s / b + r s (1 + 1/q) / (a (1 - q r))`` later, where -a and
        -b = -q^2 a are the accelerations on the way up and down (q = 1 if no friction force reverses), and
        s^2 = q^2 v^2 + 2 b h. At h = 0 the derivatives are ``(1 + q^2 r) / ((1 - q r) q v)`` by h and
        ``(1 + q) / ((1 - q r) q a)`` by v (:mod:`henon_ref.modes.resets`).
        """
        system, resting, jump = self.system, impact_of(self.system, surface), jump_of(self.system, surface)
        assert resting is not None  # the transition is a rest
        after = resting.speed.xreplace(dict(zip(system.states, jump.states, strict=True)))
        signs = system.entries(mode)
        turned = {system.signs[j]: -signs[system.signs[j]] for j in turning_in_flight(system, surface)}
        written = [resting.acceleration, resting.acceleration.xreplace(turned), -sp.cancel(after / resting.speed)]
        written += [
            resting.speed,
            *(sp.diff(e, x) for e in (system.surfaces[surface], resting.speed) for x in system.states),
        ]
        values = sp.lambdify([TIME, *system.states], [system.numeric(e).xreplace(signs) for e in written], np)
        rising, falling, ratio, speed, *slopes = (float(v) for v in values(time, *state))
        height, own = np.array(slopes).reshape(2, -1)
        q = (falling / rising) ** 0.5
        lost = q * (1 - q * ratio)
        return (1 + q * q * ratio) / (lost * speed) * height + (1 + q) / (lost * -rising) * own

    def _map(self, surfaces: tuple[int, ...], time: float, state: Vector) -> tuple[Vector, Vector]:
        """Derivatives of successive jumps by time, shape (n,), and by the state, shape (n, n)."""
        n = len(state)
        drift, matrix = np.zeros(n), np.eye(n)
        for surface in surfaces:
            after, found = (np.array(part, dtype=float) for part in self._jump(surface)(time, *state))
            drift, matrix, state = found[:, 1:] @ drift + found[:, 0], found[:, 1:] @ matrix, after
        return drift, matrix

    @cached_method
    def _jump(self, surface: int) -> Callable[..., Any]:
        """Function of (t, states): the state after a jump, and its derivatives by time and states."""
        values = [self.system.numeric(value) for value in jump_of(self.system, surface).states]
        slopes = [[sp.diff(value, x) for x in (TIME, *self.system.states)] for value in values]
        return sp.lambdify([TIME, *self.system.states], [values, slopes], np)

    def projector(self, mode: Mode, time: float, state: Vector) -> Vector:
        """Projection onto the directions that keep the state on the sliding surfaces."""
        sliding = [i for i, s in enumerate(mode) if s == 0]
        if not sliding:
            return np.eye(len(state))
        with np.errstate(all="ignore"):
            normals = np.array(self._surface_gradients(np.float64(time), *state), dtype=float)[sliding]
        return np.eye(len(state)) - np.linalg.pinv(normals) @ normals

    @cached_property
    def _surface_gradients(self) -> Callable[..., Any]:
        """Gradients of the surfaces, as rows."""
        system = self.system
        rows = [[sp.diff(system.numeric(h), x) for x in system.states] for h in system.surfaces]
        return sp.lambdify([TIME, *system.states], rows, np, cse=True)

    def at(self, mode: Mode, time: float, state: Vector) -> tuple[Vector, Vector, Vector, Vector]:
        """Field, and values, gradients and rates along the field of all guards."""
        with np.errstate(all="ignore"):
            found = self._functions(self._key(mode))[0](np.float64(time), *state, *self._switches(mode))
        field, values, gradients, drift = (np.array(part, dtype=float) for part in found)
        gradients = gradients.reshape(len(values), len(state))
        rates = drift + gradients @ field
        if self._shared is None:
            return field, values, gradients, rates
        rows = np.array(self._shared.rows(mode))
        return field, values[rows], gradients[rows], rates[rows]

    def _key(self, mode: Mode) -> Mode | None:
        """None if all modes share their equations."""
        return mode if self._shared is None else None

    @cached_method
    def _functions(self, key: Mode | None) -> tuple[Callable[..., Any], Callable[..., Any], csr_array]:
        """Functions of (t, states, switches) of a mode.

        The first gives the field, and values, gradients and derivatives by time of the guards; the second the field
        and the entries of its Jacobian, whose places are those of the third. Entries that are identically zero are
        left out: each body of a long chain acts on its neighbours alone.
        """
        system, states, symbols = self.system, self.system.states, [TIME, *self.system.states]
        if key is None:
            assert self._shared is not None
            written, ends = self._shared.field, self._shared.outputs
            symbols += list(self._shared.owner)
        else:
            equations = system.equations(key)
            written, ends = equations.field, tuple(g.expression for g in equations.guards)
        field, guards = [system.numeric(f) for f in written], [system.numeric(g) for g in ends]
        gradients = [[sp.diff(g, x) if g.has(x) else sp.S.Zero for x in states] for g in guards]
        entries = {(i, j): sp.diff(f, x) for i, f in enumerate(field) for j, x in enumerate(states) if f.has(x)}
        places = np.array(list(entries), dtype=np.intp).reshape(-1, 2).T
        return (
            sp.lambdify(symbols, [field, guards, gradients, [sp.diff(g, TIME) for g in guards]], np, cse=True),
            sp.lambdify(symbols, [field, list(entries.values())], np, cse=True),
            csr_array((np.ones(len(entries)), places), shape=(len(field), len(field))),
        )

    def _switches(self, mode: Mode) -> list[float]:
        """Values of the switches that select a mode in equations shared by all modes."""
        if self._shared is None:
            return []
        values = self._shared.values(mode)
        return [float(values[symbol]) for symbol in self._shared.owner]
