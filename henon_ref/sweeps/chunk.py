"""Running one chunk of points: a pure function of the sweep and the points, so that a task can be repeated."""

from __future__ import annotations

import math
import pickle
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from time import thread_time
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.errors import HenonRefError
from henon_ref.integrator.integrator import Integrator, local_error
from henon_ref.integrator.pairs import decimal_pairs, pair_of
from henon_ref.integrator.points import ExactPoint, PointRuns
from henon_ref.kernel.library import kernel
from henon_ref.modes.problem import Problem
from henon_ref.modes.system import FilippovSystem
from henon_ref.simulation.arguments import problem_of
from henon_ref.simulation.quick_start import CLEARLY, stops_of
from henon_ref.sweeps.table_files import Columns, Vector
from henon_ref.sweeps.work import NO_KINKS, START, UNTIL, Runs, Work
from henon_ref.taylor.tape import TIME

OK = "the run reached its horizon"
POINTS = "points"
"""Name of the table with one row for each point."""
Places = NDArray[np.int64]


@dataclass(frozen=True)
class Tables:
    """Observations of one chunk."""

    points: Columns
    """``status`` and the observations, one entry for each point."""
    ragged: Mapping[str, Columns]
    """Additional tables by name; their first column is ``point``, counted from the first point of the sweep."""
    refused: tuple[str, ...] = ()
    """Messages for the points that have no run."""


@lru_cache(maxsize=8)
def _unpickled(work: bytes) -> Work:
    made: Work = pickle.loads(work)
    return made


def execute(work: bytes, first: int, values: Vector, size: int) -> tuple[list[Tables], float]:
    """Run consecutive chunks of ``size`` points (the last may have fewer); return the observations of each, and the
    processor time used [s].

    ``work`` is pickled, and equal for all chunks of a sweep; ``first`` is the index of the first point; ``values`` has
    the shape (K, k).
    """
    began = thread_time()
    runs = run_chunk(_unpickled(work), values, first)
    found = observed(runs)
    refused = {k: f"{runs.point_words(k)}: {runs.message[k]}" for k in np.flatnonzero(runs.refused).tolist()}
    chunks = [
        Tables(
            {name: column[k : k + size] for name, column in found.points.items()},
            {name: _rows(table, first + k, first + k + size) for name, table in found.ragged.items()},
            tuple(words for point, words in refused.items() if k <= point < k + size),
        )
        for k in range(0, len(values), size)
    ]
    return chunks, thread_time() - began


def observed(runs: Runs) -> Tables:
    """Return the observations of some runs."""
    points: Columns = {"status": runs.status}
    ragged: dict[str, Columns] = {}
    for observation in runs.work.observations:
        points |= observation.columns(runs)
        for name, table in observation.tables(runs).items():
            ragged[name] = {**table, "point": table["point"] + runs.first}
    return Tables(points, ragged)


def _rows(table: Columns, first: int, end: int) -> Columns:
    """Return the rows of the points from ``first`` up to, but not including, ``end``."""
    rows = np.flatnonzero((table["point"] >= first) & (table["point"] < end))
    return {name: column[rows] for name, column in table.items()}


def run_chunk(work: Work, values: Vector, first: int = 0) -> Runs:
    """Run the points of a chunk; the points of a chain one after another, all chains in parallel.

    A point without a valid problem (a parameter that is not finite, a horizon before the start) is a run that ends
    ``failed`` at its start.
    """
    runs = Runs(work, values, first)
    wrong, open_kinks, alone = refusals(runs)
    runs.message[:] = wrong
    for step in range(work.chain):
        own = np.arange(step, len(runs), work.chain)
        if step:
            carried = own[runs.status[own - 1] == "ok"]
            runs.initial[carried] = decimal_pairs(runs.end_state[carried - 1])
            runs.end_state[carried] = runs.initial[carried, :, 0]
        own = own[wrong[own] == None]  # noqa: E711 - entry by entry
        _run_step(runs, own[~alone[own]], open_kinks)
        for k in own[alone[own]].tolist():
            _run_alone(runs, k, open_kinks[k])
    return runs


