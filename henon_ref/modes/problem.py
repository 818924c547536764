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
"""``f(t, x)``: time [s] and state, shape (n,), -> array, NaN without a value."""


@dataclass(frozen=True)
class Problem:
    """Initial-value problem of a Filippov system, in exact numbers.

    Every number is an exact SymPy number (``Rational(1, 10)``, ``sqrt(3)/9``); a solver rounds it once.

    :meth:`right_hand_side`, :meth:`guards` and :meth:`jacobian` return the smooth equations of one mode as functions of
    arrays, with parameters substituted; :meth:`reset` returns a jump of the state. A mode has one entry per surface, in
    the order of ``system.surfaces``: -1 or +1 in slip, 0 in sliding; a mode without equations raises ModelError. These
    four methods are unstable: their names and shapes may change until scenes have a numeric form of their own. Call
    them once per mode, not once per step: each call derives and compiles anew.

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
    """Horizon: end of the run [s]."""
    initial_mode: Mapping[int, int] = field(default_factory=dict)
    """Surface index -> -1, 0 or +1, for a start on a surface at which the fields do not decide the mode."""

    def right_hand_side(self, mode: Mode) -> ArrayFunction:
        """``f(t, x)`` -> x', shape (n,), in the order of ``system.states`` [unit of the state / s] (unstable)."""
        return self._functions(self.system.equations(mode).field)

    def guards(self, mode: Mode) -> ArrayFunction:
        """``g(t, x)`` -> the functions that end the mode, shape (m,), in the order of its equations' guards (unstable).

        ``system.equations(mode).guards`` describes each function. All are positive inside the mode, and the mode ends
        when one falls through zero. A function is the distance from a surface in slip [unit of the surface], or the
        distance of the equivalent sign from -1 or +1 in sliding (possibly times a positive factor). A function that
        starts at zero, because its surface has just been left, does not end the mode there.
        """
        return self._functions([guard.expression for guard in self.system.equations(mode).guards])

    def jacobian(self, mode: Mode) -> ArrayFunction:
        """``J(t, x)`` -> shape (n, n), row i the derivative of ``x'[i]`` in every state (unstable).

        Entries that are identically zero are zero even if other entries have no value.
        """
        from henon_ref.modes.callables import Jacobian

        return Jacobian(self.system.states, [self.system.numeric(f) for f in self.system.equations(mode).field])

    def reset(self, surface: int) -> ArrayFunction:
        """``R(t, x)`` -> the state after the jump on a surface of ``system.resets``, shape (n,) (unstable)."""
        own = self.system.resets[surface].map
        return self._functions([own.get(x, x) for x in self.system.states])

    def _functions(self, expressions: Sequence[sp.Expr]) -> ArrayFunction:
        from henon_ref.modes.callables import vector  # imported here: runs of the library do not use it

        return vector(self.system.states, [self.system.numeric(e) for e in expressions])
