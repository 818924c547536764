"""Minimum and maximum of an expression along runs, from the Taylor polynomials of their steps.

On a step the states are polynomials in time, and the recurrences give the Taylor series of the expression. The
Bernstein coefficients of its polynomial are bounds (Farouki, *Computer Aided Geometric Design* 29 (2012) 379-419,
Sec. 3). Pieces whose bounds do not exceed the values already found are discarded, the others are halved. If the
coefficients have one turning point, the polynomial has at most one, and Newton's method locates it. Reported values
are those of the expression at the states, never values of its series.

All operations act on each run separately, entry by entry, so that no digit depends on which runs share an array.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import comb
from typing import Any, ClassVar, NamedTuple

import numpy as np

from henon_ref.errors import HenonRefError
from henon_ref.expressions.grammar import FUNCTIONS
from henon_ref.simulation.simulate import simulate
from henon_ref.simulation.solution import Solution
from henon_ref.simulation.system import System
from henon_ref.sweeps.chunk import values_at
from henon_ref.sweeps.observations import moving_expression, rank_in_run
from henon_ref.sweeps.table_files import Columns, Vector
from henon_ref.sweeps.work import Observation, Runs
from henon_ref.taylor.series import Ring, along
from henon_ref.taylor.tape import Tape, build_tape

ROUNDING = 2.0**-49
"""Relative rounding error of values and bounds, with respect to the largest intermediate number."""
NUMPY: Ring = {name: getattr(np, name) for name in FUNCTIONS} | {"power": np.power}
"""Ring of arrays of doubles."""


class Pieces(NamedTuple):
    """Parts of steps, with the states as polynomials in the elapsed fraction of the part, from 0 to 1."""

    run: Any
    """Index of the run of each piece, shape (S,); pieces of a run are consecutive."""
    begin: Vector
    """Start of each piece [s], shape (S,)."""
    length: Vector
    """Length of each piece [s], shape (S,)."""
    states: Vector
    """Coefficients of the states, shape (n, order + 1, S)."""

    def chosen(self, rows: Any) -> Pieces:
        return Pieces(self.run[rows], self.begin[rows], self.length[rows], self.states[:, :, rows])

    def part(self, first: Vector, width: Vector) -> Pieces:
        """Return the part of each piece from ``first`` to ``first + width`` (0 to 1)."""
        order = self.states.shape[1] - 1
        binomials = _binomials(order)
        powers, scale = (np.cumprod([np.ones_like(a), *[a] * order], axis=0) for a in (first, width))
        moved = np.zeros_like(self.states)
        for k in range(order + 1):
            moved[:, : k + 1] += binomials[k, : k + 1] * powers[k::-1] * self.states[:, k, None]
        return Pieces(self.run, self.begin + first * self.length, self.length * width, moved * scale)


def pieces_of(number: int, run: Solution, after: float) -> Pieces:
    """Return the steps of a run that end at ``after`` or later.

    The end of the run, and each state between two jumps at one instant, is a step of length zero.
    """
    sol, t = run.sol, run.t
    assert sol is not None
    ends, lows = np.append(sol.begin[1:], sol.begin[-1]), np.append(sol.begin_low[1:], sol.begin_low[-1])
    kept = np.flatnonzero(ends >= after)
    length = (ends - sol.begin)[kept] + (lows - sol.begin_low)[kept]
    length[-2:][np.abs(length[-2:]) <= np.spacing(sol.end)] = 0.0  # shorter than the rounding of the end
    order = sol.coefficients.shape[2] - 1
    scale = np.cumprod([np.ones_like(length), *[length / sol.unit[kept]] * order], axis=0)
    states = sol.coefficients[kept].transpose(1, 2, 0) * scale
    between = 1 + np.flatnonzero((t[1:-1] == t[:-2]) & (t[1:-1] == t[2:]) & (t[1:-1] >= after))
    still = np.zeros((len(run.y), order + 1, len(between)))
    still[:, 0] = run.y[:, between]
    return Pieces(
        np.full(len(kept) + len(between), number),
        np.append(sol.begin[kept], t[between]),
        np.append(length, np.zeros(len(between))),
        np.concatenate([states, still], axis=2),
    )


def joined_pieces(parts: Sequence[Pieces], after: float = -np.inf) -> Pieces:
    """Concatenate pieces and cut off what is before ``after``."""
    found = Pieces(*(np.concatenate(own, axis=-1) for own in zip(*parts, strict=True)))
    early = found.begin < after
    if not early.any():
        return found
    first = np.where(early, (after - found.begin) / np.where(early, found.length, 1.0), 0.0)
    return found.part(first, 1.0 - first)


@lru_cache
def _binomials(order: int) -> Vector:
    """Return the binomial coefficients of j over k, shape (order + 1, order + 1, 1)."""
    return np.array([[[comb(j, k)] for k in range(order + 1)] for j in range(order + 1)], dtype=np.float64)


class _Bounds(NamedTuple):
    """Bernstein coefficients of an expression on pieces, shape (order + 1, S), and their error bounds, shape (S,)."""

    coefficients: Vector
    error: Vector
    size: Vector

    def chosen(self, rows: Any) -> _Bounds:
        return _Bounds(self.coefficients[:, rows], self.error[rows], self.size[rows])

    def halves(self) -> tuple[_Bounds, _Bounds]:
        """Return the coefficients on both halves (de Casteljau)."""
        rows, lower, upper = self.coefficients, [self.coefficients[0]], [self.coefficients[-1]]
        while len(rows) > 1:
            rows = 0.5 * (rows[1:] + rows[:-1])
            lower.append(rows[0])
            upper.append(rows[-1])
        return self._replace(coefficients=np.array(lower)), self._replace(coefficients=np.array(upper[::-1]))

    @property
    def turns(self) -> Any:
        """Number of turning points of the coefficients, an upper bound for those of the polynomial."""
        slopes = np.diff(self.coefficients, axis=0)
        rising = np.where(slopes > 0, 1, -1)
        rising[slopes == 0] = 0
        for k in range(1, len(rising)):  # a difference of 0 continues the previous direction
            rising[k] = np.where(rising[k] == 0, rising[k - 1], rising[k])
        return np.sum(rising[1:] * rising[:-1] < 0, axis=0)

    def stationary(self) -> tuple[Vector, Any]:
        """Return the zero of the derivative by Newton's method, and whether its effect is below rounding."""
        rows, order = self.coefficients, len(self.coefficients) - 1
        at = np.full(rows.shape[1], 0.5)
        for _ in range(8):
            three = rows
            while len(three) > 3:
                three = three[:-1] + at * (three[1:] - three[:-1])
            two = three[:-1] + at * (three[1:] - three[:-1])
            slope, curvature = order * (two[1] - two[0]), order * (order - 1) * (three[2] - 2 * three[1] + three[0])
            step = np.clip(at - slope / curvature, 0.0, 1.0) - at
            at = at + step
        return np.where(np.isfinite(at), at, 0.5), np.abs(curvature) * step * step <= ROUNDING * self.size


