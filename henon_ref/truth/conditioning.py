"""Conditioning of a transition: how far an error made earlier moves it.

The conditioning of transition i is::

    c_i = max over j of || d t_i / d x(t_j+) ||_2      [s per unit of state]

where t_j runs over the start and every earlier instant at which modes change, and x(t_j+) is the state just
after it. An error of size e in the state at any of these instants moves t_i by up to about c_i e. With the
flow's derivative Phi and, at each event k with guard g (which falls through zero), the saltation matrix::

    S_k = I + (f+ - f-) grad(g)^T / g',        g' = dg/dt + grad(g) . f-

the derivative is ``-grad(g_i)^T / g_i' . Phi_i S_{i-1} Phi_{i-1} ... S_{j+1} Phi_{j+1} P_j``. P_j projects onto
the surfaces that slide after t_j: an error that leaves a surface which holds the state is none. Landing on a
surface makes S rank-deficient; so conditioning falls at every stick. Saltation: Aizerman and Gantmakher
(1958); Leine and Nijmeijer, *Dynamics and Bifurcations of Non-Smooth Mechanical Systems* (2004), Sec. 7.5.

Where several surfaces change at one instant their saltations are applied in the order of the surfaces, through
the modes in between; the flow is then not differentiable, and the number is one of several one-sided ones.
Where a guard touches zero without falling through it (graze), the time depends on the state like a square
root: the conditioning is infinite, and the touch passes errors on unchanged.

Double precision is enough here: the numbers are wanted to a few digits. The points are those of the truth.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf
from typing import Any

import heyoka as hy
import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.filippov.equations import Guard
from henon_ref.filippov.modes import Mode, replaced
from henon_ref.filippov.problem import Problem
from henon_ref.filippov.system import FilippovSystem
from henon_ref.taylor.tape import TIME
from henon_ref.truth.multiprecision.heyoka import double_constants, to_heyoka
from henon_ref.truth.reference import ReferenceTransition, instants

Vector = NDArray[np.float64]

TOLERANCE = 1e-12
AT_ONCE = 1e-9
"""A guard within this part of a mode's length of its root counts as fallen."""


def conditioning(problem: Problem, transitions: Sequence[ReferenceTransition]) -> list[float]:
    """Conditioning of every transition.

    Parameters
    ----------
    problem : Problem
    transitions : sequence of ReferenceTransition
        All of them, from the start on.

    Returns
    -------
    list of float
        c_i [s / unit of state]; ``inf`` for a touch.
    """
    transitions = tuple(transitions)
    flow = _Variations(problem.system)
    n = len(problem.initial)
    time, state = float(problem.start), np.array([float(v) for v in problem.initial])
    mode = transitions[0].from_mode if transitions else ()
    spread = np.eye(n)[None]  # d x(now) / d x(t_j+), one matrix for each j so far
    spread = spread @ flow.projector(mode, time, state) if transitions else spread
    found: list[float] = []
    for group in instants(transitions):
        first = transitions[group[0]]
        length = first.time - time
        spread = flow.derivative(mode, time, state, first.time) @ spread
        time, state = first.time, np.array([float(v) for v in first.state])
        falls = _fallen_guards(flow, mode, first.to_mode, [transitions[i].surface for i in group], time, state, length)
        for i in group:
            own = [f for f in falls if f[0].index == transitions[i].surface] or falls
            rows = [-gradient / rate for _, gradient, rate in own if rate]
            touch = transitions[i].kind == "graze" or not rows
            found.append(inf if touch else max(float(np.linalg.norm(row @ spread, axis=-1).max()) for row in rows))
        spread = flow.saltation(mode, first.to_mode, falls, time, state) @ spread
        mode = first.to_mode
        spread = np.concatenate([spread, flow.projector(mode, time, state)[None]])
    return [float(f"{c:.4g}") if np.isfinite(c) else inf for c in found]


Fall = tuple[Guard, Vector, float]
"""(guard, its gradient, its rate along the field before); rate 0 for a touch."""


