"""Systems as data: a field with sign symbols, the surfaces of these signs, sliding overrides, and resets.

An override replaces Filippov's sliding, a reset is a jump of the state. :mod:`henon_ref.modes.system` derives modes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from dataclasses import field as dataclass_field
from functools import cached_property
from typing import Literal

import sympy as sp

from henon_ref.expressions.algebra import MAX_DERIVED, coefficients, up_to_a_number
from henon_ref.expressions.bounds import put
from henon_ref.expressions.traversal import is_longer
from henon_ref.method_cache import cached_method
from henon_ref.modes.equations import Guard, along
from henon_ref.modes.mode import Mode
from henon_ref.taylor.tape import TIME

AGREE = sp.Float("1e-25")
"""Relative difference up to which two sampled values agree."""


@dataclass(frozen=True)
class Release:
    """End of an overridden sliding mode: ``when`` crosses zero in ``direction``."""

    when: sp.Expr
    direction: Literal["rising", "falling"]
    to: int


@dataclass(frozen=True)
class SlidingOverride:
    """Sliding given by the source instead of Filippov's convex combination."""

    field: tuple[sp.Expr, ...]
    release: tuple[Release, ...]
    entry: Literal["attracting", "inside", "resting"] = "attracting"
    """Condition under which a trajectory that reaches the surface, or starts on it, sticks.

    ``attracting``: both slip fields point at the surface, as in Filippov's sliding. ``inside``: every release guard is
    positive, or zero and not about to fall, whatever the slip fields are. This is static friction, which holds a load
    that kinetic friction could not hold (between Fk and Fs both slip fields point the same way, and a block that comes
    to rest on the belt still sticks). ``resting``: h' is also zero, and the first non-zero derivative of h in the slip
    field is negative; a one-sided constraint on a surface that resets the state (:mod:`henon_ref.modes.resets`).
    """
    inertia: sp.Expr | None = None
    """Slope of the load, in the unit of the ends of the hold zone, in an acceleration of the surface by forces that
    these ends do not contain: the mass of a body on a wall. None if unknown."""
    push: tuple[sp.Expr, ...] = ()
    """Change of x' by the force of the contact, shape (n,): for a body at rest, by the reaction that changes h'' by 1;
    for a held contact, by a load of 1. Empty if unknown."""


@dataclass(frozen=True)
class Reset:
    """Jump of the state when a surface falls through zero; a rising surface is crossed without a jump."""

    map: Mapping[sp.Symbol, sp.Expr]
    """State -> its value after the jump, in time, the states before it, and parameters; other states stay."""
    priority: float = 0.0
    """Of several resets due at one instant, the one with the lowest priority is applied first."""


