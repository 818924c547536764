"""A closer look at an event that double precision cannot decide: a pair of roots, a touch, or a miss.

The Taylor polynomial of the step is made again from the same tape with 60 digits and twice the order, and
its roots are isolated as in :mod:`henon_ref.henon.polynomial`, in integers of 220 bits. The state at the
step's start is taken as it is (its rounded part included).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import comb
from typing import Literal

import mpmath
import sympy as sp

from henon_ref.model.modes import Mode
from henon_ref.model.system import FilippovSystem
from henon_ref.taylor.expand import Ring, expand
from henon_ref.taylor.tape import Tape, build_tape

DIGITS = 60
ORDER = 48
BITS = 220
"""Bits after the point of a polynomial's coefficients, its size on the step being 1."""
NOTHING = 2 ** (BITS - 166)
"""What counts as zero among them: 1e-50 of the polynomial's size."""
SAME = mpmath.mpf(10) ** -10
"""Minima closer to each other, in units of the step, are one and the same."""
DEPTH = 200
"""Halvings of the step before what is left of it counts as a point."""
_NAMES = ("sin", "cos", "tan", "sinh", "cosh", "tanh", "asin", "acos", "atan", "exp", "log", "sqrt")
_RING = Ring({name: getattr(mpmath, name) for name in _NAMES}, mpmath.power)
Pair = tuple[float, float]
What = Literal["root", "touch", "miss"]
Series = Sequence[mpmath.mpf]


@dataclass(frozen=True)
class Finding:
    """What a guard does near a doubtful point."""

    what: What
    lowest: bool
    """True where the guard has a minimum there (a touch, or a miss)."""
    time: Pair
    """The time of the root or the minimum, and what rounding it lost."""
    state: tuple[Pair, ...]
    """State there."""


class CloserLook:
    """Multiprecision tapes of one system, made when they are first needed."""

    def __init__(self, system: FilippovSystem) -> None:
        self.system = system
        self._tapes: dict[Mode, tuple[Tape, list[mpmath.mpf]]] = {}

    def _tape(self, mode: Mode) -> tuple[Tape, list[mpmath.mpf]]:
        if mode not in self._tapes:
            equations = self.system.equations(mode)
            tape = build_tape(self.system.states, equations.field, [g.expression for g in equations.guards])
            numbers = [mpmath.mpf(str(sp.N(self.system.numeric(c), DIGITS + 10))) for c in tape.constants]
            self._tapes[mode] = (tape, numbers)
        return self._tapes[mode]

    def look(
        self, mode: Mode, guard: int, zeros: int, time: Pair, state: Sequence[Pair], near: float, reach: float
    ) -> Finding:
        """Find the guard's first root up to a doubtful point, or its minimum there.

        Parameters
        ----------
        mode, guard
            Which guard of which mode, in the order of :meth:`FilippovSystem.equations`.
        zeros : int
            Known zeros of the guard at the step's start.
        time, state
            The step's start, each as two doubles that add up to it.
        near : float
            Where double precision saw the doubtful point, counted from the start.
        reach : float
            End of the step.
        """
        with mpmath.workdps(DIGITS):
            tape, numbers = self._tape(mode)
            start = mpmath.mpf(time[0]) + mpmath.mpf(time[1])
            x = [mpmath.mpf(high) + mpmath.mpf(low) for high, low in state]
            states, outputs = expand(tape, numbers, start, x, ORDER, _RING)
            # A root that rounding has put on the step's end may lie just behind it.
            unit = mpmath.mpf(reach) * (1 + mpmath.mpf(2) ** -46)
            q = [c * unit ** (zeros + k) for k, c in enumerate(outputs[guard][zeros:])]
            what, lowest, part = _decided(q, zeros, mpmath.mpf(near) / unit)
            tau = part * unit
            end = [_split(_value(series, tau)) for series in states]
            return Finding(what, lowest, _split(start + tau), tuple(end))


def _split(number: mpmath.mpf) -> Pair:
    """A number as two doubles; what is lost to the second, too, would only make it miss round numbers."""
    high = float(number)
    low = float(number - mpmath.mpf(high))
    return high, (low if abs(low) > 2.0**-106 * abs(high) else 0.0)


def _value(series: Series, tau: mpmath.mpf) -> mpmath.mpf:
    return mpmath.polyval(list(reversed(series)), tau)


def _derivative(series: Series) -> list[mpmath.mpf]:
    return [k * c for k, c in enumerate(series)][1:]


