"""The modes of a system as cached programs over balls."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import sympy as sp
from flint import arb

from henon_ref.enclosure.balls import enclose, proves_zero
from henon_ref.enclosure.enclosure import UndecidedError
from henon_ref.enclosure.tail_bounds import Program
from henon_ref.expressions.algebra import up_to_a_number
from henon_ref.method_cache import cached_method
from henon_ref.modes.equations import along, gradient
from henon_ref.modes.mode import Mode
from henon_ref.modes.resets import kept_zero, settled_state
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.tape import TIME, Tape, build_tape

MAX_VARIED = 15_000
"""Largest number of operations of a mode's variational equations; one step for 64 states takes minutes."""


@dataclass(frozen=True)
class Identities:
    """Expressions that are exactly zero at a point, solved for states if possible."""

    values: Mapping[sp.Symbol, sp.Expr]
    unsolved: tuple[sp.Expr, ...] = ()
    """Further expressions that are zero but not linear in a state."""

    @classmethod
    def of(cls, zeros: Sequence[sp.Expr], states: Sequence[sp.Symbol]) -> Identities:
        values: dict[sp.Symbol, sp.Expr] = {}
        unsolved: list[sp.Expr] = []
        for zero in zeros:
            zero = _substituted(zero, values)
            solved = settled_state(sp.expand(zero) if values else zero, states)
            values |= solved
            unsolved += [] if solved else [zero]
        return cls(values, tuple(unsolved))

    def vanishes(self, expression: sp.Expr) -> bool:
        """Check whether an expression is proven to be zero at the point."""
        rest = _substituted(expression, self.values)
        return proves_zero(rest) or any(
            proves_zero(rest - z) or proves_zero(rest + z) or _without_factor(rest) == _without_factor(z)
            for z in self.unsolved
        )


def _substituted(expression: sp.Expr, values: Mapping[sp.Symbol, sp.Expr]) -> sp.Expr:
    for _ in range(len(values)):
        expression = expression.xreplace(dict(values))
    return expression


def _without_factor(expression: sp.Expr) -> sp.Expr:
    """Drop a constant factor, by which a reaction and the acceleration that lifts its body differ."""
    return up_to_a_number(sp.expand(expression))[0]


SolvedState = tuple[int, sp.Expr, tuple[sp.Expr, ...]]
"""A surface written as ``x_k = value(t, other states)``: k, the value, and its derivatives by t and by every state."""


class ModeModel:
    """One mode: field and guards with exact numbers for the parameters, and the programs that expand them.

    ModelError if the mode has no equations; UndecidedError if the field of an override is not proven to keep its
    surface.
    """

    def __init__(self, system: FilippovSystem, mode: Mode) -> None:
        equations = system.equations(mode)
        self.mode = mode
        self.states = system.states
        self.field = tuple(system.numeric(e) for e in equations.field)
        self.guards = tuple(replace(g, expression=system.numeric(g.expression)) for g in equations.guards)

        for i in set(system.overrides) & {i for i, s in enumerate(mode) if s == 0}:
            kept = system.numeric(kept_zero(system, i)[-1])
            velocity = self.lie_derivative(kept)
            if not Identities.of([kept], self.states).vanishes(velocity):  # every proof in the stick assumes h = 0
                name = system.sign_names[i]
                reason = f"the 'sliding' field of {name} is not proven to keep its surface: dh/dt = {velocity}"
                raise UndecidedError(reason, "mode")

    @cached_property
    def flow(self) -> Program:
        """Program of the solution and of every guard along the solution."""
        return Program(self._tape)

    @cached_property
    def _tape(self) -> Tape:
        return build_tape(self.states, self.field, [g.expression for g in self.guards])

    @cached_property
    def tangent(self) -> Program:
        """Program of the solution, its variational equations, and the guards' derivatives.

        The states are x, followed by n + 1 columns: the derivatives of x by each of the initial values
        t, x_1, ..., x_n. The outputs are, guard by guard, the guard's derivatives by the same n + 1 initial values.
        """
        size = len(self.states)
        if (size + 1) * len(self._tape.nodes) > MAX_VARIED:
            reason = f"with {size} states the variational equations are too large: more than {MAX_VARIED} operations"
            raise UndecidedError(reason, "mode")
        columns = [[sp.Dummy(f"v{i}_{j}", real=True) for i in range(size)] for j in range(size + 1)]
        gradients = [self._gradient(f) for f in self.field]
        field = [*self.field, *(_varied(g, column, j) for j, column in enumerate(columns) for g in gradients)]
        gradients = [self._gradient(g.expression) for g in self.guards]
        outputs = [_varied(g, column, j) for g in gradients for j, column in enumerate(columns)]
        return Program(build_tape([*self.states, *(v for column in columns for v in column)], field, outputs))

    def _gradient(self, expression: sp.Expr) -> dict[int, sp.Expr]:
        """Nonzero derivatives of an expression: key 0 for the time, key k for state x_k."""
        held = expression.free_symbols
        return {k: sp.diff(expression, x) for k, x in enumerate((TIME, *self.states)) if x in held}

    def field_over(self, box: Sequence[arb]) -> list[arb]:
        """Enclosure of (1, f) over a box in (t, x)."""
        values = dict(zip((TIME, *self.states), box, strict=True))
        return [arb(1), *(enclose(f, values) for f in self.field)]

    def lie_derivative(self, expression: sp.Expr) -> sp.Expr:
        return along(expression, self.states, self.field)


def _varied(gradient: Mapping[int, sp.Expr], column: Sequence[sp.Symbol], j: int) -> sp.Expr:
    """Derivative of an expression by initial value j (j = 0: the time), by the chain rule."""
    along = (slope * column[k - 1] for k, slope in gradient.items() if k > 0)
    return sp.Add(*along, gradient.get(0, 0) if j == 0 else 0)


class SystemModel:
    """A system with exact numbers: its modes, and its surfaces solved for states."""

    def __init__(self, system: FilippovSystem) -> None:
        self.system = system
        self.surfaces = tuple(system.numeric(h) for h in system.surfaces)
        self.symbols: tuple[sp.Symbol, ...] = (TIME, *system.states)

    def at(self, box: Sequence[arb]) -> dict[sp.Symbol, arb]:
        """Values of the symbols at a point or over a box in (t, x)."""
        return dict(zip(self.symbols, box, strict=True))

    @cached_method
    def mode(self, mode: Mode) -> ModeModel:
        """Return the model of a mode; raise ModelError if the mode has no equations."""
        return ModeModel(self.system, mode)

    @cached_method
    def solved(self, surfaces: tuple[int, ...]) -> list[SolvedState]:
        """Return the states that are determined exactly while these surfaces are zero."""
        return solve_for_states([self.surfaces[i] for i in surfaces], self.system.states)


def solve_for_states(zeros: Sequence[sp.Expr], states: Sequence[sp.Symbol]) -> list[SolvedState]:
    """Solve each expression that is linear in a state, with a constant factor, for that state; no state twice."""
    values = Identities.of(zeros, states).values
    return [(states.index(x), value, gradient(value, (TIME, *states))) for x, value in values.items()]