def _fallen_guards(
    flow: _Variations, mode: Mode, after: Mode, surfaces: Sequence[int], time: float, state: Vector, length: float
) -> list[Fall]:
    """The guards that end a mode: of those that could, the ones at their root."""
    candidates: list[tuple[float, Fall]] = []
    for guard, value, gradient, rate in flow.guards(mode, time, state):
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
        self._flows: dict[frozenset[int], tuple[Any, list[int]]] = {}
        self._functions: dict[Mode, Callable[..., Any]] = {}

    def derivative(self, mode: Mode, begin: float, state: Vector, end: float) -> Vector:
        """Phi: derivative of the state at ``end`` with respect to the state at ``begin``, both within a mode."""
        n = len(state)
        if not end > begin:
            return np.eye(n)
        integrator, signs = self._flow(frozenset(i for i, s in enumerate(mode) if s == 0))
        integrator.pars[:] = [float(mode[i]) for i in signs]
        integrator.time = begin
        integrator.state[:n] = state
        integrator.state[n:] = np.eye(n).ravel()
        if integrator.propagate_until(end)[0] != hy.taylor_outcome.time_limit:
            return np.full((n, n), np.nan)  # a singularity close by: double precision cannot say
        return np.array(integrator.state[n:]).reshape(n, n)

    def guards(self, mode: Mode, time: float, state: Vector) -> list[tuple[Guard, float, Vector, float]]:
        """(guard, value, gradient, rate along the field) of every guard of a mode."""
        _, values, gradients, rates = self._at(mode, time, state)
        guards = self.system.equations(mode).guards
        return list(zip(guards, values, gradients, rates, strict=True))

    def saltation(self, before: Mode, after: Mode, falls: Sequence[Fall], time: float, state: Vector) -> Vector:
        """S, the product over the guards that fall at one instant (of one contact's several surfaces the first's)."""
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
                jump = self.field(following, time, state) - self.field(mode, time, state)
                total = (np.eye(len(state)) + np.outer(jump, gradient) / rate) @ total
            mode = following
        return total

    def field(self, mode: Mode, time: float, state: Vector) -> Vector:
        """x' in a mode."""
        return self._at(mode, time, state)[0]

    def projector(self, mode: Mode, time: float, state: Vector) -> Vector:
        """Onto the directions that keep the state on the surfaces that slide."""
        sliding = [i for i, s in enumerate(mode) if s == 0]
        if not sliding:
            return np.eye(len(state))
        normals = self._normals(time, state)[sliding]
        return np.eye(len(state)) - np.linalg.pinv(normals) @ normals

    def _normals(self, time: float, state: Vector) -> Vector:
        """Gradients of the surfaces, a row each."""
        key: Mode = ()
        if key not in self._functions:
            system = self.system
            rows = [[sp.diff(system.numeric(h), x) for x in system.states] for h in system.surfaces]
            self._functions[key] = sp.lambdify([TIME, *system.states], rows, np, cse=True)
        with np.errstate(all="ignore"):
            return np.array(self._functions[key](np.float64(time), *state), dtype=float)

    def _at(self, mode: Mode, time: float, state: Vector) -> tuple[Vector, Vector, Vector, Vector]:
        """Field, and the guards' values, gradients and rates."""
        if mode not in self._functions:
            system, equations = self.system, self.system.equations(mode)
            guards = [system.numeric(g.expression) for g in equations.guards]
            entries = [
                [system.numeric(f) for f in equations.field],
                guards,
                [[sp.diff(g, x) for x in system.states] for g in guards],
                [sp.diff(g, TIME) for g in guards],
            ]
            self._functions[mode] = sp.lambdify([TIME, *system.states], entries, np, cse=True)
        with np.errstate(all="ignore"):
            found = self._functions[mode](np.float64(time), *state)
        field, values, gradients, drift = (np.array(part, dtype=float) for part in found)
        gradients = gradients.reshape(len(values), len(state))
        return field, values, gradients, drift + gradients @ field

    def _flow(self, sliding: frozenset[int]) -> tuple[Any, list[int]]:
        """heyoka's integrator of the variational equations of all modes with these sliding surfaces."""
        if sliding not in self._flows:
            system = self.system
            field = [system.numeric(f) for f in system.shared_equations(sliding).field]
            used = set().union(*(f.free_symbols for f in field))
            signs = [i for i, s in enumerate(system.signs) if s in used]
            names = [f"y{i}" for i in range(len(field))]
            variables = hy.make_vars(*names) if len(names) > 1 else [hy.make_vars(*names)]
            symbols: dict[sp.Symbol, Any] = {TIME: hy.time, **dict(zip(system.states, variables, strict=True))}
            symbols.update((system.signs[i], hy.par[k]) for k, i in enumerate(signs))
            rhs = [to_heyoka(f, symbols, double_constants) for f in field]
            equations = hy.var_ode_sys(list(zip(variables, rhs, strict=True)), hy.var_args.vars, order=1)
            start = [0.0] * len(names)
            self._flows[sliding] = (
                hy.taylor_adaptive(equations, start, pars=[0.0] * len(signs), tol=TOLERANCE, compact_mode=True),
                signs,
            )
        return self._flows[sliding]
