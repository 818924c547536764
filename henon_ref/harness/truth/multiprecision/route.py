"""The multiprecision route: heyoka at two precisions, and the digits on which both agree.

The digits come from the higher precision. The radius is twice the difference of the two results, which is nearly the
whole error of the lower precision, so that it exceeds the error of the digits by some ten orders of magnitude. The two
runs differ in order and in every step, not only in rounding. If they do not agree well enough, the precisions are
doubled.
"""

from __future__ import annotations

import copyreg
import logging
import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from itertools import takewhile
from threading import Event
from time import perf_counter, process_time
from typing import Any

import heyoka as hy
from flint import arb, fmpz

from henon_ref.errors import HenonRefError
from henon_ref.harness.truth.multiprecision.run import Instant, Progress, Run, simulate
from henon_ref.harness.truth.reference import (
    GUARD_BITS,
    ReferenceTransition,
    Route,
    ball_text,
    exact_ball,
    in_digits,
    written_radius,
)
from henon_ref.modes.problem import Problem
from henon_ref.precision import working_precision
from henon_ref.workers.executors import processors
from henon_ref.workers.pool import Jobs, WorkerPool
from henon_ref.workers.worker import Failure, Job, WorkerState

log = logging.getLogger(__name__)

LADDER = ((256, 224), (512, 448), (1024, 896))
"""Pairs of precisions [bits], tried in turn; the digits come from the first precision of a pair."""
LONG_RUN = 5.0
"""Expected remaining processor time of the first run [s] beyond which a second process is worth its start of 2 s."""


def multiprecision(problem: Problem, *, progress: Progress | None = None, seconds: float | None = None) -> Route:
    """Compute a problem's transitions with heyoka in multiprecision.

    ``seconds``: processor time limit [s], after which the route ends with the transitions found so far. The status is
    ``failed`` if the precisions do not suffice to decide an event; the route then has the transitions before it.
    """
    began, left = perf_counter(), math.inf if seconds is None else seconds
    for pair in LADDER:
        runs = _runs(problem, pair, progress, [0.55 * left, 0.45 * left])  # the lower precision takes less time
        route = _agreed(problem, *runs, seconds=perf_counter() - began)
        if not route.undecided or any(run.out_of_time for run in runs):
            return route
        log.info("%s bits: %s", pair, route.undecided)
        left -= sum(run.seconds for run in runs)
    return route


def _runs(
    problem: Problem, pair: tuple[int, int], progress: Progress | None, limits: Sequence[float]
) -> tuple[Run, Run]:
    """Run a problem at two precisions; if that takes long, a worker process does the second run meanwhile.

    ``limits``: limits on the processor times of the runs [s]. If no worker does the second run, this process does.
    """
    begun, ended, apart = process_time(), Event(), None

    def shown(done: float) -> None:
        nonlocal apart
        remaining = (process_time() - begun) * (1.0 - done) / max(done, 0.2)
        if apart is None and remaining > LONG_RUN and processors() > 1:
            apart = thread.submit(_by_worker, problem, pair[1], limits[1], ended)
        if progress is not None:
            progress(done / 2 if apart is None else done)

    def second_half(done: float) -> None:
        if progress is not None:
            progress((1.0 + done) / 2)

    with ThreadPoolExecutor(1) as thread:
        try:
            first = simulate(problem, pair[0], progress=shown, seconds=limits[0])
            second = None if apart is None else apart.result()
        finally:  # after an interrupt, too, no worker is left
            ended.set()
    if second is None:
        second = simulate(problem, pair[1], progress=second_half, seconds=limits[1])
    return first, second


def _by_worker(problem: Problem, bits: int, seconds: float, ended: Event) -> Run | None:
    """Run a problem in a worker process; None if it fails, cannot start, or is not wanted after ``ended``."""
    results: list[Run | Failure] = []

    def jobs() -> Jobs:
        results.append((yield Job(simulation_job, (problem, bits, seconds), math.inf)))

    pool = WorkerPool(workers=1, modules=[__name__])
    pool.add("truth", jobs())
    try:
        with closing(pool.turns()) as turns:
            for _ in turns:
                if ended.is_set():
                    return None
    except (HenonRefError, OSError, EOFError) as error:
        log.info("no second process: %s", error)
        return None
    (found,) = results
    if isinstance(found, Failure):
        log.info("second process: %s", found.reason)
        return None
    return found


