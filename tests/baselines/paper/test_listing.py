"""henon-listing: the appendix of Olejnik and Awrejcewicz (2013) as printed.

The durations and lengths of the sticks of Fig. 8 are the paper's; the limits are FACTS of this project,
computed by the Taylor integrator and checked here by henon-rk4.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import sympy as sp

from henon_ref.baselines.paper.listing import LISTING
from henon_ref.baselines.paper.rk4 import RK4
from henon_ref.errors import UnsupportedError
from henon_ref.modes.problem import Problem
from henon_ref.modes.switched_field import Release, SlidingOverride
from henon_ref.modes.system import FilippovSystem
from henon_ref.solver import Solver
from henon_ref.taylor.tape import TIME

X1, X2, S = sp.symbols("x1 x2 s", real=True)
M, K1, K2, MU0, VP, A, W = (sp.Symbol(name, real=True) for name in ("m", "k1", "k2", "mu0", "vp", "A", "w"))
VALUES = {
    M: sp.Rational(1, 10),
    K1: sp.Integer(1),
    K2: sp.Integer(1),
    MU0: sp.sqrt(3) / 9,
    VP: sp.Rational(2, 5),
    A: 4 * sp.sqrt(3) / 3 * sp.sin(sp.pi / 18),
    W: 3 * sp.pi / sp.Rational("2.4728"),
}
Z = X1 - A * sp.sin(W * TIME)
UPPER = 2 / sp.sqrt(3) * sp.sin(sp.pi / 18)


def limit_of_the_listing(*, factor=3, release=UPPER, to=-1, values=VALUES, rate=0):
    """Fig. 8 as the listing has it for h -> 0: slip ``factor`` f, stick left at one tangent point only."""
    force = (K2 * Z**3 - K1 * Z + MU0 / (VP - X2 - S) - rate * X2) / M
    override = SlidingOverride((VP, sp.Integer(0)), (Release(Z - release, "rising", to),))
    field = (factor * X2, factor * force)
    system = FilippovSystem((X1, X2), (S,), (X2 - VP,), field, values, overrides={0: override})
    return Problem(system, sp.Integer(0), (-UPPER, sp.Rational(2, 5)), sp.Rational(633, 10), {0: 0})


@pytest.fixture(scope="module")
def problem():
    return limit_of_the_listing()


def sticks(transitions, after=0.0):
    """(start, duration, length) of each stick that has ended."""
    return [
        (a.time, b.time - a.time, b.state[0] - a.state[0])
        for a, b in pairwise(transitions)
        if a.kind == "stick" and b.time > after
    ]


def test_is_a_solver():
    assert isinstance(LISTING, Solver)
    assert LISTING.fixed_step


def test_as_printed_it_gives_the_papers_durations_and_lengths(problem):
    """After t = 60, to the digits printed and one more: 1.1746, 0.4161 s and 0.4697, 0.1663."""
    found = sticks(LISTING.prepare(problem, step=1e-4)().transitions, after=60)
    # The last stick is cut off by the end of the listing's run, and the one of 1.1746 s starts before 60.
    assert {(round(d, 5), round(length, 5)) for _, d, length in found} == {(1.1746, 0.4697), (0.4161, 0.16634)}


def test_durations_are_whole_steps_of_the_listing(problem):
    """The release is not stepped back, so that its time is a landing plus a whole number of steps."""
    counted = np.array([d / 1e-4 for _, d, _ in sticks(LISTING.prepare(problem, step=1e-4)().transitions, 10)])
    assert counted == pytest.approx(np.round(counted), abs=1e-6)


def test_its_limit_is_slip_three_times_as_fast_and_one_sided_release(problem):
    """Same transitions as the limit system at every step; the difference vanishes with order 1."""
    limit = RK4.prepare(problem, step=1e-3)().transitions
    errors = []
    for h in (4e-4, 1e-4, 2.5e-5):
        found = LISTING.prepare(problem, step=h)().transitions
        assert [(t.kind, t.to_mode) for t in found] == [(t.kind, t.to_mode) for t in limit]
        errors.append(np.sqrt(np.mean([(a.time - b.time) ** 2 for a, b in zip(found, limit, strict=True)])))
    assert np.diff(np.log(errors)) / np.log(0.25) == pytest.approx([1, 1], abs=0.35)


def test_two_steps_by_hand(problem):
    """Release at once would be step 1; the stick moves by vp h, and time by h."""
    short = replace(problem, until=sp.Rational(1, 10))
    run = LISTING.prepare(short, step=0.05)()
    assert run.transitions == ()
    assert run.end_time == 0.1  # the horizon, though its loop makes one pass more than steps were asked for
    assert run.end_state[0] == pytest.approx(float(-UPPER) + 0.4 * 0.15)


def test_samples_follow_the_run(problem):
    wanted = np.array([0.0, 0.25, 30.0, 63.0])
    run = LISTING.prepare(problem, step=1e-3, sample_times=wanted)()
    assert run.samples.shape == (4, 2)
    assert run.samples[1] == pytest.approx([float(-UPPER) + 0.4 * 0.25, 0.4], abs=1e-3)
    assert np.isfinite(run.samples).all()


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"factor": 1}, "slip"),
        ({"rate": sp.Rational(1, 100)}, "slip"),
        ({"release": UPPER / 2}, "upper middle tangent point"),
        ({"to": 1}, "upper middle tangent point"),
        (
            {"values": {k: v for k, v in VALUES.items() if k != W} | {sp.Symbol("omega", real=True): VALUES[W]}},
            "no parameter w",
        ),
    ],
)
def test_any_other_system_is_refused(change, reason):
    with pytest.raises(UnsupportedError, match=reason):
        LISTING.prepare(limit_of_the_listing(**change), step=1e-3)


def test_filippovs_own_sliding_is_refused(problem):
    plain = replace(problem.system, overrides={})
    with pytest.raises(UnsupportedError, match="override"):
        LISTING.prepare(replace(problem, system=plain), step=1e-3)


def test_arrival_inside_a_hold_zone_is_not_the_listings(problem):
    inside = replace(problem.system, overrides={0: replace(problem.system.overrides[0], entry="inside")})
    with pytest.raises(UnsupportedError, match="entry 'attracting'"):
        LISTING.prepare(replace(problem, system=inside), step=1e-3)


def test_a_step_is_needed(problem):
    with pytest.raises(UnsupportedError, match="positive step"):
        LISTING.prepare(problem)
