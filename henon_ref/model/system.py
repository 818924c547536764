"""Filippov systems: one expression with sign symbols, and the smooth equations of each of its modes.

A piecewise-smooth system is ``x' = f(t, x, s)`` with surfaces ``h_i(t, x) = 0`` and sign symbols
``s_i = sign(h_i)``; f is smooth in t and x for every value of s. See Filippov, *Differential Equations
with Discontinuous Righthand Sides* (1988), and Eqs. (6)-(8) of Olejnik and Awrejcewicz (2013).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from dataclasses import field as dataclass_field
from functools import cached_property
from itertools import product
from typing import Literal

import sympy as sp
from sympy.solvers.solveset import NonlinearError

from henon_ref.errors import ModelError
from henon_ref.model.modes import Mode

TIME = sp.Symbol("t", real=True)

GuardKind = Literal["surface", "release", "valid"]
EntryRule = Literal["attracting", "inside"]


@dataclass(frozen=True)
class Guard:
    """A function that is positive inside a mode; the mode ends where it falls through zero."""

    kind: GuardKind
    """``surface``: h_i reached in slip; ``release``: the sliding on surface i ends; ``valid``: the model ends."""
    index: int
    """Index of the surface, or of the ``valid`` expression."""
    to_sign: int
    """``surface``: the side beyond; ``release``: the side released into; ``valid``: 0."""
    expression: sp.Expr
    """In time, states, parameters (and, in shared equations, the signs of the surfaces in slip)."""
    rising_only: bool = False
    """A guard that may be negative at the start of the mode and is then armed once it has turned positive."""


@dataclass(frozen=True)
class ModeEquations:
    """The smooth equations of one mode."""

    field: tuple[sp.Expr, ...]
    """x' in this mode, in time, states and parameters."""
    guards: tuple[Guard, ...]
    """What ends the mode: surfaces in slip first, then releases, then ``valid``; by index within each."""
    equivalent_signs: Mapping[int, sp.Expr]
    """Sliding surface -> its equivalent sign in [-1, 1] (empty where a ``sliding`` override is in force)."""


@dataclass(frozen=True)
class Release:
    """One way out of an overridden sliding mode: where ``when`` crosses zero in ``direction``."""

    when: sp.Expr
    direction: Literal["rising", "falling"]
    to: int


@dataclass(frozen=True)
class SlidingOverride:
    """Sliding that a source does in its own way, in place of Filippov's convex combination."""

    field: tuple[sp.Expr, ...]
    release: tuple[Release, ...]
    entry: EntryRule = "attracting"
    """When a trajectory that reaches the surface (or starts on it) sticks.

    ``attracting``: where both slip fields point at the surface, as in Filippov's sliding. ``inside``: where
    every release guard is positive, or zero and about to rise or to stay, whatever the slip fields do; this is
    static friction, which holds a load that kinetic friction could not (between Fk and Fs both slip fields
    point the same way, and a block that comes to rest on the belt sticks all the same).
    """


