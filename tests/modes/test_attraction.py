"""Sliding on an intersection whose surfaces act on each other: where it ceases to attract, the run ends."""

from __future__ import annotations

from collections.abc import Sequence

import pytest
import sympy as sp
from multiprecision import multiprecision
from problems import make_problem
from runs import run

from henon_ref.harness.truth.proofs import prove
from henon_ref.modes.problem import Problem
from henon_ref.modes.sliding import attraction_guards
from henon_ref.taylor.tape import TIME


def resting(*field: str, until: str = "2") -> Problem:
    """A run from where all its surfaces, the states, are zero."""
    names = ["x", "y", "z"][: len(field)]
    signs = ["s", "u", "v"]
    return make_problem(" ".join(names), field, dict(zip(signs, names, strict=False)), [0] * len(names), until)


def minors(*field: str) -> list[tuple[str | None, sp.Expr]]:
    """How the run ends, and the minor, for each that is watched while all surfaces are slid on."""
    system = resting(*field).system
    guards = system.equations((0,) * len(field)).guards
    return [(g.ends, sp.expand(g.expression)) for g in guards if g.kind == "attracts"]


def test_what_is_positive_for_certain_is_not_watched() -> None:
    assert minors("-s - u/2", "s/2 - u") == []
    assert minors("-(1 + t^2)*s - u/2", "s/2 - u") == []


def test_surfaces_that_do_not_act_on_each_other_are_watched_by_their_releases() -> None:
    assert minors("(t - 1)*s", "-u") == []


def test_a_surface_that_is_acted_on_but_does_not_act_is_watched_alone() -> None:
    assert minors("(t - 1)*s", "s/10 - u") == [("nonunique", 1 - TIME)]


def test_surfaces_that_act_on_each_other_are_watched_together() -> None:
    assert minors("-s - t*u", "-t*s - u") == [("nonunique", 1 - TIME**2)]
    assert minors("(t - 1)*s + 2*u", "-2*s - u") == [("none", 1 - TIME), ("nonunique", 5 - TIME)]


def test_of_three_in_a_ring_no_pair_is_a_minor_of_its_own() -> None:
    """M = [[1, t, 0], [0, 1, t], [t, 0, 1]]: its pairs act one way only, its determinant is 1 + t^3."""
    assert minors("-s - t*u", "-u - t*v", "-t*s - v") == [("nonunique", 1 + TIME**3)]


def test_of_many_surfaces_the_diagonal_and_the_determinant_are_watched() -> None:
    count = 5
    matrix = sp.Matrix(count, count, lambda i, j: TIME if i == j else sp.Integer(1))
    system = resting("s", "u").system
    found = attraction_guards(system, range(count), -matrix)
    expected = sp.expand((TIME + count - 1) * (TIME - 1) ** (count - 1))
    assert [g.expression for g in found[:count]] == [TIME] * count
    assert [sp.expand(g.expression - expected) for g in found[count:]] == [0]


ENDS = [
    (["(t - 1)*s", "s/10 - u"], "nonunique", 1.0),
    (["-s - t*u", "-t*s - u"], "nonunique", 1.0),
    (["(t - 3/2)*s + 2*u", "-2*s - u"], "failed", 1.5),
    (["s/10 + 2*u", "-2*s - u"], "failed", 0.0),  # its surfaces attract together or not: not told
]


@pytest.mark.parametrize(("field", "status", "time"), ENDS)
def test_the_engine_ends_where_it_is_not_sure_to_attract(field: Sequence[str], status: str, time: float) -> None:
    ended = run(resting(*field))
    assert (ended.status, ended.end_time, ended.transitions) == (status, pytest.approx(time, abs=1e-15), ())


@pytest.mark.parametrize(("field", "status", "time"), ENDS)
def test_both_routes_to_the_truth_end_there(field: Sequence[str], status: str, time: float) -> None:
    """What is not told is not proven."""
    computed, proof = multiprecision(resting(*field)), prove(resting(*field))
    assert (computed.status, float(computed.end_digits)) == (status, pytest.approx(time, abs=1e-15))
    assert bool(proof.undecided) == (status == "failed")
    if not proof.undecided:
        assert (proof.status, float(proof.end_digits)) == (status, time)


def test_a_slide_is_not_divided_by_what_is_no_determinant() -> None:
    """The first entry of the signs' matrix vanishes at t = 1, its determinant does not."""
    system = make_problem("x y", ["(t - 1)*s/10 + 2*u - 1", "-2*s - u"], {"s": "x", "u": "y"}, [0, 0], 2).system
    signs = system.equations((0, 0)).equivalent_signs
    s, u = sp.symbols("s u")
    exact = sp.solve([(TIME - 1) * s / 10 + 2 * u - 1, -2 * s - u], [s, u])
    assert [sp.simplify(signs[i] - exact[v]) for i, v in enumerate((s, u))] == [0, 0]
    assert all(v.subs(TIME, 1).is_finite for v in signs.values())
