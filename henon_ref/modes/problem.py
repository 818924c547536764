"""Initial-value problems of a Filippov system, and its preparation: numeric exponents, held contacts in loops."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, lru_cache

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.errors import ModelError
from henon_ref.modes.contact_loops import circuits, loops, relations
from henon_ref.modes.mode import Mode
from henon_ref.modes.sliding import filippov_sliding
from henon_ref.modes.switched_field import Release, SlidingOverride
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


def with_rational_exponents(system: FilippovSystem) -> FilippovSystem:
    """Return the system with numbers substituted for parameters in every exponent that becomes rational.

    An exponent decides which function a power is (a product, a root), and no rule for a symbolic exponent holds for all
    its values: x**3 is smooth at x = 0, x**n only for some n. Powers of numbers and parameters, and parameters outside
    exponents, are left as written.
    """
    constant = set(system.parameters)

    def is_open(e: sp.Basic) -> bool:
        return (
            isinstance(e, sp.Pow)
            and bool(e.exp.free_symbols & constant)
            and not e.base.free_symbols <= constant
            and bool(system.numeric(e.exp).is_Rational)
        )

    @cache  # overrides repeat most rates of the field
    def written(expression: sp.Expr) -> sp.Expr:
        return expression.replace(is_open, lambda e: sp.Pow(e.base, system.numeric(e.exp)), simultaneous=False)

    overrides = {
        index: replace(
            override,
            field=tuple(map(written, override.field)),
            release=tuple(replace(r, when=written(r.when)) for r in override.release),
        )
        for index, override in system.overrides.items()
    }
    resets = {
        index: replace(reset, map={x: written(value) for x, value in reset.map.items()})
        for index, reset in system.resets.items()
    }
    surfaces, field, valid = (tuple(map(written, own)) for own in (system.surfaces, system.field, system.valid))
    return replace(system, surfaces=surfaces, field=field, valid=valid, overrides=overrides, resets=resets)


def parameters_in_exponents(system: FilippovSystem) -> set[sp.Symbol]:
    """Return the parameters whose values :func:`with_rational_exponents` uses: other values give another system."""
    exponents = (power.exp for e in system.expressions for power in e.atoms(sp.Pow))
    return {symbol for exponent in exponents for symbol in exponent.free_symbols} & set(system.parameters)


def with_held_loops(system: FilippovSystem) -> FilippovSystem:
    """Return the system in which contacts in loops are held by the loads that their loops share.

    If surfaces depend on each other, Filippov's combination has no unique equivalent signs, although the motion may be
    unique. The two guards of a contact's sliding (each field points at its surface) then become the ends of a hold
    zone, and the contact is decided like a contact with static friction. Surfaces that are only multiples of one
    surface are one contact for :func:`henon_ref.modes.sliding.filippov_sliding` and are not changed here. A stop on
    which a body rests may be part of a loop, for example with the contacts of a block with a wall and with that body.

    The loops are those that hold for all values of the parameters: one system may run at any of them.
    """
    resets = ((i, tuple(reset.map.items())) for i, reset in system.resets.items())
    written = (system.signs, system.field, system.surfaces, *system.overrides.items(), *resets)
    own = _overrides(_Equations(written, replace(system, parameters={})))
    return replace(system, overrides={**system.overrides, **own}) if own else system


@dataclass(frozen=True)
class _Equations:
    """A system, equal to others with the same equations: a sweep reads them again at other values of parameters."""

    written: tuple[object, ...]
    system: FilippovSystem = field(compare=False)


@lru_cache(maxsize=32)
def _overrides(equations: _Equations) -> dict[int, SlidingOverride]:
    """Return the overrides of contacts without static friction in loops, by surface."""
    system = equations.system
    acting = [i for i, s in enumerate(system.signs) if i in system.overrides or system.normal_velocity(i).has(s)]
    if not relations(system.velocities, tuple(acting)):
        return {}
    lone = {i: _held(system, i) for i in acting if i not in system.overrides and i not in system.resets}
    plain = {i: override for i, override in lone.items() if override is not None}
    contacts = tuple(i for i in acting if i in plain or system.held_inside(i) or system.rests(i))
    found = loops(relations(system.velocities, contacts))
    members = [sorted(set().union(*loop)) for loop in found]
    multiples = {k for k, loop in enumerate(found) if all(len(relation) == 2 for relation in loop)}
    held = set(system.overrides).union(*(own for k, own in enumerate(members) if k not in multiples))
    own: dict[int, SlidingOverride] = {}
    for k, surfaces in enumerate(members):
        if k in multiples and not held & system.together(surfaces[0], contacts):
            continue
        more = {i: plain[i] for i in surfaces if i in plain}
        whole = replace(system, overrides={**system.overrides, **own, **more})
        if whole.can_slide(frozenset(surfaces)):
            own |= more
            continue
        # Contacts between drives of different speeds do not hold together; the remaining loops may.
        for circuit in circuits(found[k]):
            if not more.keys().isdisjoint(circuit) and whole.can_slide(frozenset(circuit)):
                own |= {i: more[i] for i in circuit if i in more}
    return own


def _held(system: FilippovSystem, index: int) -> SlidingOverride | None:
    """Return the override that holds a contact without static friction; None if it cannot slide on its own."""
    try:
        field, guards, _ = filippov_sliding(system, (index,))
    except ModelError:
        return None
    ends = tuple(Release(guard.expression, "falling", guard.to_sign) for guard in guards)
    return SlidingOverride(field, ends, "inside", sp.S.One)
