"""Recurrences of functions of time alone: a linear function (clock), and its sine and cosine."""

from __future__ import annotations

import math

from henon_ref.jit.ir_writer import LANES, ONE, ZERO, IRWriter, Value, literal
from henon_ref.taylor.llvm.coefficients import Constants
from henon_ref.taylor.llvm.sin_cos import sin_cos


class Clock:
    """y = c0 + c1 t in double-double, so that a phase is accurate at large times."""

    def __init__(self, w: IRWriter, constants: Constants, start: int, slope: int, order: int) -> None:
        self.w, self.constants, self.start, self.slope, self.order = w, constants, start, slope, order
        self._phase: tuple[str, str] = ZERO, ZERO
        self._powers_and_sines: tuple[list[str], tuple[str, str]] | None = None

    def coefficient(self, k: int) -> Value:
        if k == 0:
            return self._value()
        return self.w.mul(self.constants.value(self.slope), "%unit") if k == 1 else None

    def _value(self) -> str:
        w, constants = self.w, self.constants
        slope = constants.value(self.slope)
        product = w.binary("fmul", slope, "%t_hi")
        error = w.call("fma", slope, "%t_hi", w.emit(f"fneg double {product}"))
        error = w.binary("fadd", error, w.binary("fmul", constants.lost(self.slope), "%t_hi"))
        error = w.binary("fadd", error, w.binary("fmul", slope, "%t_lo"))
        shift = constants.value(self.start)
        total = w.binary("fadd", product, shift)  # two-sum
        part = w.binary("fsub", total, product)
        lost = w.binary(
            "fadd",
            w.binary("fsub", product, w.binary("fsub", total, part)),
            w.binary("fsub", shift, part),
        )
        low = w.binary("fadd", w.binary("fadd", error, lost), constants.lost(self.start))
        self._phase = total, low
        return w.binary("fadd", total, low)

    def powers_and_sines(self) -> tuple[list[str], tuple[str, str]]:
        """Powers of c1 unit up to the order, as vectors (none for order 0), and sine and cosine of c0 + c1 t."""
        if self._powers_and_sines is None:
            powers: list[str] = []
            if self.order:
                rate = self.w.mul(self.constants.value(self.slope), "%unit")
                powers = powers_of(self.w, rate or ZERO, -(-(self.order + 1) // LANES))
            self._powers_and_sines = powers, sin_cos(self.w, *self._phase)
        return self._powers_and_sines


class SineOfTime:
    """y = sin or cos of c0 + c1 t: coefficient k is (c1 unit)^k / k! times one of +-sin, +-cos."""

    def __init__(self, w: IRWriter, op: str, clock: Clock) -> None:
        self.w, self.op, self.clock = w, op, clock
        self._row: list[Value] = []

    def coefficient(self, k: int) -> Value:
        if k == 0:
            self._row = self._all()
        return self._row[k]

    def _all(self) -> list[Value]:
        w = self.w
        powers, (s, c) = self.clock.powers_and_sines()
        row: list[Value] = [s if self.op == "sin" else c]
        pattern = [s, c, w.neg(s), w.neg(c)] if self.op == "sin" else [c, w.neg(s), w.neg(c), s]
        cycle = w.vector([value or ZERO for value in pattern])
        for v, power in enumerate(powers):
            inverse = [literal(1.0 / math.factorial(v * LANES + i)) for i in range(LANES)]
            vector = w.lanewise("fmul", LANES, power, w.lanewise("fmul", LANES, cycle, w.vector(inverse)))
            row += [w.lane(LANES, vector, i) for i in range(LANES) if v + i > 0]
        return row


def powers_of(w: IRWriter, x: str, vectors: int) -> list[str]:
    """x^0, x^1, ... as vectors."""
    square = w.binary("fmul", x, x)
    powers = [w.vector([ONE, x, square, w.binary("fmul", square, x)])]
    if vectors > 1:
        jump = w.binary("fmul", square, square)
        stride = w.vector([jump] * LANES)
        powers.append(w.lanewise("fmul", LANES, powers[0], stride))
    if vectors > 2:
        stride = w.lanewise("fmul", LANES, stride, stride)
        for v in range(2, vectors):
            powers.append(w.lanewise("fmul", LANES, powers[v - 2], stride))
    return powers