def _decided(q: Series, zeros: int, near: mpmath.mpf) -> tuple[What, bool, mpmath.mpf]:
    """What q tau^zeros does on (0, 1] up to its minimum near a point: (what, at a minimum, where)."""
    outcome, low, high = first_falling_root(q)
    whole = [mpmath.mpf(0)] * zeros + list(q)
    bottom = _minimum(whole, near)
    if outcome == "touch":
        middle = (low + high) / 2
        touched = _minimum(whole, middle)
        touched = middle if touched is None else touched
        if bottom is None or touched <= bottom + SAME:
            return "touch", True, touched
    if outcome != "root" or (bottom is not None and low > bottom):  # what lies behind a minimum has to wait
        return "miss", bottom is not None, near if bottom is None else bottom
    return "root", False, _landed(q, low, high)


def first_falling_root(q: Series) -> tuple[Literal["none", "root", "touch"], mpmath.mpf, mpmath.mpf]:
    """Isolate the first root on (0, 1] through which a polynomial falls, in integers.

    Descartes' rule of signs on Bernstein coefficients, as in the compiled
    :func:`henon_ref.henon.polynomial.first_falling_root`.
    """
    degree = len(q) - 1
    size = sum(abs(c) for c in q) or mpmath.mpf(1)
    whole = [int(mpmath.ldexp(c / size, BITS)) for c in q]
    first = [sum(comb(i, k) * whole[k] // comb(degree, k) for k in range(i + 1)) for i in range(degree + 1)]
    stack = [(0, 0, first)]  # (level, place, coefficients) of the piece [place, place + 1] / 2^level
    before = 0
    while stack:
        level, place, b = stack.pop()
        low, high = mpmath.ldexp(place, -level), mpmath.ldexp(place + 1, -level)
        signs = [1 if c > 0 else -1 for c in b if abs(c) > NOTHING]
        changes = sum(x != y for x, y in pairwise(signs))
        if not signs or level >= DEPTH:
            return "touch", low, high
        if before > 0 and abs(b[0]) <= NOTHING:  # zero where the step was halved: what comes next decides
            if changes == 0:
                return ("root" if signs[0] < 0 else "touch"), low, low
        elif before > 0 and signs[0] < 0:
            return "root", low, low
        elif changes == 0 or (changes == 1 and signs[0] < 0):
            before = signs[-1]
            continue
        elif changes == 1 and abs(b[-1]) > NOTHING:
            return "root", low, high
        left, right = _halves(b)
        stack += [(level + 1, 2 * place + 1, right), (level + 1, 2 * place, left)]
    return "none", mpmath.mpf(0), mpmath.mpf(0)


def _halves(b: list[int]) -> tuple[list[int], list[int]]:
    """Bernstein coefficients on the two halves (de Casteljau)."""
    left, right = [b[0]], [b[-1]]
    while len(b) > 1:
        b = [(x + y) >> 1 for x, y in pairwise(b)]
        left.append(b[0])
        right.append(b[-1])
    return left, right[::-1]


def _landed(q: Series, low: mpmath.mpf, high: mpmath.mpf) -> mpmath.mpf:
    """The falling root of q on [low, high]: Newton's method, halving wherever it leaves the bracket."""
    slope, tau = _derivative(q), (low + high) / 2
    close = mpmath.mpf(10) ** (12 - DIGITS)
    while high - low > close * high:
        value, fall = _value(q, tau), _value(slope, tau)
        low, high = (tau, high) if value > 0 else (low, tau)
        new = tau - value / fall if fall < 0 else low
        if not low < new < high:
            new = (low + high) / 2
        if abs(new - tau) <= close * new:
            return new
        tau = new
    return tau


def _minimum(series: Series, near: mpmath.mpf) -> mpmath.mpf | None:
    """The minimum of a polynomial on [0, 1] that a point lies next to; None if there is none."""
    slope = _derivative(series)
    width = near * mpmath.mpf(2) ** -50
    low, high = near - width, near + width
    while _value(slope, low) >= 0:
        width *= 4
        low = near - width
        if low <= 0:
            return None
    while _value(slope, high) <= 0:
        width *= 4
        high = near + width
        if high > 1:
            return None
    while high - low > high * mpmath.mpf(10) ** (20 - DIGITS):
        middle = (low + high) / 2
        low, high = (middle, high) if _value(slope, middle) < 0 else (low, middle)
    return (low + high) / 2