@np.errstate(all="ignore")
def extremes(tape: Tape, pieces: Pieces, parameters: Mapping[str, Vector], count: int) -> tuple[Vector, Vector]:
    """Return an expression's minimum and maximum on the pieces of each of ``count`` runs; infinite without a value.

    ``parameters``: parameter -> its value in each run, shape (count,).
    """
    numbers = [values_at(constant, parameters, count) for constant in tape.constants]
    least, largest = np.full(count, np.inf), np.full(count, -np.inf)

    def found(run: Any, values: Vector) -> None:
        np.minimum.at(least, run, values)
        np.maximum.at(largest, run, values)

    def beyond(run: Any, bounds: _Bounds) -> Any:
        """Return the pieces that may exceed the extremes found so far by more than rounding."""
        slack = 2.0 * ROUNDING * bounds.size - bounds.error
        rows = bounds.coefficients.min(axis=0) < least[run] - slack
        rows |= bounds.coefficients.max(axis=0) > largest[run] + slack
        rows |= np.isinf(bounds.error)
        rows = np.flatnonzero(rows & ((bounds.error != 0) | (bounds.turns > 0)))
        return rows[rank_in_run(run[rows]) < 4096]  # more occur only if rounding errors dominate

    for end in (0.0, 1.0):
        found(pieces.run, _value(tape, pieces, numbers, end))
    bounds = _bounds(tape, pieces, numbers)
    for _ in range(50):
        rows = beyond(pieces.run, bounds)
        if not len(rows):
            break
        pieces, bounds = pieces.chosen(rows), bounds.chosen(rows)
        at, settled = bounds.stationary()
        found(pieces.run, _value(tape, pieces, numbers, at))
        rows = np.flatnonzero(~(settled & (bounds.error == 0) & (bounds.turns == 1)))
        pieces, bounds = pieces.chosen(rows), bounds.chosen(rows)
        found(pieces.run, _value(tape, pieces, numbers, 0.5))
        order = np.argsort(np.tile(np.arange(len(rows)), 2), kind="stable")  # halves of a piece are consecutive
        half = np.full(len(rows), 0.5)
        pieces = joined_pieces([pieces.part(first, half) for first in (0.0 * half, half)]).chosen(order)
        halves = zip(*bounds.halves(), strict=True)
        bounds = _Bounds(*(np.concatenate(pair, axis=-1) for pair in halves)).chosen(order)
        loose = np.flatnonzero(bounds.error)
        if len(loose):
            again = _bounds(tape, pieces.chosen(loose), numbers)
            for own, other in zip(bounds, again, strict=True):
                own[..., loose] = other
    return least, largest


