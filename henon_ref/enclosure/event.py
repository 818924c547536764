"""The guard that falls first on a step, and the record of its event.

Signs are proven on subintervals; the root is enclosed by interval Newton.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from typing import Literal

from flint import arb

from henon_ref.enclosure.balls import sign_of
from henon_ref.enclosure.enclosure import Curve, Tail, UndecidedError, interval
from henon_ref.enclosure.impacts import Rest
from henon_ref.modes.equations import Guard
from henon_ref.modes.mode import Mode

Bracket = tuple[float, float, Curve]
"""[low, high] of one transversal zero, the guard being positive before and negative after it; the guard near it."""


@dataclass(frozen=True)
class Hit:
    """The event of a guard that fell to zero."""

    guard: Guard
    before: Mode
    after: Mode
    box: tuple[arb, ...]
    """Enclosure of (t, x)."""
    rate: arb
    """Slope of the guard at the event [1/s]."""
    applied: tuple[tuple[int, tuple[arb, ...]], ...] = ()
    """Surfaces that reset the state, in order, each with the enclosure after its map; ``box`` is after the last map."""
    rest: Rest | None = None
    """Rest that follows at this instant, or after accumulating impacts that are not recorded."""
    recorded: bool = True
    """False for an impact after the limit of accumulating impacts was detected."""


def guard_curve(coefficients: Sequence[arb], deviations: Sequence[arb], tails: Sequence[Tail], zeros: int) -> Curve:
    """Enclose a guard over a set of solutions, divided by ``s**zeros``.

    From its coefficients along the centre of the set, and their deviations over the set; those of higher orders are
    contained in the tails. ``zeros`` is the number of leading coefficients that are exactly zero: one for a start on
    the surface, two if the normal velocity is zero too. The division keeps the sign after the start provable.
    """
    total = [c + d for c, d in zip(coefficients, deviations, strict=False)]
    total += list(coefficients[len(deviations) :])
    if zeros:
        tails = [Tail(t.power - zeros, t.bound / t.radius**zeros * (1 + 2.0**-40), t.radius) for t in tails]
    return Curve.of(total[zeros:], tails)


def scan(curve: Curve, end: float, armed: bool, name: str) -> tuple[Bracket | None, bool]:
    """Locate the first root in (0, end] at which a guard falls through zero, or prove that there is none.

    ``armed``: the guard is positive just after 0; else it may start negative, and its falls count only after it was
    positive. Returned is also whether it was positive at some time of the step. UndecidedError if neither value nor
    slope has a strict sign on some subinterval: a graze, or an undecided start.
    """
    stack = [(0.0, end, 0, curve)]
    positive = False  # whether the left end of the next subinterval is proven positive
    for _ in range(4000):
        if not stack:
            return None, armed
        low, high, depth, curve = stack.pop()
        value, slope = curve.over(low, high)
        sign = sign_of(value)
        if sign > 0:
            positive = armed = True
            continue
        if sign < 0 and not armed:
            positive = False
            continue
        shape = _monotone(curve, low, high, sign_of(slope), positive)
        if armed and low == 0.0 and (sign < 0 or shape == "rises"):
            raise UndecidedError(f"{name} is negative where it should start positive", "start")
        if shape == "falls":
            return (low, high, curve), True
        if shape in ("stays positive", "rises"):
            positive = armed = True
            continue
        if shape == "stays negative" and not armed:
            positive = False
            continue
        middle = low + (high - low) * 0.4837  # not half, so that a split point is unlikely to be a root
        if depth >= 90 or not low < middle < high:
            raise UndecidedError(_graze(name, low, value), "graze", low)
        if (depth + 1) % 5 == 0:
            curve = curve.recentred(middle)
        stack += [(middle, high, depth + 1, curve), (low, middle, depth + 1, curve)]
    raise UndecidedError(f"{name} is near zero too often for its sign to be decided", "graze")


Shape = Literal["falls", "rises", "stays positive", "stays negative", "unknown"]


def _monotone(curve: Curve, low: float, high: float, slope: int, positive: bool) -> Shape:
    """Classify a guard on a subinterval on which its slope has a strict sign."""
    if slope == 0:
        return "unknown"
    first = 1 if positive else sign_of(curve.at(arb(low)))
    last = sign_of(curve.at(arb(high)))
    if first > 0 and last < 0:
        return "falls"
    if first < 0 and last > 0:
        return "rises"
    if (first if slope > 0 else last) > 0:
        return "stays positive"
    if (last if slope > 0 else first) < 0:
        return "stays negative"
    return "unknown"


def _graze(name: str, low: float, value: arb) -> str:
    if low == 0.0:
        return f"{name} starts at zero to all digits: its side cannot be decided"
    return (
        f"{name} touches zero or comes so near to it (within {abs(value).upper().str(3, radius=False)}) with no "
        "strict slope that an event can be neither proven nor excluded: a graze"
    )


def refine(low: float, high: float, curve: Curve) -> arb:
    """Enclose the unique root, for every solution of the set, by interval Newton (Moore, 1966).

    With m the midpoint of the enclosure X, every root in X is in ``m - g(m) / g'(X)`` too.
    """
    ball = interval(low, high)
    width = inf
    while True:
        middle = ball.mid()
        slope = curve.slope(ball)
        if not slope < 0:
            raise UndecidedError("the guard's slope has no strict sign at the event: a graze", "graze")
        newton = middle - curve.at(middle) / slope
        ball = ball.intersection(newton) if ball.overlaps(newton) else newton
        new_width = float(ball.rad())
        if not new_width < 0.75 * width:
            return ball
        width = new_width


def first_root(curves: Sequence[tuple[Curve, bool, str]], end: float) -> tuple[tuple[int, arb] | None, list[bool]]:
    """Locate the guard that falls first on (0, end]: its index, with an enclosure of its root.

    Returned is also, for every guard, whether it was positive by the end or by the hit; every other guard is proven not
    to fall before that time. UndecidedError if a sign cannot be proven, or if the root enclosures of two guards overlap
    (``tie``).
    """
    found: list[tuple[int, Bracket]] = []
    armed = [was for _, was, _ in curves]
    for index, (curve, was, name) in enumerate(curves):
        bracket, armed[index] = scan(curve, end, was, name)
        if bracket is not None:
            found.append((index, bracket))
            end = min(end, bracket[1])
    # `end` shrinks during the scans; a root found before may be after it, but its bracket is still valid.
    roots = [(index, refine(*bracket)) for index, bracket in found]
    if not roots:
        return None, armed
    first_index, first = min(roots, key=lambda item: float(item[1].mid()))
    for index, ball in roots:
        if index != first_index and not first < ball:
            names = f"{curves[first_index][2]} and {curves[index][2]}"
            reason = f"{names} fall at times that cannot be told apart: a tie"
            raise UndecidedError(reason, "tie", float(first.mid()))
    return (first_index, first), armed


def first_fall(
    watched: Sequence[tuple[Curve, bool, str]], reach: float, left: float
) -> tuple[tuple[int, arb] | None, list[bool]]:
    """Locate the first guard that falls on a step of length ``reach``, with time ``left`` to the horizon."""
    beyond = left * 1.125  # an event just after the horizon is reported as a tie
    if beyond < reach:
        try:
            return first_root(watched, beyond)
        except UndecidedError:
            return first_root(watched, left)
    return first_root(watched, min(left, reach))


def guard_text(guard: Guard, names: Sequence[str]) -> str:
    if guard.kind == "valid":
        return f"valid expression {guard.index}"
    if guard.kind == "attracts":
        return f"whether sliding on {names[guard.index]} and others attracts"
    if guard.kind == "surface":
        return f"surface {names[guard.index]}"
    return f"the release of {names[guard.index]} to {guard.to_sign:+d}"
