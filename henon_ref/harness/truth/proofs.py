"""What is exact: the certified route, as a :class:`Route`, and the closed forms of a case.

Closed forms are evaluated to 80 digits, compared with the computed times, then used in place of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from sys import float_info
from time import perf_counter

import flint
import sympy as sp
from flint import arb

from henon_ref.enclosure.balls import enclose
from henon_ref.enclosure.run import Ended, Progress, certify
from henon_ref.harness.truth.reference import (
    CLOSED_FORM_BITS,
    GUARD_BITS,
    ReferenceTransition,
    Route,
    TruthError,
    ball_text,
    in_digits,
    written_radius,
)
from henon_ref.modes.mode import Mode
from henon_ref.modes.problem import Problem
from henon_ref.precision import working_precision
from henon_ref.trajectory import Status

_STATUS: dict[Ended, Status] = {"horizon": "ok", "invalid": "invalid", "nonunique": "nonunique", "none": "failed"}
"""Status of a run whose end is proven."""


def prove(problem: Problem, *, seconds: float | None = None, progress: Progress | None = None) -> Route:
    """Prove as many transitions as possible, each to 1e-30 of the run's length and to at most 1e-30 s.

    ``seconds``: time limit. ``undecided`` of the result is the reason why the proof stopped before the end, if it did.
    """
    begun, span = perf_counter(), float(problem.until - problem.start)
    run = certify(problem, radius=max(1e-30 * min(1.0, span), float_info.min), deadline=seconds, progress=progress)
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
    """Radius around the written digits that contains every ball; 1e-80 for exact numbers."""
    return written_radius(max(1e-80, *(float(ball.rad()) for ball in balls)))


def with_closed_forms(
    transitions: Sequence[ReferenceTransition], times: Sequence[sp.Expr], modes: Sequence[Mode] = ()
) -> tuple[ReferenceTransition, ...]:
    """Replace the first computed times by their closed forms [s]; check the exact modes after the first transitions.

    TruthError if a closed form is not within the radius of the computed time, if a mode differs, or if there are more
    closed forms than transitions.
    """
    if len(times) > len(transitions):
        raise TruthError(
            f"the case gives {len(times)} exact transition times, but only {len(transitions)} transitions "
            "were found: check 'exact' and 'until'"
        )
    for index, mode in enumerate(modes):
        found_mode = transitions[index].to_mode if index < len(transitions) else "none"
        if found_mode != mode:
            raise TruthError(f"transition {index}: the exact mode after it is {mode}, computed is {found_mode}")
    with working_precision(CLOSED_FORM_BITS):
        balls = [enclose(time) for time in times]
        for index, (ball, found) in enumerate(zip(balls, transitions, strict=False)):
            apart = abs(ball - arb(found.time_digits))
            if not apart.lower() <= found.radius:
                raise TruthError(
                    f"transition {index}: the closed form gives {ball.str(25, radius=False)}, computed is "
                    f"{found.time_digits[:27]} with radius {found.radius:g}: they differ by {float(apart):.3g} s"
                )
        radius = 10.0**-80
        exact = tuple(
            replace(found, time_digits=ball_text(ball, radius), radius=radius, closed_form=True)
            for ball, found in zip(balls, transitions, strict=False)
        )
    return exact + tuple(transitions[len(times) :])
