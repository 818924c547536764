"""henon-listing: the appendix of Olejnik and Awrejcewicz (2013) as printed.

The durations and lengths of the sticks of Fig. 8 are the paper's; its order is tested in test_paper_audit.py.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import sympy as sp

from henon_ref.baselines.paper.listing import LISTING
from henon_ref.casefile.case import load_case
from henon_ref.errors import UnsupportedError
from henon_ref.solver import Solver

FIG8 = load_case(Path(__file__).parents[3] / "cases" / "fig8.yaml").reading("listing_limit").problem
"""Fig. 8 as the listing has it for h -> 0: slip 3 f, stick left at the upper tangent point only."""
START = -float(FIG8.initial[0])


@pytest.fixture(scope="module")
def problem():
    return replace(FIG8, until=sp.Rational(633, 10))


def changed(factor=1, drag=0, release=0, to=-1, rename=None):
    """The system with its slip divided by a factor, a drag, its release moved, or a parameter of another name."""
    system = FIG8.system
    (own,) = system.overrides[0].release
    override = replace(system.overrides[0], release=(replace(own, when=own.when - release, to=to),))
    field = tuple(rate / factor - drag * x for rate, x in zip(system.field, (0, system.states[1]), strict=True))
    made = replace(system, field=field, overrides={0: override})
    if rename is not None:
        names = {p: sp.Symbol(rename[1], real=True) if p.name == rename[0] else p for p in system.parameters}
        values = {names[p]: value for p, value in system.parameters.items()}
        made = replace(made, parameters=values, field=tuple(rate.xreplace(names) for rate in field))
    return replace(FIG8, system=made)


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


def test_two_steps_by_hand(problem):
    """Release at once would be step 1; the stick moves by vp h, and time by h."""
    short = replace(problem, until=sp.Rational(1, 10))
    run = LISTING.prepare(short, step=0.05)()
    assert run.transitions == ()
    assert run.end_time == 0.1  # the horizon, though its loop makes one pass more than steps were asked for
    assert run.end_state[0] == pytest.approx(-START + 0.4 * 0.15)


def test_samples_follow_the_run(problem):
    wanted = np.array([0.0, 0.25, 30.0, 63.0])
    run = LISTING.prepare(problem, step=1e-3, sample_times=wanted)()
    assert run.samples.shape == (4, 2)
    assert run.samples[1] == pytest.approx([-START + 0.4 * 0.25, 0.4], abs=1e-3)
    assert np.isfinite(run.samples).all()


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"factor": 3}, "slip"),
        ({"drag": sp.Rational(1, 10)}, "slip"),
        ({"release": START / 2}, "upper middle tangent point"),
        ({"to": 1}, "upper middle tangent point"),
        ({"rename": ("w", "omega")}, "no parameter w"),
    ],
)
def test_any_other_system_is_refused(change, reason):
    with pytest.raises(UnsupportedError, match=reason):
        LISTING.prepare(changed(**change), step=1e-3)


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
