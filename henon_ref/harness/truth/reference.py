"""A truth: reference transitions in decimal digits with radii, and the methods that computed them.

Exact numbers and balls are converted to digits without doubles and without heyoka.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass, replace
from decimal import Decimal, localcontext
from functools import cached_property, lru_cache
from itertools import accumulate, groupby
from typing import TYPE_CHECKING, Any

import sympy as sp
from flint import arb

from henon_ref.errors import HenonRefError, ModelError
from henon_ref.harness.score.reference import NearGraze, ReferenceTransition, split_double
from henon_ref.trajectory import Status

if TYPE_CHECKING:  # a stored truth needs no enclosure
    from henon_ref.enclosure.run import EnclosedTransition

OUT_OF_TIME = "the truth's time limit passed"
"""Start of the reason of a truth that a time limit ended early."""
GUARD_BITS = 32
"""Bits by which ball arithmetic exceeds heyoka's precision, so that its rounding does not matter."""
CLOSED_FORM_BITS = 320
"""Working precision of a closed form, more than the truth's 256 bits, so that its rounding does not matter."""
STATE_DIGITS = 25
"""Significant digits of a state in a truth, eight more than a double has: states are compared as doubles."""


class TruthError(HenonRefError):
    """Two routes to the truth contradict each other, so that no truth can be stored."""


@dataclass(frozen=True)
class Route:
    """Result of one method of computing the truth."""

    method: str
    """Name of the method with its library: ``heyoka 7.13.2, Taylor``."""
    bits: tuple[int, ...]
    """Working precisions, the one that the digits come from first."""
    seconds: float
    """Time taken [s]."""
    status: Status
    """How the exact run ends: ``ok``, ``diverged``, ``nonunique``, ``invalid``, or ``failed``."""
    reason: str
    end_digits: str
    """End of the known part of the run [s]: the horizon, or the end of the run."""
    end_radius: float
    transitions: tuple[ReferenceTransition, ...]
    near_grazes: tuple[NearGraze, ...] = ()
    undecided: str = ""
    """Reason why the method stopped before the end of the run; empty if it did not."""
    accumulates: bool = False
    """Whether transitions accumulate at the end; only those that differ in double precision are listed."""


@dataclass(frozen=True)
class Truth:
    """The reference of one reading."""

    case: str
    reading: str
    mathematics_hash: str
    """Hash of the mathematics that the truth belongs to."""
    status: Status
    reason: str
    end_digits: str
    """End of the known part of the run [s]: the horizon, or the end of the exact run."""
    end_radius: float
    transitions: tuple[ReferenceTransition, ...]
    near_grazes: tuple[NearGraze, ...]
    methods: tuple[tuple[str, tuple[int, ...], float], ...]
    """(method, bits, seconds taken) of every route, the route that the digits come from first."""
    certified: bool
    """Whether every transition has a proven radius and the list is proven to be complete."""
    uncertified_because: str = ""

    @cached_property
    def end_time(self) -> float:
        """End of the known part of the exact run [s]."""
        return split_double(self.end_digits)[0]

    @property
    def radius(self) -> float:
        """Largest radius of the transition times [s], a lower bound of every error that can be measured."""
        return max((t.radius for t in self.transitions), default=0.0)

    @property
    def proven(self) -> int:
        """Number of transitions with a proven radius."""
        return sum(t.proven for t in self.transitions)


def instants(transitions: tuple[ReferenceTransition, ...]) -> list[range]:
    """Indices of the transitions of each instant (several surfaces may change at one)."""
    sizes = [len(list(g)) for _, g in groupby(transitions, lambda t: (t.time_digits, t.from_mode, t.to_mode))]
    return [range(end - size, end) for size, end in zip(sizes, accumulate(sizes), strict=True)]


def decimal_digits(bits: int) -> int:
    """Number of decimal digits that hold a number of a precision in bits, with a few to spare."""
    return math.ceil(bits * math.log10(2)) + 5


@lru_cache(maxsize=4096)
def exact_text(number: sp.Expr, bits: int) -> str:
    """Write an exact number, such as ``sqrt(3)/9``, in decimal digits that are correct to a precision in bits.

    ModelError if it is not a real number.
    """
    digits = decimal_digits(bits)
    value = sp.N(number, digits, maxn=10 * digits)
    if not value.is_Float and not value.is_Rational:
        raise ModelError(f"{number} is not a real number")
    return str(sp.Float(value, digits))


def exact_ball(number: sp.Expr, bits: int) -> arb:
    """Convert an exact number to a ball that contains it, accurate to a precision in bits."""
    if number.is_Rational:
        return arb(int(number.p)) / arb(int(number.q))
    return arb(exact_text(number, bits + GUARD_BITS))


def to_ball(value: Any) -> arb:
    """Convert a heyoka number to a ball without radius (exact but for the last guard bits of ``flint.ctx``)."""
    return arb(str(value)).mid()


def ball_text(value: arb, radius: float) -> str:
    """Write the midpoint of a ball with two digits more than the radius justifies.

    >>> ball_text(arb(2) / 3, 1e-5)
    '0.6666667'
    """
    places = 2 - math.floor(math.log10(radius))
    with localcontext() as context:
        context.prec = 1000
        digits = Decimal(value.mid().str(max(places, 0) + 330, radius=False))
        return _decimal_text(digits.quantize(Decimal(1).scaleb(-places)) + 0)


def _decimal_text(value: Decimal) -> str:
    return format(value, "f" if -6 < value.adjusted() < STATE_DIGITS or not value else "e")


def written_radius(bound: float) -> float:
    """A radius of two digits that is above a bound, and above 0.

    >>> written_radius(9.99e-31)
    1.1e-30
    """
    return float(f"{1.1 * max(bound, sys.float_info.min):.1e}")


def with_short_state(transition: ReferenceTransition) -> ReferenceTransition:
    """Round the state of a transition to `STATE_DIGITS` significant digits and add the rounding to its radius.

    Trailing zeros are dropped. A state that has no more digits keeps its radius.
    """
    exact = [Decimal(digits) for digits in transition.state]
    with localcontext(prec=STATE_DIGITS):
        short = [(+value).normalize() for value in exact]
    with localcontext(prec=1000):
        lost = max((abs(a - b) for a, b in zip(exact, short, strict=True)), default=Decimal(0))
        bound = float(Decimal(transition.state_radius) + lost)
    radius = written_radius(bound) if lost else transition.state_radius
    return replace(transition, state=tuple(map(_decimal_text, short)), state_radius=radius)


def in_digits(
    t: EnclosedTransition, radius: float, state_radius: float, *, proven: bool = False
) -> ReferenceTransition:
    """Convert a transition in balls to decimal digits, as many as its radii justify."""
    slope = abs(float(t.rate))
    return ReferenceTransition(
        kind=t.kind,
        surface=t.surface,
        from_mode=t.from_mode,
        to_mode=t.to_mode,
        time_digits=ball_text(t.time, radius),
        radius=radius,
        state=tuple(ball_text(v, state_radius) for v in t.state),
        state_radius=state_radius,
        transversality=float(f"{slope:.6g}") if math.isfinite(slope) else 0.0,
        proven=proven,
    )
