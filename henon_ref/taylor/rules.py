"""Rules of the Taylor recurrences: for every operation of a tape, the equation that it satisfies.

The rules are mathematics without an arithmetic: machine code (:mod:`henon_ref.taylor.llvm.recurrences`) and series over
any ring (:mod:`henon_ref.taylor.series`) each implement the recurrences of these kinds, and
:mod:`henon_ref.enclosure.tail_bounds` bounds their remainders. A differential equation for y gives coefficient k from
those of lower order when both sides are compared at order k - 1 (Jorba and Zou, *Experimental Mathematics* 14, 2005,
Sec. 2; Griewank and Walther, *Evaluating Derivatives*, 2nd ed., Sec. 13.2).

Below, y is the operation, a and b are the nodes that it reads, c is its constant.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

SELF, ARGUMENT = "y", "a"


@dataclass(frozen=True)
class Linear:
    """y = first a + second b, without c, plus c, or times c."""

    first: int = 1
    second: int = 0
    constant: Literal["none", "term", "factor"] = "none"


@dataclass(frozen=True)
class Product:
    """y = a right, where ``right`` is the second node b or a itself."""

    right: str = "b"


@dataclass(frozen=True)
class Quotient:
    """y = above / below."""

    above: str
    below: str


@dataclass(frozen=True)
class Root:
    """y y = a."""


@dataclass(frozen=True)
class Power:
    """y' a = c a' y."""


@dataclass(frozen=True)
class _Integral:
    """A function with ``y' = sign a' factor`` or ``y' factor = sign a'``, where the factor is a series too.

    A factor that is neither y nor a is the second node that the operation reads.
    """

    sign: int
    factor: str

    @property
    def paired(self) -> bool:
        """Whether operation and factor are each other's factor, such as sine and cosine."""
        return self.factor.endswith(f"({ARGUMENT})") and not self.factor.startswith("sqrt")

    def place(self, at: int, args: tuple[int, ...]) -> int:
        """Node of the factor, for the operation at index ``at`` of the tape that reads the nodes ``args``."""
        return {SELF: at, ARGUMENT: args[0]}.get(self.factor, args[-1])


class IntegralOfProduct(_Integral):
    """y' = sign a' factor."""


class IntegralOfQuotient(_Integral):
    """y' factor = sign a'."""


Rule = Linear | Product | Quotient | Root | Power | IntegralOfProduct | IntegralOfQuotient
RULES: dict[str, Rule] = {
    "add": Linear(1, 1),
    "sub": Linear(1, -1),
    "scale": Linear(constant="factor"),
    "shift": Linear(constant="term"),
    "rsub": Linear(-1, constant="term"),
    "mul": Product(),
    "square": Product(ARGUMENT),
    "div": Quotient(ARGUMENT, "b"),
    "recip": Quotient("c", ARGUMENT),
    "sqrt": Root(),
    "power": Power(),
    "exp": IntegralOfProduct(+1, SELF),
    "sin": IntegralOfProduct(+1, "cos(a)"),
    "cos": IntegralOfProduct(-1, "sin(a)"),
    "sinh": IntegralOfProduct(+1, "cosh(a)"),
    "cosh": IntegralOfProduct(+1, "sinh(a)"),
    "tan": IntegralOfProduct(+1, "1 + y**2"),
    "tanh": IntegralOfProduct(+1, "1 - y**2"),
    "log": IntegralOfQuotient(+1, ARGUMENT),
    "atan": IntegralOfQuotient(+1, "1 + a**2"),
    "asin": IntegralOfQuotient(+1, "sqrt(1 - a**2)"),
    "acos": IntegralOfQuotient(-1, "sqrt(1 - a**2)"),
}
"""Rule of each operation. ``constant``, ``clock`` and ``state`` have no rule, because they read no node."""
LINEAR = frozenset(op for op, rule in RULES.items() if isinstance(rule, Linear))