@dataclass(frozen=True, eq=False)
class FilippovSystem:
    """``x' = f(t, x, s)`` with surfaces ``h_i(t, x)`` and sign symbols ``s_i``.

    Raises
    ------
    ModelError
        From :meth:`equations`, where a mode has no equations (signs that multiply each other on an
        intersection, an override together with another sliding surface).
    """

    states: tuple[sp.Symbol, ...]
    signs: tuple[sp.Symbol, ...]
    """Sign symbols, one a surface, in the order of ``surfaces``."""
    surfaces: tuple[sp.Expr, ...]
    """h_i, in time, states and parameters."""
    field: tuple[sp.Expr, ...]
    """f, in time, states, signs and parameters; smooth as text: no sign, Abs or Piecewise."""
    parameters: Mapping[sp.Symbol, sp.Expr] = dataclass_field(default_factory=dict)
    """Parameter symbol -> its exact number."""
    valid: tuple[sp.Expr, ...] = ()
    """The model holds while these are > 0."""
    overrides: Mapping[int, SlidingOverride] = dataclass_field(default_factory=dict)
    """Surface index -> its own sliding."""
    effects: tuple[str, ...] = ()
    """Names of the effects a scene was built from (empty for a plain system)."""

    @property
    def sign_names(self) -> tuple[str, ...]:
        return tuple(symbol.name for symbol in self.signs)

    @property
    def state_names(self) -> tuple[str, ...]:
        return tuple(symbol.name for symbol in self.states)

    @cached_property
    def _cache(self) -> dict[object, ModeEquations]:
        return {}

    @cached_property
    def _normal(self) -> tuple[sp.Expr, ...]:
        return tuple(_along(h, self.states, self.field) for h in self.surfaces)

    def numeric(self, expression: sp.Expr) -> sp.Expr:
        """The expression with every parameter replaced by its exact number."""
        return expression.xreplace(dict(self.parameters)) if self.parameters else expression

    def equations(self, mode: Mode) -> ModeEquations:
        """Equations of one mode, signs of the surfaces in slip put in as -1 or +1."""
        key = ("mode", mode)
        if key not in self._cache:
            shared = self.shared_equations(frozenset(i for i, s in enumerate(mode) if s == 0))
            slip = {self.signs[i]: sp.Integer(s) for i, s in enumerate(mode) if s}
            self._cache[key] = ModeEquations(
                field=tuple(e.xreplace(slip) for e in shared.field),
                guards=tuple(
                    Guard(
                        g.kind,
                        g.index,
                        -mode[g.index] if g.kind == "surface" else g.to_sign,
                        g.expression.xreplace(slip),
                        g.rising_only,
                    )
                    for g in shared.guards
                ),
                equivalent_signs={i: e.xreplace(slip) for i, e in shared.equivalent_signs.items()},
            )
        return self._cache[key]

    def shared_equations(self, sliding: frozenset[int]) -> ModeEquations:
        """Equations that all modes with this set of sliding surfaces share, slip signs kept as symbols.

        A ``surface`` guard is then ``s_i h_i`` and its ``to_sign`` is 0 (it is ``-s_i``).
        """
        key = ("shared", sliding)
        if key not in self._cache:
            overridden = sliding & set(self.overrides)
            releases: tuple[Guard, ...] = ()
            signs: dict[int, sp.Expr] = {}
            if not sliding:
                rhs = self.field
            elif overridden:
                if len(sliding) > 1:
                    raise ModelError(
                        "a surface with a 'sliding' override cannot slide together with another surface: "
                        + ", ".join(self.signs[i].name for i in sorted(sliding))
                    )
                index = next(iter(sliding))
                rhs, releases = self.overrides[index].field, self.hold_guards(index)
            elif any((i in sliding) != (j in sliding) for j, (i, _) in self.multiples.items()):
                raise ModelError("surfaces that are multiples of each other slide together or not at all")
            else:
                rhs, releases, signs = _filippov_sliding(self, tuple(sorted(sliding)))
            surfaces = tuple(
                Guard("surface", i, 0, self.signs[i] * h) for i, h in enumerate(self.surfaces) if i not in sliding
            )
            valid = tuple(Guard("valid", i, 0, e) for i, e in enumerate(self.valid))
            self._cache[key] = ModeEquations(tuple(rhs), surfaces + releases + valid, signs)
        return self._cache[key]

    def normal_velocity(self, index: int) -> sp.Expr:
        """dh_i/dt along f, in time, states, signs and parameters."""
        return self._normal[index]

    def together(self, index: int, sliding: Iterable[int]) -> frozenset[int]:
        """The surfaces of ``sliding`` that act on a surface while it changes its side, or that it acts on, and itself.

        They act through the signs in each other's normal velocities, directly or by way of each other; sliding
        that is overridden acts on everything.
        """
        found, left = {index}, set(sliding) - {index}
        while True:
            more = {j for j in left if any(j in self._acting[i] or i in self._acting[j] for i in found)}
            if not more:
                return frozenset(found)
            found |= more
            left -= more

    @cached_property
    def _acting(self) -> tuple[frozenset[int], ...]:
        """For each surface those whose signs are in its normal velocity."""
        everything = frozenset(range(len(self.surfaces)))
        return tuple(
            everything if i in self.overrides else frozenset(j for j, s in enumerate(self.signs) if normal.has(s))
            for i, normal in enumerate(self._normal)
        )

    @cached_property
    def multiples(self) -> dict[int, tuple[int, int]]:
        """Surfaces that are an earlier one times a number, as they are written: which one, and the number's sign."""
        found: dict[int, tuple[int, int]] = {}
        first: dict[sp.Expr, tuple[int, int]] = {}
        for j, surface in enumerate(self.surfaces):
            form, sign = _up_to_a_number(self.numeric(surface))
            i, own = first.setdefault(form, (j, sign))
            if i != j:
                found[j] = i, own * sign
        return found

    def hold_guards(self, index: int) -> tuple[Guard, ...]:
        """The release guards of a surface's override: its hold zone is where all are positive."""
        return tuple(
            Guard("release", index, r.to, -r.when if r.direction == "rising" else r.when, rising_only=True)
            for r in self.overrides[index].release
        )

    def held_inside(self, index: int) -> bool:
        """Whether arrival at a surface is decided by the hold zone of its override, not by the slip fields."""
        return index in self.overrides and self.overrides[index].entry == "inside"

    def transition_function(self, index: int = 0) -> sp.Expr:
        """sigma = (dh/dt at s = +1)(dh/dt at s = -1), Eq. (8): sliding is where sigma <= 0 and both fields point in."""
        normal = self.normal_velocity(index)
        sign = self.signs[index]
        return normal.xreplace({sign: sp.Integer(1)}) * normal.xreplace({sign: sp.Integer(-1)})