def refusals(runs: Runs) -> tuple[NDArray[Any], NDArray[Any], NDArray[np.bool_]]:
    """Return why each of K points has no run, as text (None if it has one), its open kinks
    (:class:`henon_ref.modes.system.FilippovSystem`), and whether its equations may differ from the system's
    (``conditions`` there), three arrays of shape (K,).

    Points that are not clearly valid in doubles are checked in exact numbers, as by :func:`henon_ref.simulate`.
    """
    system, count = runs.system, len(runs)
    start, until = runs.times[:, :, 0].T
    point = {name: pairs[:, 0] for name, pairs in runs.numbers.items()}
    point |= dict(zip(system.state, runs.initial[:, :, 0].T, strict=True))
    with np.errstate(all="ignore"):
        clear = np.isfinite(start) & np.isfinite(until) & (until > start)
        for values in point.values():
            clear &= np.isfinite(values)
        alone = np.zeros(count, dtype=np.bool_)
        for condition in system.model.conditions:
            alone |= ~(values_at(condition, point, count) > CLEARLY)
        clear &= ~alone
        for stop in stops_of(system):
            clear &= values_at(system.model.surfaces[stop], {**point, TIME.name: start}, count) > CLEARLY
        clear &= ~_may_have_open_kinks(system.model, {**point, TIME.name: start}, count)
    reasons, open_kinks = np.full(count, None, dtype=object), np.full(count, NO_KINKS, dtype=object)
    for k in np.flatnonzero(~clear).tolist():
        try:
            own = {name: float(column[k]) for name, column in runs.values.items()}
            open_kinks[k] = problem_at(runs.work, own).system.open_kinks
            reasons[k] = _unclear(point, start, until, k)
        except HenonRefError as error:
            reasons[k] = str(error)
    return reasons, open_kinks, alone


def problem_at(work: Work, values: Mapping[str, float]) -> Problem:
    """Return the initial-value problem at a point; HenonRefError, as from ``simulate``, if it is invalid."""
    states = {name: value for name, value in values.items() if name in work.system.state}
    swept = {name: value for name, value in values.items() if name not in states}
    start = {**work.initial, **states}
    given = {"until": work.until, "start": work.start, "parameters": swept, "mode": work.mode}
    return problem_of(work.system, start, **given, error=local_error(work.rtol))[1]


def _may_have_open_kinks(model: FilippovSystem, point: Mapping[str, Vector], count: int) -> NDArray[np.bool_]:
    """Check whether a kink, or a root in it, has no value at a start or is at the end of its domain there."""
    found = np.zeros(count, dtype=np.bool_)
    for surface in model.surfaces if model.kinks else ():
        found |= ~np.isfinite(values_at(surface, point, count))
    for i in model.kinks:
        for power in model.surfaces[i].atoms(sp.Pow):
            if not power.exp.is_Integer:  # the end of the domain of a root
                found |= values_at(power.base, point, count) == 0.0
    return found


def values_at(expression: sp.Expr, point: Mapping[str, Vector], count: int) -> Vector:
    """Evaluate an expression at many points; NaN if it has no value."""
    names, function = _function(expression)
    return np.broadcast_to(np.asarray(function(*(point[name] for name in names)), dtype=np.float64), count)


@lru_cache(maxsize=4096)
def _function(expression: sp.Expr) -> tuple[list[str], Callable[..., Any]]:
    """Return the names in an expression, and the expression as a function of arrays of their values."""
    symbols = sorted(expression.free_symbols, key=lambda s: s.name)
    return [s.name for s in symbols], sp.lambdify(symbols, expression, "numpy")


def _unclear(point: Mapping[str, Vector], start: Vector, until: Vector, k: int) -> str | None:
    """Return which number of an exact problem cannot be represented in doubles; None if all can."""
    for name, values in point.items():
        if not np.isfinite(values[k]):
            return f"'{name}' is {values[k]} in double precision; a number must be finite"
    if not until[k] > start[k]:
        return f"the horizon {until[k]:.17g} is not later than the start {start[k]:.17g} in double precision"
    return None


def _run_step(runs: Runs, own: Places, open_kinks: NDArray[Any]) -> None:
    """Run points that do not depend on each other, one compiled system for each set of exponents and open kinks."""
    work = runs.work
    exponents = [runs.numbers[name][own, 0] for name in work.moving_exponents]
    different, which = np.unique(np.column_stack(exponents or [np.zeros(len(own))]), axis=0, return_inverse=True)
    for k, kinks in product(range(len(different)), set(open_kinks[own].tolist())):
        some = own[(which.ravel() == k) & (open_kinks[own] == kinks)]
        try:
            integrator = work.integrator(*(different[k].tolist() if exponents else ()), open_kinks=kinks)
        except HenonRefError as error:
            runs.message[some] = str(error)
        else:
            _run_together(runs, integrator, some)