@dataclass(frozen=True, eq=False)
class SwitchedField:
    """``x' = f(t, x, s)``, with ``s_i = sign(h_i(t, x))``."""

    states: tuple[sp.Symbol, ...]
    signs: tuple[sp.Symbol, ...]
    """Sign symbols, one per surface, in the order of ``surfaces``."""
    surfaces: tuple[sp.Expr, ...]
    """h_i, in time, states and parameters."""
    field: tuple[sp.Expr, ...]
    """f, in time, states, signs and parameters; smooth as written: no sign, Abs or Piecewise."""
    parameters: Mapping[sp.Symbol, sp.Expr] = dataclass_field(default_factory=dict)
    """Parameter symbol -> its exact number."""
    valid: tuple[sp.Expr, ...] = ()
    """The model is valid while these are positive."""
    overrides: Mapping[int, SlidingOverride] = dataclass_field(default_factory=dict)
    """Surface index -> its sliding override."""
    resets: Mapping[int, Reset] = dataclass_field(default_factory=dict)
    """Surface index -> its reset."""
    open_kinks: frozenset[int] = frozenset()
    """Kinks of a branch that is not used at the start and that have no value there: their signs are undecided."""

    @property
    def sign_names(self) -> tuple[str, ...]:
        return tuple(symbol.name for symbol in self.signs)

    @property
    def state_names(self) -> tuple[str, ...]:
        return tuple(symbol.name for symbol in self.states)

    @cached_property
    def parameter_values(self) -> dict[str, sp.Expr]:
        """Parameter name -> its exact number."""
        return {symbol.name: value for symbol, value in self.parameters.items()}

    @cached_property
    def places(self) -> dict[sp.Symbol, int]:
        """State -> its index."""
        return {x: row for row, x in enumerate(self.states)}

    @cached_property
    def expressions(self) -> tuple[sp.Expr, ...]:
        """All expressions of the system: each occurs once."""
        written = [*self.field, *self.surfaces, *self.valid]
        for override in self.overrides.values():
            written += [*override.field, *(release.when for release in override.release)]
        for reset in self.resets.values():
            written += reset.map.values()
        return tuple(dict.fromkeys(written))

    def numeric(self, expression: sp.Expr) -> sp.Expr:
        """The expression with every parameter replaced by its exact number."""
        return expression.xreplace(dict(self.parameters)) if self.parameters else expression

    def entries(self, mode: Mode) -> dict[sp.Symbol, sp.Expr]:
        """Sign of each surface -> its entry in a mode."""
        return {sign: sp.Integer(entry) for sign, entry in zip(self.signs, mode, strict=True)}

    def slip_signs(self, mode: Mode) -> dict[sp.Symbol, sp.Expr]:
        """Sign of each surface in slip -> its entry in a mode."""
        return {self.signs[i]: sp.Integer(entry) for i, entry in enumerate(mode) if entry}

    @cached_method
    def normal_velocity(self, index: int) -> sp.Expr:
        """dh_i/dt along f, in time, states, signs and parameters."""
        h = self.surfaces[index]
        rows = sorted(self.places[x] for x in h.free_symbols & self.places.keys())
        return along(h, tuple(self.states[row] for row in rows), tuple(self.field[row] for row in rows))

    def constant_slope(self, surface: sp.Expr, state: sp.Symbol) -> sp.Expr | None:
        """Return the factor of a state in a surface if it is constant (no time, no states) and not zero; else None."""
        found = coefficients(surface, [state])
        if found is not None:
            slope = found.get(state)
        else:
            slope = None if is_longer(surface, MAX_DERIVED) else sp.diff(surface, state)
        return None if slope is None or slope == 0 or slope.free_symbols & {TIME, *self.states} else slope

    def sample(self, expressions: Sequence[sp.Expr]) -> list[sp.Expr]:
        """Return values of expressions at the parameters' values and quotients of primes as time-dependent symbols."""
        symbols = sorted(set().union(*(e.free_symbols for e in expressions)), key=str)
        numbers = {s: sp.Rational(sp.prime(k + 7), sp.prime(k + 17)) for k, s in enumerate(symbols)}
        numbers |= {TIME: sp.Rational(3, 7), **self.parameters}
        return [sp.N(put(e, numbers), 40) for e in expressions]

    def held_inside(self, index: int) -> bool:
        """Check whether the hold zone of its override, not the slip fields, decides sticking on a surface."""
        return index in self.overrides and self.overrides[index].entry == "inside"

    def rests(self, index: int) -> bool:
        """Check whether a body can rest on this surface, which resets the state."""
        return index in self.overrides and self.overrides[index].entry == "resting"

    @cached_method
    def hold_guards(self, index: int, mode: Mode = ()) -> tuple[Guard, ...]:
        """Return the release guards of a surface's override; its hold zone is the set on which all are positive.

        A load may depend on the direction in which other surfaces slip: the mode's slip signs are substituted.
        """
        slip = {s: side for s, side in self.slip_signs(mode).items() if s != self.signs[index]}
        ends = ((r, r.when if r.direction == "falling" else -r.when) for r in self.overrides[index].release)
        held = self.held_inside(index)
        return tuple(Guard("release", index, r.to, put(end, slip), not held, held) for r, end in ends)

    @cached_property
    def multiples(self) -> dict[int, tuple[int, int]]:
        """Surface that is a number times an earlier one, as written -> (the earlier surface, sign of the number)."""
        found: dict[int, tuple[int, int]] = {}
        first: dict[sp.Expr, tuple[int, int]] = {}
        for j, surface in enumerate(self.surfaces):
            form, sign = up_to_a_number(self.numeric(surface))
            i, own = first.setdefault(form, (j, sign))
            if i != j:
                found[j] = i, own * sign
        return found
