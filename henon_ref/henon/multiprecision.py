"""The motion of a mode in multiprecision, as polynomials: exact ones where it is one, else Taylor's of high order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import sympy as sp
from flint import arb, arb_poly

from henon_ref.model.modes import Mode
from henon_ref.model.system import FilippovSystem
from henon_ref.taylor.expand import Ring, expand
from henon_ref.taylor.polynomials import Step, plan, polynomials
from henon_ref.taylor.tape import Tape, build_tape

ORDERS = (48, 96, 192)
"""Orders of the expansion, tried in turn until its last terms count for nothing."""
NEGLIGIBLE = arb(10) ** -50
"""What counts for nothing, relative to the sum of all terms."""
_NAMES = ("sin", "cos", "tan", "sinh", "cosh", "tanh", "asin", "acos", "atan", "exp", "log", "sqrt")
_RING = Ring({name: getattr(arb, name) for name in _NAMES}, arb.__pow__)


@dataclass(frozen=True)
class _ModeTape:
    """A mode's tape with its constants, and what there is to do for each guard whose motion is a polynomial."""

    tape: Tape
    numbers: list[arb]
    constants: list[arb_poly]
    plans: dict[int, list[Step] | None] = field(default_factory=dict)


class Motions:
    """Multiprecision tapes of one system, made when they are first needed."""

    def __init__(self, system: FilippovSystem) -> None:
        self.system = system
        self._tapes: dict[Mode, _ModeTape] = {}

    def polynomials(
        self, mode: Mode, guard: int, time: arb, state: Sequence[arb], reach: arb
    ) -> tuple[list[arb_poly], list[arb]]:
        """The states as polynomials in the time since the start; a guard's coefficients in units of ``reach``.

        Parameters
        ----------
        mode, guard
            Which guard of which mode, in the order of :meth:`FilippovSystem.equations`.
        time, state
            The start.
        reach : arb
            How far on the polynomials have to hold.
        """
        if mode not in self._tapes:
            self._tapes[mode] = self._made(mode)
        made = self._tapes[mode]
        tape = made.tape
        if guard not in made.plans:
            made.plans[guard] = plan(tape, guard)
        steps = made.plans[guard]
        if steps is not None:
            values = polynomials(steps, tape, made.constants, time, state)
            return values[: len(state)], _scaled(values[tape.outputs[guard]].coeffs(), reach)
        for order in ORDERS:
            states, outputs = expand(tape, made.numbers, time, state, order, _RING)
            scaled = _scaled(outputs[guard], reach)
            if max(map(abs, scaled[-4:])) <= NEGLIGIBLE * sum(map(abs, scaled), arb(0)):
                break
        return [arb_poly(series) for series in states], scaled

    def _made(self, mode: Mode) -> _ModeTape:
        equations = self.system.equations(mode)
        tape = build_tape(self.system.states, equations.field, [g.expression for g in equations.guards])
        numbers = [arb(str(sp.N(self.system.numeric(c), 75))).mid() for c in tape.constants]
        return _ModeTape(tape, numbers, [arb_poly([number]) for number in numbers])


def _scaled(series: Sequence[arb], unit: arb) -> list[arb]:
    """Coefficients of the same polynomial in another unit of its variable."""
    scaled, power = [], arb(1)
    for c in series:
        scaled.append(c * power)
        power = power * unit
    return scaled
