"""The multiprecision route: heyoka at two precisions, and the digits on which both agree.

The digits come from the higher precision. The radius is twice the difference of the two results, which is nearly the
whole error of the lower precision, so that it exceeds the error of the digits by some ten orders of magnitude. The two
runs differ in order and in every step, not only in rounding. If they do not agree well enough, the precisions are
doubled.
"""

from __future__ import annotations

import logging
from itertools import takewhile
from time import perf_counter, process_time

import heyoka as hy
from flint import arb

from henon_ref.harness.truth.multiprecision.numbers import GUARD_BITS, ball_text, exact_ball, in_digits, written_radius
from henon_ref.harness.truth.multiprecision.run import Instant, Progress, Run, simulate
from henon_ref.harness.truth.reference import ReferenceTransition, Route
from henon_ref.modes.problem import Problem
from henon_ref.precision import working_precision

log = logging.getLogger(__name__)

LADDER = ((256, 224), (512, 448), (1024, 896))
"""Pairs of precisions [bits], tried in turn; the digits come from the first precision of a pair."""
WANTED = 1e-30
"""Required radius, as a part of the run's length."""
PARTS = (0.55, 1.0)
"""Part of the time limit at which each run of a pair stops; the lower precision takes less time."""
ROUNDING = 2.0**16
"""Smallest radius, in units of rounding, in case two runs agree by chance."""


def multiprecision(problem: Problem, *, progress: Progress | None = None, seconds: float | None = None) -> Route:
    """Compute a problem's transitions with heyoka in multiprecision.

    Parameters
    ----------
    problem : Problem
    progress : callable, optional
        Called with the part that is done, 0 to 1.
    seconds : float, optional
        Processor time limit [s], after which the route ends with the transitions found so far.

    Returns
    -------
    Route
        With status ``failed`` if the precisions do not suffice to decide an event; it then has the transitions
        before that event.
    """
    began, begun = perf_counter(), process_time()
    deadlines = [None if seconds is None else begun + seconds * part for part in PARTS]
    for pair in LADDER:
        runs = [
            simulate(problem, bits, progress=_part(progress, i), deadline=deadlines[i]) for i, bits in enumerate(pair)
        ]
        route = _agreed(problem, *runs, seconds=perf_counter() - began)
        if not route.undecided or any(run.out_of_time for run in runs):
            return route
        log.info("%s bits: %s", pair, route.undecided)
    return route


def _part(progress: Progress | None, index: int) -> Progress | None:
    """Progress function of one of two runs."""
    return None if progress is None else lambda done: progress((index + done) / 2)


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
        floor = ROUNDING * 2.0**-low.bits
        kept = list(takewhile(lambda pair: _time_radius(*pair, floor * span) <= WANTED * span, pairs))
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
