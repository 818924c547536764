"""heyoka's Taylor steps in multiprecision, with one integrator for all modes that share sliding surfaces or equations.

The guards are integrated together with the state, so that heyoka computes their Taylor polynomials, whose roots
:mod:`henon_ref.harness.truth.roots` isolates. heyoka's event detection is not used: it misses exact double roots, and
after an event at the start of a step it can miss the next one (its cooldown).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from typing import Any

import heyoka as hy
import numpy as np
import sympy as sp
from flint import arb
from numpy.typing import NDArray

from henon_ref.harness.truth.multiprecision.heyoka import RealParameters, to_heyoka, to_real
from henon_ref.harness.truth.multiprecision.points import ORDER, series_along
from henon_ref.harness.truth.reference import to_ball
from henon_ref.harness.truth.roots import END
from henon_ref.modes.equations import Guard, along
from henon_ref.modes.mode import Mode
from henon_ref.modes.resets import kept_zero, settled_state
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.tape import TIME

LONGEST_GAP, RISE = 16, 2.0**5
"""Without a gap the k-th last coefficient is below ``RISE**k`` [roundings of the state], for k up to ``LONGEST_GAP``;
in the shipped cases it is below (2^3.5)^k."""


@dataclass(frozen=True)
class Step:
    """One Taylor step."""

    finite: bool
    """False: the field is not finite, and the other fields are undefined."""
    time: Any
    """Start of the step [s], a heyoka number."""
    length: Any
    """Length [s], a heyoka number."""
    coefficients: NDArray[Any]
    """(states + guards, order + 1) heyoka numbers, in units of the step."""
    rough: NDArray[np.float64]
    """The coefficients in double precision."""


@lru_cache(maxsize=64)
def _integrator(variables: tuple[Any, ...], rhs: tuple[Any, ...], bits: int, parameters: int, level: int) -> Any:
    """Integrator, compiled once for all fields that differ only in their numbers, with an optimization level of LLVM.

    Its users must set time, state and parameters before each use.
    """
    zero = hy.real("0", bits)
    return hy.taylor_adaptive(
        list(zip(variables, rhs, strict=True)),
        [zero] * len(rhs),
        fp_type=hy.real,
        prec=bits,
        pars=[zero] * parameters,
        compact_mode=True,
        opt_level=level,
    )


def _unless_constant(slope: sp.Expr, system: FilippovSystem, sliding: Collection[int]) -> sp.Expr:
    """A guard's derivative; 0 if it is zero on the surfaces that the state slides or rests on.

    An enclosure of the difference of two equal velocities contains zero but does not prove it.
    """
    kept = slope
    for _ in sliding:
        for i in sliding:
            zero = system.numeric(kept_zero(system, i)[-1])
            kept = kept.xreplace(settled_state(zero, system.states))
    return sp.S.Zero if sp.expand(kept) == 0 else slope


class Stepper:
    """Integrator of all modes that share their equations with a given mode.

    ``bits``: precision, from which heyoka chooses its order and steps.
    """

    def __init__(self, system: FilippovSystem, mode: Mode, bits: int) -> None:
        self.bits, self._system = bits, system
        self._shared = system.shared
        self.guards: tuple[Guard, ...] = ()
        """Guards of the mode, in the order of its equations."""
        if self._shared is not None:
            written, ends = self._shared.field, self._shared.outputs
        else:
            _, equations = system.common_equations(mode)
            written, self.guards = equations.field, equations.guards
            ends = tuple(g.expression for g in self.guards)
        field, outputs = [system.numeric(f) for f in written], [system.numeric(g) for g in ends]
        slopes = [along(g, system.states, tuple(field)) for g in outputs]
        sliding = [i for i, s in enumerate(mode) if s == 0] if self._shared is None else []
        slopes = [_unless_constant(slope, system, sliding) for slope in slopes]
        self._dimension = len(field)
        self._rows = list(range(len(field), len(field) + len(outputs)))
        """Rows of the guards' coefficients."""
        names = [f"y{i}" for i in range(len(field) + len(slopes))]
        variables = hy.make_vars(*names) if len(names) > 1 else [hy.make_vars(*names)]
        symbols: dict[sp.Symbol, Any] = {TIME: hy.time}
        symbols.update(zip(system.states, variables, strict=False))
        switches = system.signs if self._shared is None else tuple(self._shared.owner)
        self._values: dict[sp.Symbol, sp.Expr] = {}
        self._rhs = [*field, *slopes]
        self._switches = [tuple(e.free_symbols.intersection(switches)) for e in self._rhs]
        """Switches in each row."""
        self._own: dict[tuple[int, tuple[sp.Expr, ...]], sp.Expr] = {}
        self._parabolas: dict[int, bool] = {}
        """Whether a row is a parabola in the present mode."""
        self._places = {x: i for i, x in enumerate(system.states)}
        self._numbers = RealParameters(bits)
        rhs = tuple([to_heyoka(e, symbols, self._numbers, switches) for e in self._rhs])
        self._shortened: Any = None
        """Length of the last step if heyoka's choice of it was shortened, else None."""
        # Level 1: steps take 0.8 of the time, compilation two to three times as long, which pays only if it is shared.
        level = 0 if self._shared is None else 1
        self._integrator = _integrator(tuple(variables), rhs, bits, len(self._numbers), level)

    @property
    def order(self) -> int:
        return int(self._integrator.order)

    def start(self, mode: Mode, time: arb, state: Sequence[arb], guards: Sequence[arb]) -> None:
        """Set the mode, the initial point, and the guards' values at the point."""
        integrator, outputs = self._integrator, list(guards)
        if self._shared is None:
            self._values = self._system.entries(mode)
        else:
            self.guards = self._system.equations(mode).guards
            self._rows = [self._dimension + row for row in self._shared.rows(mode)]
            outputs = [guards[place] if place >= 0 else arb(1) for place in self._shared.places(mode)]
            self._values = self._shared.values(mode)
        integrator.pars[:] = self._numbers.values(self._values)
        integrator.state[:] = [to_real(v, self.bits) for v in (*state, *outputs)]
        integrator.time = to_real(time, self.bits)
        self._shortened, self._parabolas = None, {}

    def step(self, limit: arb) -> Step:
        """Take one step, not beyond a time; shorten it if heyoka's choice of its length is not confirmed.

        Near a singularity every step is shortened, so the next step starts with twice the length of the last one.
        """
        integrator, two = self._integrator, hy.real("2", self.bits)
        begin, state = integrator.time, integrator.state.copy()
        room = to_real(limit, self.bits) - begin
        if self._shortened is not None:
            room = min(room, self._shortened * two)
        self._shortened = None
        for _ in range(100):
            outcome, length = integrator.step(room, write_tc=True)
            step = self._scaled(begin, length, outcome)
            if not step.finite or self._trusted(step):
                return step
            integrator.time, integrator.state[:] = begin, state
            room = self._shortened = length / two
        return replace(step, finite=False)

    def _scaled(self, begin: Any, length: Any, outcome: Any) -> Step:
        """The last step of heyoka, in units of its length."""
        finite = outcome in (hy.taylor_outcome.success, hy.taylor_outcome.time_limit)
        powers = [hy.real("1", self.bits)]
        for _ in range(self.order):
            powers.append(powers[-1] * length)
        scaled = self._integrator.tc * np.array(powers)
        with np.errstate(invalid="ignore"):  # the field may not be finite
            return Step(finite, begin, length, scaled, scaled.astype(float))

    def _trusted(self, step: Step) -> bool:
        """Check whether the polynomials approximate the solution on the whole step.

        heyoka chooses the length from the last two coefficients, which are then of the size of rounding. If a symmetry
        of the state makes them zero, those before them may be large: the step is too long. heyoka also assumes that
        later coefficients are smaller. If a drive is almost constant at first (a pulse in the far future, with tiny
        derivatives now), later coefficients are larger, and the step would miss the pulse. For rows whose coefficients
        do not decrease, Lagrange's remainder of order ``ORDER`` is therefore enclosed over the step; accepted
        are 1000 times the solution's change on the step, and rounding.
        """
        tails = [np.abs(row[-4:]) for row in step.coefficients]
        rounding = 2.0**-self.bits * max(1.0, float(np.abs(step.rough[:, 0]).max()))
        if (np.abs(step.rough[:, -LONGEST_GAP:-2]) > rounding * RISE ** np.arange(LONGEST_GAP, 2, -1)).any():
            return False
        rows = [i for i, c in enumerate(tails) if not max(c[2], c[3]) * hy.real("2", self.bits) < max(c[0], c[1])]
        rows = [i for i in rows if not self._is_parabola(i)]
        if not rows:
            return True
        variations = np.abs(step.rough[:, 1:]).sum(axis=1)
        box = [to_ball(c) + arb(0, 1.01 * v) for c, v in zip(step.coefficients[:, 0], variations, strict=True)]
        length = to_ball(step.length)
        time = (to_ball(step.time) + length / 2) + arb(0, length.upper() / 2)
        rhs = [self._in_mode(i) for i in range(len(self._rhs))]
        n = self._dimension
        try:
            slopes = series_along(rhs[:n], [rhs[i] for i in rows], self._system.states, time, box[:n], bits=self.bits)
        except (ZeroDivisionError, ValueError):
            return False
        floor = 2.0 ** (8 - self.bits) * max(1e-300, float(np.abs(step.rough).max()))
        return all(
            bool(abs(c[-1]) * length ** (ORDER + 1) <= max(1e3 * variations[i], floor))
            for i, c in zip(rows, slopes, strict=True)
        )

    def _in_mode(self, row: int) -> sp.Expr:
        """Derivative of a row's polynomial in the mode."""
        key = row, tuple(self._values[s] for s in self._switches[row])
        if key not in self._own:
            self._own[key] = self._rhs[row].xreplace(self._values)
        return self._own[key]

    def _is_parabola(self, row: int) -> bool:
        """Whether a row has degree 2 at most: its rate is linear in time and in states whose rates are constant."""
        if row not in self._parabolas:
            rate, places = self._in_mode(row), self._places
            still = (s == TIME or (s in places and self._in_mode(places[s]).is_number) for s in rate.free_symbols)
            self._parabolas[row] = all(still) and _is_linear(rate)
        return self._parabolas[row]

    def state_at(self, time: arb) -> list[arb]:
        """State within the last step, or slightly after it."""
        output = self._integrator.update_d_output(to_real(time, self.bits))
        return [to_ball(v) for v in output[: self._dimension]]

    def end(self) -> tuple[arb, list[arb]]:
        """Time and state after the last step."""
        return to_ball(self._integrator.time), [to_ball(v) for v in self._integrator.state[: self._dimension]]

    def guard_at_end(self, guard: int) -> float:
        return float(to_ball(self._integrator.state[self._rows[guard]]))

    def guard_polynomial(self, step: Step, guard: int) -> list[arb]:
        """Coefficients of a guard on a step, in units of the step."""
        return [to_ball(c) for c in step.coefficients[self._rows[guard]]]

    def sizes(self, step: Step) -> list[float]:
        """Bound of each state's absolute value on a step."""
        return [float(s) for s in np.abs(step.rough[: self._dimension]).sum(axis=1)]

    def clear_until(self, step: Step, guard: int, skipped: int) -> float:
        """End of the part of the step on which double precision shows that a guard has no root, in units of the step.

        ``skipped``: number of leading coefficients that are known to be zero.
        """
        c = step.rough[self._rows[guard], skipped:]
        if not np.isfinite(c).all():
            return 0.0
        ends, at_ends, at_middles = _pieces(len(c))
        values = np.abs(at_middles @ c)
        slopes = at_ends[:, :-1] @ (np.arange(1, len(c)) * np.abs(c[1:]))
        unclear = ~(values > slopes * ends[0] / 2 + 1e-9 * np.abs(c).sum())
        return float(ends[unclear.argmax()] - ends[0]) if unclear.any() else math.inf


@lru_cache(maxsize=4096)
def _is_linear(rate: sp.Expr) -> bool:
    return not any(sp.diff(rate, s).free_symbols for s in rate.free_symbols)


@cache
def _pieces(terms: int) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Ends of 16 subintervals of a step, and Vandermonde matrices (16, terms) of the ends and of the midpoints.

    Double precision first tries to show on them that a guard has no root.
    """
    ends = END * np.arange(1, 17) / 16
    return ends, np.vander(ends, terms, increasing=True), np.vander(ends - ends[0] / 2, terms, increasing=True)
