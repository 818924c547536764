"""A field with sign symbols, and the surfaces whose signs these are: a Filippov system before its modes are derived."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass
from dataclasses import field as dataclass_field
from functools import cached_property, wraps
from typing import Any, TypeVar, cast

import sympy as sp

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

    @property
    def sign_names(self) -> tuple[str, ...]:
        return tuple(symbol.name for symbol in self.signs)

    @property
    def state_names(self) -> tuple[str, ...]:
        return tuple(symbol.name for symbol in self.states)

    def numeric(self, expression: sp.Expr) -> sp.Expr:
        """The expression with every parameter replaced by its exact number."""
        return expression.xreplace(dict(self.parameters)) if self.parameters else expression

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