def _run_alone(runs: Runs, k: int, open_kinks: frozenset[int]) -> None:
    """Run a point with the equations that its own parameters have."""
    own = np.array([k])
    try:
        integrator = runs.work.integrator_at(
            {name: float(column[k]) for name, column in runs.values.items()}, open_kinks
        )
    except HenonRefError as error:
        runs.message[own] = str(error)
    else:
        _run_together(runs, integrator, own)


def _run_together(runs: Runs, integrator: Integrator, own: Places) -> None:
    """Run points in one compiled call; if it raises an error, run each point by itself to isolate the faulty ones."""
    try:
        _run(runs, integrator, own)
    except HenonRefError as error:
        if len(own) == 1:
            runs.message[own] = str(error)
        for one in own if len(own) > 1 else ():
            _run_together(runs, integrator, np.array([one]))


def _run(runs: Runs, integrator: Integrator, own: Places) -> None:
    work = runs.work
    values = np.empty((len(own), len(integrator.parameters), 2))
    for k, symbol in enumerate(integrator.parameters):
        values[:, k] = runs.numbers[symbol.name][own]
    initial, times = runs.initial[own], runs.times[own]
    carried = (own % work.chain > 0) & (runs.status[own - 1] == "ok")
    held = runs.holding(own - 1) & carried[:, None] if carried.any() else None
    signs = work.system.model.sign_names
    made = PointRuns(
        integrator,
        values,
        initial,
        start=times[:, 0],
        until=times[:, 1],
        tolerance=local_error(work.rtol),
        keep=work.keep,
        most_steps=work.max_steps,
        mode={signs.index(sign): side for sign, side in (work.mode or {}).items()},
        held=held,
        exact=_exact_points(runs, own, [s.name for s in integrator.parameters], values, initial, times),
    )
    kept = [block for block in made if len(block)] if len(own) else []
    runs.status[own], runs.message[own], runs.refused[own] = "ok", OK, False
    for point, entries in made.held_entries.items():  # of the sections that follow the surfaces, none
        runs.held_entries[own[point]] = {signs[i]: entry for i, entry in entries.items() if i < len(signs)}
    mode = made.ends["mode"].astype(np.int64)
    for point in np.flatnonzero(made.ends["code"] == kernel.BUDGET_SPENT).tolist():
        runs.status[own[point]], runs.message[own[point]] = made.status(point)
    for point, end in made.others.items():
        runs.status[own[point]], runs.message[own[point]] = end.status, end.reason or OK
        if point in made.refused:  # no initial mode exists
            mode[point] = -1
    rows = runs.rows_of_modes(made.modes)
    runs.end_time[own], runs.end_state[own], runs.end_mode[own] = made.ends["time"], made.states, rows[mode]
    runs.counts[own] = np.column_stack([made.ends[name] for name in ("steps", "expansions", "guard_evaluations")])
    for block in kept:
        runs.keep(block, own, rows)


def _exact_points(
    runs: Runs, own: Places, parameters: Sequence[str], values: Vector, initial: Vector, times: Vector
) -> Callable[[int], ExactPoint]:
    """Return a function that gives the exact numbers of one of the runs ``own``, whose pairs of doubles are known.

    A pair that is no printed decimal number (of a swept value, or of a state at the end of the run before it) is the
    value of an expression.
    """
    work, numbers = runs.work, runs.work.numbers

    def point(k: int) -> ExactPoint:
        here = {name: float(column[own[k]]) for name, column in runs.values.items()}

        def exact(names: Sequence[str], pairs: Vector) -> list[Any]:
            return [
                high if not math.isfinite(high) or pair_of(high) == (high, low) else numbers[name].exact(here)
                for name, (high, low) in zip(names, pairs.tolist(), strict=True)
            ]

        state, time = exact(work.system.state, initial[k]), exact((START, UNTIL), times[k])
        return ExactPoint(tuple(exact(parameters, values[k])), state, *time)

    return point
