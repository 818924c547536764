"""A run's state: scalars with names, the same for every system."""

from __future__ import annotations

import numpy as np
from problems import make_problem

from henon_ref.henon.integrator import Integrator
from henon_ref.henon.loop import advance, load
from henon_ref.henon.records import HENON
from henon_ref.henon.run import Run
from henon_ref.henon.state import RUN


def test_one_compilation_serves_every_size() -> None:
    """The record holds scalars only: its type, and the loop's, does not depend on the number of states."""
    before = None
    for n in (1, 2, 16):
        names = [f"x{i}" for i in range(n)]
        problem = make_problem(" ".join(names), ["t - s"] + ["-x0"] * (n - 1), {"s": "x0"}, [0] * n, 3)
        integrator = Integrator(problem.system, 8)
        load(several=integrator.several)
        found = Run(integrator, integrator.start(problem, tolerance=1e-6, landing=HENON)).to_horizon()
        assert (found.status, len(found.end_state)) == ("ok", n)
        assert before in (None, advance.signatures)
        before = list(advance.signatures)


def test_counts_and_places_are_integers_and_the_rest_doubles() -> None:
    whole = {"mode", "steps", "expansions", "guard_evaluations", "transitions", "guard", "landing", "stalled"}
    whole |= {
        "events_at_once",
        "next_sample",
        "stepped_mode",
        "remembered",
        "step_place",
        "event_pending",
        "pending_kind",
        "pending_mode",
        "order",
        "method",
    }
    whole |= {"transition_capacity", "states", "guards"}
    whole |= {"stop_falling", "stop_rising", "stopped", "most_steps", "dense", "dense_steps", "dense_capacity"}
    whole |= {"more_digits", "below_rounding"}
    assert RUN.fields is not None
    assert {name for name, (kind, *_) in RUN.fields.items() if kind == np.int64} == whole