def _bounds(tape: Tape, pieces: Pieces, numbers: Sequence[Vector]) -> _Bounds:
    """Return bounds from the series; its error is estimated by its last terms, its midpoint and its end."""
    order = pieces.states.shape[1] - 1
    series, size = _series(tape, pieces, numbers, order)
    error = np.abs(series[-1]) + np.abs(series[-2])
    somewhere = np.isfinite(series[0])
    for at in (0.5, 1.0):
        polynomial, value = series[-1], _value(tape, pieces, numbers, at)
        for k in range(order - 1, -1, -1):
            polynomial = polynomial * at + series[k]
        error = error + np.abs(polynomial - value)
        somewhere |= np.isfinite(value)
    coefficients, binomials = np.zeros_like(series), _binomials(order)
    for k in range(order + 1):
        coefficients += binomials[:, k] / binomials[order, k] * series[k]
    error = np.where(np.isfinite(error), error, np.where(somewhere, np.inf, np.nan))
    size = np.maximum(size, np.abs(series).sum(axis=0))
    error[error <= ROUNDING * size] = 0.0
    return _Bounds(coefficients, error, size)


def _series(tape: Tape, pieces: Pieces, numbers: Sequence[Vector], order: int) -> tuple[Vector, Vector]:
    """Return the coefficients on each piece, shape (order + 1, S), and the largest number in the first."""
    constants = [c[pieces.run] for c in numbers]
    states = [list(own) for own in pieces.states]
    (found,), sizes = along(tape, constants, pieces.begin, states, order, NUMPY, pieces.length)
    nothing = np.zeros(len(pieces.run))
    return np.array([nothing + c for c in found]), np.max([nothing, *map(np.abs, sizes)], axis=0)


def _value(tape: Tape, pieces: Pieces, numbers: Sequence[Vector], at: Vector | float) -> Vector:
    """Evaluate the expression at a fraction of each piece (0 to 1), shape (S,)."""
    x = pieces.states[:, -1]
    for k in range(pieces.states.shape[1] - 2, -1, -1):
        x = x * at + pieces.states[:, k]
    there = Pieces(pieces.run, pieces.begin + at * pieces.length, pieces.length, x[:, None])
    return _series(tape, there, numbers, 0)[0][0]


@lru_cache(maxsize=64)
def _tape_of(system: System, text: str) -> Tape:
    """Return the tape of an expression given as text; cached for the chunks of a sweep."""
    return build_tape(system.model.states, (), [moving_expression(system, text, "expression")])


@dataclass(frozen=True)
class Extremes(Observation):
    """See :func:`henon_ref.sweeps.observe.extremes`; each run is repeated by itself with its dense output."""

    of: str
    after: float | None = None
    name: str | None = None
    kind: ClassVar[str] = "extremes"

    def check(self, system: System) -> None:
        _tape_of(system, self.of)

    def columns(self, runs: Runs) -> Columns:
        tape = _tape_of(runs.system, self.of)
        parameters = {name: pairs[:, 0] for name, pairs in runs.numbers.items()}
        after = -np.inf if self.after is None else self.after
        least, largest = np.full(len(runs), np.nan), np.full(len(runs), np.nan)
        parts: list[Pieces] = []

        def search() -> None:
            if parts:
                pieces = joined_pieces(parts, after)
                own = np.unique(pieces.run)
                found = extremes(tape, pieces, parameters, len(runs))
                least[own], largest[own] = found[0][own], found[1][own]
                parts.clear()

        for k, point in enumerate(runs.arguments()):
            try:
                run = simulate(runs.system, **point)
            except HenonRefError:  # the row of the point has the reason
                continue
            if run.status != runs.status[k]:  # its steps exceed the memory that a run may keep
                continue
            parts.append(pieces_of(k, run, after))
            if sum(part.states.size for part in parts) > 1 << 22:  # bounds the memory; one run alone may need more
                search()
        search()
        name = self.name or self.of
        return {f"min_{name}": least, f"max_{name}": largest}
