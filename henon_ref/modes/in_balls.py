"""Modes of a system in balls of python-flint: what cannot be told from zero at a point known to a radius is zero."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import sympy as sp
from flint import arb

from henon_ref.modes.arithmetic import CLEAR
from henon_ref.modes.mode_evaluation import ExactTapes, ModeEvaluation
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.rules import FUNCTIONS
from henon_ref.taylor.series import Ring, expand
from henon_ref.taylor.tape import Tape, build_tape

DIGITS = 75
"""Of the constants: more than the precision holds."""
RING = Ring({name: getattr(arb, name) for name in (*FUNCTIONS, "sqrt")}, arb.__pow__)


class Balls:
    """The arithmetic of balls, whose radii say how far they may be off."""

    ring = RING
    levels = (0.0,)
    carries_errors = True

    def number(self, exact: sp.Expr) -> arb:
        """An exact number, to more digits than the precision holds."""
        return arb(str(sp.N(exact, DIGITS))).mid()

    def text(self, t: arb) -> str:
        """A time as messages have it."""
        return f"{float(t):.17g}"

    def rate(self, states: Sequence[Sequence[arb]], outputs: Sequence[Sequence[arb]]) -> float:
        """1: each coefficient is told from zero by itself; ValueError where some are not finite."""
        if not all(c.is_finite() for series in outputs for c in series):
            raise ValueError("a derivative is not finite")
        return 1.0

    def leading(self, series: Sequence[arb], first: int, rate: float, size: float, zero: float) -> int | None:
        """Index of the first coefficient from ``first`` on that excludes zero, or None."""
        return next((k for k in range(first, len(series)) if not series[k].contains(0)), None)

    def end_of_hold(self, series: Sequence[arb], ends: Sequence[Sequence[arb]], rate: float, zero: float) -> int | None:
        """The same."""
        return self.leading(series, 0, rate, 0.0, zero)

    def negative(self, value: arb, size: arb, part: float = CLEAR) -> bool:
        """Whether all of a ball is below zero."""
        return bool(value < 0)

    def equal(self, one: Sequence[arb], other: Sequence[arb]) -> bool:
        """Whether the balls of two series overlap."""
        return all(a.overlaps(b) for a, b in zip(one, other, strict=True))


BALLS = Balls()


def ball_function(tape: Tape, constants: Sequence[arb]) -> Callable[..., list[arb]]:
    """(t, *x) -> the values of a tape's outputs."""

    def values(t: arb, *x: arb | int) -> list[arb]:
        return [series[0] for series in expand(tape, constants, t, [arb(v) for v in x], 0, RING)[1]]

    return values


class _Tapes(ExactTapes):
    def function(self, names: Sequence[sp.Symbol], expressions: Sequence[sp.Expr]) -> Callable[..., list[Any]]:
        tape = build_tape(tuple(names), (), tuple(expressions))
        return ball_function(tape, self.constants(tape))


def in_balls(system: FilippovSystem, values: FilippovSystem | None = None) -> ModeEvaluation:
    """The modes of a system in balls of the working precision; see :func:`henon_ref.modes.in_doubles.in_doubles`."""
    return ModeEvaluation(system, BALLS, _Tapes(system, values, BALLS.number))
