"""Where a guard first falls through zero on a step: proofs of sign in between, interval Newton for the root."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from typing import Literal

from flint import arb

from henon_ref.enclosure.enclosure import Curve, Tail, UndecidedError, interval

DEPTH = 90
"""Bisections before a sign counts as not provable."""
PIECES = 4000
"""Pieces of one step looked at before the search gives up."""
RECENTRE = 5
"""After so many bisections the polynomial is written around the piece that is left."""
SPLIT = 0.4837
"""Where an interval is split: off the middle, so that a root at a round place is not hit."""


@dataclass(frozen=True)
class Root:
    """One transversal zero in [low, high]: the guard is positive before it and negative after it."""

    low: float
    high: float
    curve: Curve
    """The guard, written around a point near by."""


@dataclass(frozen=True)
class Scan:
    """What a guard does on a step."""

    root: Root | None
    """Where it first falls through zero (None: it does not)."""
    armed: bool
    """Whether it has been positive by the end of the step."""


def guard_curve(coefficients: Sequence[arb], deviations: Sequence[arb], tails: Sequence[Tail], zeros: int) -> Curve:
    """A guard over a set of solutions, divided by ``s**zeros``.

    Parameters
    ----------
    coefficients : sequence of arb
        Along the centre of the set.
    deviations : sequence of arb
        How far each coefficient strays over the set (as many as are known; the rest is in the tails).
    tails : sequence of Tail
    zeros : int
        How many coefficients are known to vanish on the true solution: a start on the surface has one, a
        start on it with zero normal velocity two. Dividing by s leaves their sign beyond the start provable.
    """
    total = [c + d for c, d in zip(coefficients, deviations, strict=False)]
    total += list(coefficients[len(deviations) :])
    if zeros:
        tails = [Tail(t.power - zeros, t.bound / t.radius**zeros * (1 + 2.0**-40), t.radius) for t in tails]
    return Curve.of(total[zeros:], tails)


def scan(curve: Curve, end: float, armed: bool, name: str) -> Scan:
    """Find the first fall through zero in (0, end], or prove that there is none.

    Parameters
    ----------
    curve : Curve
    end : float
    armed : bool
        True: the guard is positive just after 0. False: it may be negative, and counts once it has risen.
    name : str
        The guard in words, for the reason where nothing can be proven.

    Raises
    ------
    UndecidedError
        Where some piece shows neither a strict sign nor a strict slope: a graze, or a start with no sign.
    """
    stack = [(0.0, end, 0, curve)]
    positive = False  # whether the left end of the next piece is known to be positive
    for _ in range(PIECES):
        if not stack:
            return Scan(None, armed)
        low, high, depth, curve = stack.pop()
        value, slope = curve.over(low, high)
        sign = _sign(value)
        if sign > 0:
            positive = armed = True
            continue
        if sign < 0 and not armed:
            positive = False
            continue
        shape = _monotone(curve, low, high, _sign(slope), positive)
        if armed and low == 0.0 and (sign < 0 or shape == "rises"):
            raise UndecidedError(f"{name} is negative where it should start positive", "start")
        if shape == "falls":
            return Scan(Root(low, high, curve), True)
        if shape in ("stays positive", "rises"):
            positive = armed = True
            continue
        if shape == "stays negative" and not armed:
            positive = False
            continue
        middle = low + (high - low) * SPLIT
        if depth >= DEPTH or not low < middle < high:
            raise UndecidedError(_graze(name, low, value), "graze", low)
        if (depth + 1) % RECENTRE == 0:
            curve = curve.recentred(middle)
        stack += [(middle, high, depth + 1, curve), (low, middle, depth + 1, curve)]
    raise UndecidedError(f"{name} comes too near to zero too often to be told apart from it", "graze")


Shape = Literal["falls", "rises", "stays positive", "stays negative", "unknown"]


def _monotone(curve: Curve, low: float, high: float, slope: int, positive: bool) -> Shape:
    """What a piece does whose slope has a strict sign."""
    if slope == 0:
        return "unknown"
    first = 1 if positive else _sign(curve.at(arb(low)))
    last = _sign(curve.at(arb(high)))
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
        return f"{name} starts at zero to all digits: on which side it is cannot be told"
    return (
        f"{name} touches zero or comes so near to it (within {abs(value).upper().str(3, radius=False)}) with no "
        "strict slope that an event can be neither proven nor excluded: a graze"
    )


def _sign(ball: arb) -> int:
    if ball > 0:
        return 1
    return -1 if ball < 0 else 0


def refine(root: Root) -> arb:
    """Interval Newton: the ball that holds the one zero in a bracket, for every solution of the set."""
    curve = root.curve
    ball = interval(root.low, root.high)
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
    """The guard that falls first on (0, end], with the ball of its root.

    Returns
    -------
    hit : (index, ball) or None
    armed : list of bool
        For every guard, whether it has been positive by the end (or by the hit). No guard but the one hit is
        left unproven before the hit, or before the end.

    Raises
    ------
    UndecidedError
        Where a sign cannot be proven, or two guards fall at times that cannot be told apart (``tie``).
    """
    found: list[tuple[int, Root]] = []
    armed = [was for _, was, _ in curves]
    for index, (curve, was, name) in enumerate(curves):
        result = scan(curve, end, was, name)
        armed[index] = result.armed
        if result.root is not None:
            found.append((index, result.root))
            end = min(end, result.root.high)
    # A root found before a shorter end may lie beyond it; its own bracket tells.
    roots = [(index, refine(root)) for index, root in found]
    if not roots:
        return None, armed
    first_index, first = min(roots, key=lambda item: float(item[1].mid()))
    for index, ball in roots:
        if index != first_index and not first < ball:
            names = f"{curves[first_index][2]} and {curves[index][2]}"
            reason = f"{names} fall at times that cannot be told apart: a tie"
            raise UndecidedError(reason, "tie", float(first.mid()))
    return (first_index, first), armed
