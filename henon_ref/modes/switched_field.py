"""Systems as data: a field with sign symbols, the surfaces whose signs these are, and what is done its own way on them.

Sliding that is not Filippov's is an override, a jump of the state a reset. Modes are derived from it by
:mod:`henon_ref.modes.system`.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass
from dataclasses import field as dataclass_field
from functools import cached_property, wraps
from typing import Any, Literal, TypeVar, cast

import sympy as sp

from henon_ref.modes.bounds import put
from henon_ref.modes.equations import Guard, along
from henon_ref.modes.mode import Mode

Method = TypeVar("Method", bound=Callable[..., Any])


def kept(method: Method) -> Method:
    """A method whose results are kept with its object, by its arguments (given by place)."""

    @wraps(method)
    def of(self: Any, *arguments: Hashable) -> Any:
        known: dict[Hashable, Any] = self.__dict__.setdefault("_kept", {})
        key = method.__qualname__, arguments
        if key not in known:
            known[key] = method(self, *arguments)
        return known[key]

    return cast(Method, of)


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
    entry: Literal["attracting", "inside", "resting"] = "attracting"
    """When a trajectory that reaches the surface (or starts on it) sticks.

    ``attracting``: where both slip fields point at the surface, as in Filippov's sliding. ``inside``: where
    every release guard is positive, or zero and about to rise or to stay, whatever the slip fields do; this is
    static friction, which holds a load that kinetic friction could not (between Fk and Fs both slip fields
    point the same way, and a block that comes to rest on the belt sticks all the same). ``resting``: where h' is
    zero, too, and the first derivative of h that is not, the slip field being in force, is negative; a one-sided
    constraint on a surface that resets the state (:mod:`henon_ref.modes.resets`).
    """
    inertia: sp.Expr | None = None
    """How much the load, in the unit of the ends of the hold zone, grows with the acceleration of the surface by
    forces that these ends do not know: of a body on a wall its mass. None where that is not known."""
    push: tuple[sp.Expr, ...] = ()
    """Change of x' by the force of the contact, shape (n,): of a body at rest by a reaction of the surface that changes
    h'' by 1, of a contact that is held by a load of 1. Empty where that is not known."""


@dataclass(frozen=True)
class Reset:
    """A jump of the state where a surface falls through zero; the other way it is crossed."""

    map: Mapping[sp.Symbol, sp.Expr]
    """State -> its value after the jump, in time, the states before it, and parameters; the other states stay."""
    priority: float = 0.0
    """Of several that are due at one instant the lowest goes first."""


@dataclass(frozen=True, eq=False)
class SwitchedField:
    """``x' = f(t, x, s)``, with ``s_i = sign(h_i(t, x))``."""

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
    resets: Mapping[int, Reset] = dataclass_field(default_factory=dict)
    """Surface index -> the jump of the state where it falls through zero."""
    open_kinks: frozenset[int] = frozenset()
    """Kinks of a branch that is not in use at the start of a run, without a value there: their signs stay open."""

    @property
    def sign_names(self) -> tuple[str, ...]:
        return tuple(symbol.name for symbol in self.signs)

    @property
    def state_names(self) -> tuple[str, ...]:
        return tuple(symbol.name for symbol in self.states)

    def numeric(self, expression: sp.Expr) -> sp.Expr:
        """The expression with every parameter replaced by its exact number."""
        return expression.xreplace(dict(self.parameters)) if self.parameters else expression

    def slip_signs(self, mode: Mode) -> dict[sp.Symbol, sp.Expr]:
        """What a mode puts for the signs of its surfaces in slip."""
        return {self.signs[i]: sp.Integer(s) for i, s in enumerate(mode) if s}

    def normal_velocity(self, index: int) -> sp.Expr:
        """dh_i/dt along f, in time, states, signs and parameters."""
        return self._normal[index]

    @cached_property
    def _normal(self) -> tuple[sp.Expr, ...]:
        return tuple(along(h, self.states, self.field) for h in self.surfaces)

    def held_inside(self, index: int) -> bool:
        """Whether arrival at a surface is decided by the hold zone of its override, not by the slip fields."""
        return index in self.overrides and self.overrides[index].entry == "inside"

    def rests(self, index: int) -> bool:
        """Whether a body can rest on a surface that resets the state."""
        return index in self.overrides and self.overrides[index].entry == "resting"

    @kept
    def hold_guards(self, index: int, mode: Mode = ()) -> tuple[Guard, ...]:
        """The release guards of a surface's override: its hold zone is where all are positive.

        A load may depend on how other surfaces slip: the signs of the mode's slips are put in.
        """
        slip = {s: side for s, side in self.slip_signs(mode).items() if s != self.signs[index]}
        ends = ((r, r.when if r.direction == "falling" else -r.when) for r in self.overrides[index].release)
        return tuple(Guard("release", index, r.to, put(end, slip), rising_only=True) for r, end in ends)

    @cached_property
    def multiples(self) -> dict[int, tuple[int, int]]:
        """Surfaces that are an earlier one times a number, as they are written: which one, and the number's sign."""
        found: dict[int, tuple[int, int]] = {}
        first: dict[sp.Expr, tuple[int, int]] = {}
        for j, surface in enumerate(self.surfaces):
            form, sign = up_to_a_number(self.numeric(surface))
            i, own = first.setdefault(form, (j, sign))
            if i != j:
                found[j] = i, own * sign
        return found


def up_to_a_number(expression: sp.Expr) -> tuple[sp.Expr, int]:
    """The expression without its numerical factor, and that factor's sign; nothing is expanded."""
    number, rest = expression.as_independent(*expression.free_symbols, as_Add=False)
    _, form = rest.as_content_primitive()
    turned = form.could_extract_minus_sign()
    return (-form if turned else form), (1 if number.is_positive else -1) * (-1 if turned else 1)
