"""Initial-value problems of a Filippov system."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.modes.mode import Mode
from henon_ref.modes.system import FilippovSystem

ArrayFunction = Callable[[float, NDArray[np.float64]], NDArray[np.float64]]
"""``f(t, x)``: a time [s] and a state, shape (n,), in; an array out, NaN where it has no value."""


@dataclass(frozen=True)
class Problem:
    """One initial-value problem of a Filippov system, in exact numbers.

    Every number is an exact SymPy number (``Rational(1, 10)``, ``sqrt(3)/9``); a solver rounds it once.

    :meth:`right_hand_side`, :meth:`guards` and :meth:`jacobian` are the smooth equations of one mode as functions of
    arrays, parameters put in; :meth:`reset` is a jump of the state. A mode has one entry a surface, in the order of
    ``system.surfaces``: -1 or +1 in slip, 0 in sliding; ModelError is raised where it has no equations. These four are
    unstable: their names and shapes may change until scenes have a numeric form of their own. Derive them once a mode,
    not once a step: each call derives and compiles anew.

    Examples
    --------
    A block on a belt of speed 1, with friction 1, and a ball that loses half its speed:

    >>> x, v, s = sp.symbols("x v s", real=True)
    >>> block = FilippovSystem((x, v), (s,), (v - 1,), (v, -x - s))
    >>> problem = Problem(block, sp.Integer(0), (sp.Integer(0), sp.Integer(0)), sp.Integer(10))
    >>> slip, stick = problem.right_hand_side((-1,)), problem.right_hand_side((0,))
    >>> slip(0.0, np.array([0.5, 0.0])), stick(0.0, np.array([0.5, 1.0]))
    (array([0. , 0.5]), array([1., 0.]))
    >>> problem.guards((-1,))(0.0, np.array([0.5, 0.25]))  # 1 - v
    array([0.75])
    >>> [guard.to_sign for guard in block.equations((0,)).guards]  # the sides that a stick is released into
    [1, -1]
    >>> problem.jacobian((1,))(0.0, np.array([0.5, 2.0]))
    array([[ 0.,  1.],
           [-1.,  0.]])

    >>> from henon_ref.modes.switched_field import Reset
    >>> ball = FilippovSystem((x, v), (s,), (x,), (v, sp.Integer(-10)), resets={0: Reset({v: -v / 2})})
    >>> Problem(ball, sp.Integer(0), (sp.Integer(1), sp.Integer(0)), sp.Integer(1)).reset(0)(0.5, np.array([0.0, -4.0]))
    array([0., 2.])
    """

    system: FilippovSystem
    """The system; its ``parameters`` hold the exact values."""
    start: sp.Expr
    """Initial time [s]."""
    initial: tuple[sp.Expr, ...]
    """Initial state, in the order of ``system.states``."""
    until: sp.Expr
    """Horizon: the run ends here [s]."""
    initial_mode: Mapping[int, int] = field(default_factory=dict)
    """Surface index -> -1, 0 or +1, for a start on a surface that the fields leave open."""

    def right_hand_side(self, mode: Mode) -> ArrayFunction:
        """``f(t, x)`` -> x', shape (n,), in the order of ``system.states`` [unit of the state / s] (unstable)."""
        return self._functions(self.system.equations(mode).field)

    def guards(self, mode: Mode) -> ArrayFunction:
        """``g(t, x)`` -> the functions that end the mode, shape (m,), in the order of its equations' guards (unstable).

        ``system.equations(mode).guards`` says of each what it is. All are positive inside the mode, and it ends where
        one falls through zero: the distance from a surface in slip [unit of the surface], the distance of the
        equivalent sign from -1 or +1 in a slide (or that times something positive). One that starts at zero, since its
        surface has just been left, does not end the mode there.
        """
        return self._functions([guard.expression for guard in self.system.equations(mode).guards])

    def jacobian(self, mode: Mode) -> ArrayFunction:
        """``J(t, x)`` -> shape (n, n), row i the derivative of ``x'[i]`` in every state (unstable).

        Entries that are identically zero are zero where others have no value.
        """
        from henon_ref.modes.callables import Jacobian

        return Jacobian(self.system.states, [self.system.numeric(f) for f in self.system.equations(mode).field])

    def reset(self, surface: int) -> ArrayFunction:
        """``R(t, x)`` -> the state after the jump on a surface of ``system.resets``, shape (n,) (unstable)."""
        own = self.system.resets[surface].map
        return self._functions([own.get(x, x) for x in self.system.states])

    def _functions(self, expressions: Sequence[sp.Expr]) -> ArrayFunction:
        from henon_ref.modes.callables import vector  # the library's own runs have no use for it

        return vector(self.system.states, [self.system.numeric(e) for e in expressions])
