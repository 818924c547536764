"""Closed forms of a case: evaluated to 80 digits, compared with the computed times, then used in place of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import sympy as sp
from flint import arb

from henon_ref.enclosure.balls import enclose
from henon_ref.harness.truth.multiprecision.numbers import ball_text
from henon_ref.harness.truth.reference import ReferenceTransition, TruthError
from henon_ref.modes.mode import Mode
from henon_ref.precision import working_precision

BITS = 320
"""Working precision; more than the truth's 256 bits, so that rounding of a closed form does not matter."""
PLACES = 80
"""Decimal places of a closed form in a truth."""


def with_closed_forms(
    transitions: Sequence[ReferenceTransition], times: Sequence[sp.Expr], modes: Sequence[Mode] = ()
) -> tuple[ReferenceTransition, ...]:
    """Replace the first computed times by the closed forms.

    Parameters
    ----------
    transitions : sequence of ReferenceTransition
        As computed.
    times : sequence of Expr
        Exact times [s] from the first transition on.
    modes : sequence of Mode
        Exact mode after each transition, from the first one on.

    Raises
    ------
    TruthError
        If a closed form is not within the radius of the computed time, or if there are more closed forms than
        transitions.
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
    with working_precision(BITS):
        balls = [enclose(time) for time in times]
        for index, (ball, found) in enumerate(zip(balls, transitions, strict=False)):
            apart = abs(ball - arb(found.time_digits))
            if not apart.lower() <= found.radius:
                raise TruthError(
                    f"transition {index}: the closed form gives {ball.str(25, radius=False)}, computed is "
                    f"{found.time_digits[:27]} with radius {found.radius:g}: they differ by {float(apart):.3g} s"
                )
        radius = 10.0**-PLACES
        exact = tuple(
            replace(found, time_digits=ball_text(ball, radius), radius=radius, closed_form=True)
            for ball, found in zip(balls, transitions, strict=False)
        )
    return exact + tuple(transitions[len(times) :])