def simulation_job(_: WorkerState, problem: Problem, bits: int, seconds: float) -> Run:
    """Run a problem at one precision, in a worker."""
    copyreg.pickle(arb, _parts_of_ball)
    return simulate(problem, bits, seconds=seconds)


def _parts_of_ball(ball: arb) -> tuple[Any, ...]:
    """Return how a ball is made from its midpoint and radius, mantissas and exponents (for pickle)."""
    if not ball.is_finite():
        return arb, (str(ball),)
    return _ball, (ball.mid().man_exp(), ball.rad().man_exp())


def _ball(midpoint: tuple[fmpz, fmpz], radius: tuple[fmpz, fmpz]) -> arb:
    return arb(midpoint, arb(radius))


def _same(a: Instant, b: Instant) -> bool:
    return [(t.kind, t.surface, t.from_mode, t.to_mode) for t in a] == [
        (t.kind, t.surface, t.from_mode, t.to_mode) for t in b
    ]


def _agreed(problem: Problem, high: Run, low: Run, *, seconds: float) -> Route:
    """Route up to the point to which two runs agree."""
    with working_precision(high.bits + GUARD_BITS):
        start, until = exact_ball(problem.start, high.bits), exact_ball(problem.until, high.bits)
        span = max(abs(float(start)), float(until - start))
        pairs = list(takewhile(lambda pair: _same(*pair), zip(high.instants, low.instants, strict=False)))
        floor = 2.0 ** (16 - low.bits)  # smallest radius, in case two runs agree by chance
        kept = list(takewhile(lambda pair: _time_radius(*pair, floor * span) <= 1e-30 * span, pairs))
        size = max((abs(float(v)) for instant in high.instants for t in instant for v in t.state), default=0.0) or 1.0
        transitions = tuple(t for pair in kept for t in _transitions(*pair, floor * span, floor * size))
        undecided = ""
        stopped = [run for run in (high, low) if run.out_of_time]
        if stopped:
            undecided = min(stopped, key=lambda run: float(run.end_time)).reason
        elif len(kept) < max(len(high.instants), len(low.instants)):
            what = "know its time too roughly" if len(kept) < len(pairs) else "see different events"
            undecided = f"after transition {len(transitions)} the runs at {high.bits} and {low.bits} bits {what}"
        elif high.status != low.status:
            undecided = f"the runs at {high.bits} and {low.bits} bits end differently: {high.status}, {low.status}"
        if undecided:
            last = kept[-1][0][0].time if kept else start.mid()
            status, reason, end, end_radius = "failed", undecided, last, _radius(last, last, floor * span)
        else:
            status, reason, end = high.status, high.reason, high.end_time
            end_radius = _radius(end, low.end_time, floor * span)
        return Route(
            method=f"heyoka {hy.__version__}, Taylor",
            bits=(high.bits, low.bits),
            seconds=seconds,
            status=status,  # type: ignore[arg-type]
            reason=reason,
            end_digits=ball_text(end, end_radius),
            end_radius=end_radius,
            transitions=transitions,
            near_grazes=tuple(high.near_grazes),
            undecided=undecided,
            accumulates=high.accumulates and not undecided,
        )


def _radius(a: arb, b: arb, least: float) -> float:
    """Twice the difference of two numbers, but at least ``least``."""
    return written_radius(max(2 * abs(float(a - b)), least))


def _time_radius(high: Instant, low: Instant, least: float) -> float:
    return _radius(high[0].time, low[0].time, least)


def _transitions(high: Instant, low: Instant, least_time: float, least_state: float) -> list[ReferenceTransition]:
    """One reference transition per surface."""
    radius = _time_radius(high, low, least_time)
    return [
        in_digits(a, radius, max(_radius(v, w, least_state) for v, w in zip(a.state, b.state, strict=True)))
        for a, b in zip(high, low, strict=True)
    ]