def _along(expression: sp.Expr, states: tuple[sp.Symbol, ...], rhs: tuple[sp.Expr, ...]) -> sp.Expr:
    """Time derivative of an expression along a field."""
    moving = expression.free_symbols
    slopes = (sp.diff(expression, x) * f for x, f in zip(states, rhs, strict=True) if x in moving)
    return sp.diff(expression, TIME) + sp.Add(*slopes)


def _up_to_a_number(expression: sp.Expr) -> tuple[sp.Expr, int]:
    """The expression without its numerical factor, and that factor's sign; nothing is expanded."""
    number, rest = expression.as_independent(*expression.free_symbols, as_Add=False)
    _, form = rest.as_content_primitive()
    turned = form.could_extract_minus_sign()
    return (-form if turned else form), (1 if number.is_positive else -1) * (-1 if turned else 1)


def _solved_state(surface: sp.Expr, states: tuple[sp.Symbol, ...], taken: set[int]) -> int | None:
    """A state in which the surface is linear with a constant factor, so that the surface is x_k = r(t, others)."""
    for k, x in enumerate(states):
        slope = sp.diff(surface, x)
        if k not in taken and slope != 0 and not slope.free_symbols & ({TIME} | set(states)):
            return k
    return None


def _interpolated(expression: sp.Expr, signs: tuple[sp.Symbol, ...]) -> sp.Expr:
    """The multi-affine interpolation of an expression between the signs -1 and +1 (for one sign: Filippov's)."""
    free = expression.free_symbols
    used = [s for s in signs if s in free]
    if all(sp.diff(expression, s, 2) == 0 for s in used):
        return expression
    total = sp.Integer(0)
    for corner in product((-1, 1), repeat=len(used)):
        weight = sp.Mul(*((1 + c * s) / sp.Integer(2) for c, s in zip(corner, used, strict=True)))
        total += weight * expression.xreplace({s: sp.Integer(c) for c, s in zip(corner, used, strict=True)})
    return total


