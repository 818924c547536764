"""A closer look at an event that double precision cannot decide: a pair of roots, a touch, or a miss.

The Taylor polynomial of the step is made again from the same tape with 60 digits and twice the order, and
the guard's minimum decides. The state at the step's start is taken as it is (its rounded part included).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import mpmath
import sympy as sp

from henon_ref.model.modes import Mode
from henon_ref.model.system import FilippovSystem
from henon_ref.taylor.expand import Ring, expand
from henon_ref.taylor.tape import Tape, build_tape

DIGITS = 60
ORDER = 48
NOTHING = mpmath.mpf(10) ** -50
"""Relative size below which a value found with 60 digits counts as zero."""
_NAMES = ("sin", "cos", "tan", "sinh", "cosh", "tanh", "asin", "acos", "atan", "exp", "log", "sqrt")
_RING = Ring({name: getattr(mpmath, name) for name in _NAMES}, mpmath.power)
Pair = tuple[float, float]


@dataclass(frozen=True)
class Finding:
    """What a guard does near a doubtful point."""

    what: Literal["root", "touch", "miss"]
    offset: float
    """From the step's start to the root, or to the guard's minimum."""
    time: Pair
    """That time, and what rounding it lost."""
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
        """Find the guard's first root near a point, or its minimum there.

        Parameters
        ----------
        mode, guard
            Which guard of which mode.
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
            q = outputs[guard][zeros:]
            what, tau = _first_root(q, mpmath.mpf(near), mpmath.mpf(reach))
            end = [_split(_value(series, tau)) for series in states]
            return Finding(what, float(tau), _split(start + tau), tuple(end))


def _split(number: mpmath.mpf) -> Pair:
    high = float(number)
    return high, float(number - mpmath.mpf(high))


def _value(series: Sequence[mpmath.mpf], tau: mpmath.mpf) -> mpmath.mpf:
    return mpmath.polyval(list(reversed(series)), tau)


def _derivative(series: Sequence[mpmath.mpf]) -> list[mpmath.mpf]:
    return [k * c for k, c in enumerate(series)][1:]


def _newton(series: Sequence[mpmath.mpf], tau: mpmath.mpf) -> mpmath.mpf | None:
    """A root of a polynomial near tau, or None."""
    slope = _derivative(series)
    for _ in range(60):
        below = _value(slope, tau)
        if below == 0:
            return None
        step = _value(series, tau) / below
        tau -= step
        if abs(step) <= abs(tau) * mpmath.mpf(10) ** (8 - DIGITS):
            return tau
    return None


def _is_touch(q: Sequence[mpmath.mpf], tau: mpmath.mpf, size: mpmath.mpf) -> bool:
    """True where q and its slope are zero to many more digits than a double has."""
    return abs(_value(q, tau)) <= size * NOTHING and abs(_value(_derivative(q), tau)) * tau <= size * NOTHING


def _first_root(
    q: Sequence[mpmath.mpf], near: mpmath.mpf, reach: mpmath.mpf
) -> tuple[Literal["root", "touch", "miss"], mpmath.mpf]:
    slope = _derivative(q)
    size = sum(abs(c) * reach**k for k, c in enumerate(q))
    higher = slope
    for _ in range(2):  # touches of fourth and higher order: roots of higher derivatives
        higher = _derivative(_derivative(higher))
        candidate = _newton(higher, near)
        if candidate is not None and 0 < candidate < 2 * reach and _is_touch(q, candidate, size):
            return "touch", candidate
    lowest = _newton(slope, near)
    if lowest is not None and 0 < lowest < 2 * reach:
        depth, bend = _value(q, lowest), _value(_derivative(slope), lowest) / 2
        if bend > 0 and abs(depth) <= size * NOTHING:
            return "touch", lowest
        if bend > 0 and depth > 0:
            return "miss", lowest
        if bend > 0:
            root = _newton(q, lowest - mpmath.sqrt(-depth / bend))
            if root is not None and 0 < root <= lowest:
                return "root", root
    root = _newton(q, near)
    if root is None or not 0 < root < 2 * reach:
        return "root", near
    return "root", root
