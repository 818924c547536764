"""The certified route: the result of :mod:`henon_ref.enclosure` as a :class:`Route`."""

from __future__ import annotations

from sys import float_info
from time import perf_counter

import flint
from flint import arb

from henon_ref.enclosure.run import Ended, Progress, certify
from henon_ref.harness.truth.multiprecision.numbers import GUARD_BITS, ball_text, in_digits, written_radius
from henon_ref.harness.truth.reference import Route
from henon_ref.modes.problem import Problem
from henon_ref.precision import working_precision
from henon_ref.trajectory import Status

RADIUS = 1e-30
"""Required radius of every transition time, as a part of the run's length and at most this many seconds."""
SMALLEST = 1e-80
"""Radius with which an exact number is written."""

_STATUS: dict[Ended, Status] = {"horizon": "ok", "invalid": "invalid", "nonunique": "nonunique", "none": "failed"}
"""Status of a run whose end is proven."""


def prove(problem: Problem, *, seconds: float | None = None, progress: Progress | None = None) -> Route:
    """Prove as many transitions as possible.

    Parameters
    ----------
    problem : Problem
    seconds : float, optional
        Time limit.
    progress : callable, optional

    Returns
    -------
    Route
        ``undecided`` is the reason why the proof stopped before the end, if it did.
    """
    begun, span = perf_counter(), float(problem.until - problem.start)
    run = certify(problem, radius=max(RADIUS * min(1.0, span), float_info.min), deadline=seconds, progress=progress)
    with working_precision(run.bits + GUARD_BITS):
        radius = _radius(run.time)
        return Route(
            method=f"ball arithmetic, python-flint {flint.__version__}",
            bits=(run.bits,),
            seconds=perf_counter() - begun,
            status=_STATUS.get(run.ended, "failed"),
            reason=run.reason,
            end_digits=ball_text(run.time, radius),
            end_radius=radius,
            transitions=tuple(in_digits(t, _radius(t.time), _radius(*t.state), proven=True) for t in run.transitions),
            undecided="" if run.ended in _STATUS else run.reason,
        )


def _radius(*balls: arb) -> float:
    """Radius around the written digits that contains every ball."""
    return written_radius(max(SMALLEST, *(float(ball.rad()) for ball in balls)))
