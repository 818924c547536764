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

ORDER = 192
"""Highest order of an expansion; it ends before where its terms count for nothing."""
NEGLIGIBLE = 1e-50
"""What counts for nothing, relative to the sum of all terms on the step."""
LEAST = 48
"""Order before which it does not end: terms may be missing at first."""
QUIET = 4
"""So many orders in a row that count for nothing end an expansion."""
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
        self, mode: Mode, guard: int, time: arb, state: Sequence[arb], reach: float
    ) -> tuple[list[arb_poly], arb_poly]:
        """The states and a guard as polynomials in the time since the start.

        Parameters
        ----------
        mode, guard
            Which guard of which mode, in the order of :meth:`FilippovSystem.equations`.
        time, state
            The start.
        reach : float
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
            return values[: len(state)], values[tape.outputs[guard]]
        states, outputs = expand(tape, made.numbers, time, state, ORDER, _RING, _Fading(len(state), guard, reach))
        return [arb_poly(series) for series in states], arb_poly(outputs[guard])

    def _made(self, mode: Mode) -> _ModeTape:
        equations = self.system.equations(mode)
        tape = build_tape(self.system.states, equations.field, [g.expression for g in equations.guards])
        numbers = [arb(str(sp.N(self.system.numeric(c), 75))).mid() for c in tape.constants]
        return _ModeTape(tape, numbers, [arb_poly([number]) for number in numbers])


class _Fading:
    """Tells when the terms of an expansion, of all states and one output, no longer count on a step."""

    def __init__(self, states: int, output: int, reach: float) -> None:
        self.output, self.reach = output, arb(reach)
        self.sizes = [0.0] * (states + 1)
        self.power, self.order, self.quiet = arb(1), 0, 0

    def __call__(self, states: Sequence[Sequence[arb]], outputs: Sequence[Sequence[arb]]) -> bool:
        counts = False
        for i, series in enumerate((*states, outputs[self.output])):
            term = abs(float(series[-1] * self.power))
            self.sizes[i] += term
            counts = counts or not term <= NEGLIGIBLE * self.sizes[i]
        self.quiet = 0 if counts else self.quiet + 1
        self.power, self.order = self.power * self.reach, self.order + 1
        return self.quiet >= QUIET and self.order > LEAST