def _filippov_sliding(
    system: FilippovSystem, sliding: tuple[int, ...]
) -> tuple[tuple[sp.Expr, ...], tuple[Guard, ...], dict[int, sp.Expr]]:
    """Filippov's convex combination on the intersection of the sliding surfaces.

    Surfaces that are one another's multiples are one contact: there are but two fields beside it, and their signs stay
    equal (or opposite) in the combination of these.
    """
    tied = {j: found for j, found in system.multiples.items() if j in sliding}
    if tied:
        joined = {system.signs[j]: way * system.signs[i] for j, (i, way) in tied.items()}
        lone = replace(system, field=tuple(f.xreplace(joined) for f in system.field))
        field, releases, found = _filippov_sliding(lone, tuple(i for i in sliding if i not in tied))
        for j, (i, way) in tied.items():
            releases += tuple(Guard(g.kind, j, way * g.to_sign, g.expression) for g in releases if g.index == i)
            found[j] = way * found[i]
        return field, releases, found
    states = system.states
    solved: dict[int, int] = {}
    for i in sliding:
        k = _solved_state(system.surfaces[i], states, set(solved.values()))
        if k is not None:
            solved[i] = k
    on_surface = _surface_substitution(system, solved)
    signs = tuple(system.signs[i] for i in sliding)
    rhs = [_interpolated(f.xreplace(on_surface), signs) for f in system.field]
    normal = [
        sp.expand(_along(system.surfaces[i], states, tuple(rhs)).xreplace(on_surface), deep=False) for i in sliding
    ]
    slope = [[sp.simplify(sp.diff(n, s)) if n.has(s) else sp.S.Zero for s in signs] for n in normal]
    if any(entry.has(*signs) for row in slope for entry in row):
        raise ModelError(
            "signs that multiply each other on the intersection of "
            + ", ".join(s.name for s in signs)
            + ": Filippov's combination is not unique there; write the field so that each sign stands alone"
        )
    none = {s: sp.Integer(0) for s in signs}
    rest = [n.xreplace(none) for n in normal]
    coupled = any(slope[i][j] != 0 for i in range(len(signs)) for j in range(len(signs)) if i != j)
    guards: list[Guard] = []
    if coupled:
        try:
            solution = sp.Matrix(slope).LUsolve(-sp.Matrix(rest))
        except sp.matrices.exceptions.NonInvertibleMatrixError as error:
            names = ", ".join(s.name for s in signs)
            raise ModelError(
                f"the field does not settle the signs of the surfaces it should slide on: {names}"
            ) from error
        equivalent = {s: solution[i] for i, s in enumerate(signs)}
        for i, s in zip(sliding, signs, strict=True):
            guards.append(Guard("release", i, 1, 1 - equivalent[s]))
            guards.append(Guard("release", i, -1, 1 + equivalent[s]))
    else:
        if any(slope[i][i] == 0 for i in range(len(signs))):
            raise ModelError(f"the field does not depend on the sign of a surface it should slide on: {signs}")
        equivalent = {s: -rest[i] / slope[i][i] for i, s in enumerate(signs)}
        for n, i, s in zip(normal, sliding, signs, strict=True):
            # Sliding attracts while dh/dt < 0 beyond and > 0 before; it ends where either reaches 0 (tangent points).
            guards.append(Guard("release", i, 1, -n.xreplace({s: sp.Integer(1)})))
            guards.append(Guard("release", i, -1, n.xreplace({s: sp.Integer(-1)})))
    result = [f.xreplace(equivalent) for f in rhs]
    for i, k in solved.items():
        # x_k = r(t, others) on the surface: its derivative needs no friction force, and keeps the surface exactly.
        h = system.surfaces[i]
        rates = [sp.S.Zero if j == k else rate for j, rate in enumerate(result)]
        others = _along(h, states, tuple(rates))
        result[k] = -others.xreplace(on_surface) / sp.diff(h, states[k])
    return tuple(result), tuple(guards), {i: equivalent[s] for i, s in zip(sliding, signs, strict=True)}


def _surface_substitution(system: FilippovSystem, solved: Mapping[int, int]) -> dict[sp.Symbol, sp.Expr]:
    """Each solved state in terms of time and the states that are left free on the surfaces."""
    if not solved:
        return {}
    unknown = [system.states[k] for k in solved.values()]
    try:
        solution = sp.linsolve([system.surfaces[i] for i in solved], unknown)
    except NonlinearError:  # each is linear in its own state, but not all of them in all
        return {}
    if solution == sp.EmptySet or len(solution) != 1:
        return {}
    return dict(zip(unknown, next(iter(solution)), strict=True))
