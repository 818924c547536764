"""The motion of a mode in multiprecision, as polynomials: exact ones where it is one, else Taylor's of high order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import sympy as sp
from flint import arb, arb_poly

from henon_ref.model.modes import Mode
from henon_ref.model.system import FilippovSystem
from henon_ref.taylor.expand import Ring, expand
from henon_ref.taylor.polynomials import Plan, function, plan, polynomials
from henon_ref.taylor.tape import Tape, build_tape

ORDER = 192
"""Highest order of an expansion; it ends before where its terms count for nothing."""
NEGLIGIBLE = 1e-50
"""What counts for nothing, relative to the sum of all terms on the step."""
ORDERS = (48, 96, ORDER)
"""Orders of a function of polynomials."""
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
    plans: dict[int, Plan | None] = field(default_factory=dict)


class Motions:
    """Multiprecision tapes of one system, made when they are first needed."""

    def __init__(self, system: FilippovSystem) -> None:
        self.system = system
        self._tapes: dict[Mode, _ModeTape] = {}

    def polynomials(
        self, mode: Mode, guard: int, time: arb, state: Sequence[arb], unit: arb
    ) -> tuple[list[arb_poly], arb_poly]:
        """The states and a guard as polynomials in the time since the start, in units of ``unit``.

        Parameters
        ----------
        mode, guard
            Which guard of which mode, in the order of :meth:`FilippovSystem.equations`.
        time, state
            The start.
        unit : arb
            How far on the polynomials have to hold.
        """
        if mode not in self._tapes:
            self._tapes[mode] = self._made(mode)
        made = self._tapes[mode]
        tape = made.tape
        if guard not in made.plans:
            made.plans[guard] = plan(tape, guard)
        known = made.plans[guard]
        if known is not None:
            values = polynomials(known.motion, tape, made.constants, time, state, unit)
            if not known.functions:
                return values[: len(state)], values[tape.outputs[guard]]
            for order in ORDERS:
                series = function(known, tape, made.numbers, values, guard, order)
                if series.length() <= order or _faded([series.coeffs()]):
                    break
            return values[: len(state)], series

        def enough(x: Sequence[Sequence[arb]], y: Sequence[Sequence[arb]]) -> bool:
            """Looked at now and then."""
            return len(x[0]) > LEAST and len(x[0]) % QUIET == 1 and _faded([*x, y[guard]])

        states, outputs = expand(tape, made.numbers, time, state, ORDER, _RING, unit, enough)
        return [arb_poly(series) for series in states], arb_poly(outputs[guard])

    def _made(self, mode: Mode) -> _ModeTape:
        equations = self.system.equations(mode)
        tape = build_tape(self.system.states, equations.field, [g.expression for g in equations.guards])
        numbers = [arb(str(sp.N(self.system.numeric(c), 75))).mid() for c in tape.constants]
        return _ModeTape(tape, numbers, [arb_poly([number]) for number in numbers])


def _faded(rows: Sequence[Sequence[arb]]) -> bool:
    """True if the last terms of some series count for nothing where their variable is 1."""
    sizes = (list(map(abs, map(float, row))) for row in rows)
    return all(max(terms[-QUIET:]) <= NEGLIGIBLE * sum(terms) for terms in sizes)
