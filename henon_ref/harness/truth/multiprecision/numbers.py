"""Conversion of exact numbers to digits and balls, and of balls to digits, without doubles and without heyoka."""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from decimal import Decimal, localcontext
from functools import lru_cache
from typing import Any

import sympy as sp
from flint import arb

from henon_ref.enclosure.run import EnclosedTransition
from henon_ref.errors import ModelError
from henon_ref.harness.truth.reference import ReferenceTransition

GUARD_BITS = 32
"""Bits by which ball arithmetic exceeds heyoka's precision, so that its rounding does not matter."""
STATE_DIGITS = 25
"""Significant digits of a state in a truth, eight more than a double has: states are compared as doubles."""


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

    Examples
    --------
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

    Examples
    --------
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
