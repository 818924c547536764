"""Static friction: a block that comes to rest on the belt sticks wherever the load is inside the hold zone.

The model of ``cases/static_belt.yaml``, x'' + x = Fk sgn(vb - x') with (Fs, Fk, vb) = (1.5, 1, 0.5), which holds
while abs(x) <= Fs. Between Fk and Fs both slip fields point to the same side of the belt.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest
import sympy as sp
from flint import arb, ctx
from multiprecision import simulate

from henon_ref.casefile.case import load_case, parse_case
from henon_ref.enclosure.balls import enclose
from henon_ref.enclosure.run import certify
from henon_ref.errors import CaseError
from henon_ref.harness.registry import solver
from henon_ref.harness.truth.multiprecision.points import SeriesEvaluation
from henon_ref.harness.truth.reference import exact_ball
from henon_ref.modes.mode import Mode
from henon_ref.modes.mode_evaluation import in_doubles
from henon_ref.modes.problem import Problem
from henon_ref.modes.selection import after_event, initial_mode
from henon_ref.modes.switched_field import Release, SlidingOverride
from henon_ref.modes.system import FilippovSystem

FS, FK, VB = sp.Rational(3, 2), sp.Integer(1), sp.Rational(1, 2)
SOLVERS = [
    ("henon", {"rtol": 1e-13}, 1e-13),
    ("henon-rk4", {"step": 1e-3}, 1e-11),
    ("heyoka", {"rtol": 1e-16}, 1e-13),
    ("scipy-dop853", {"rtol": 1e-12}, 1e-10),
    ("cvode-adams", {"rtol": 1e-11}, 1e-8),
    ("ida", {"rtol": 1e-9}, 1e-6),
]
EACH = pytest.mark.parametrize(("name", "options", "bound"), SOLVERS, ids=[name for name, *_ in SOLVERS])


@cache
def belt() -> FilippovSystem:
    return load_case(Path(__file__).parents[2] / "cases" / "static_belt.yaml").readings[0].problem.system


def start(x: sp.Expr | str, v: sp.Expr | str, until: str = "8") -> Problem:
    return Problem(belt(), sp.Integer(0), (sp.Rational(x), sp.Rational(v)), sp.Rational(until))


def arriving() -> tuple[Problem, list[sp.Expr], list[Mode]]:
    """From below, onto the belt at x = 1 - sqrt(R^2 - vb^2), about -1.3157: inside (-Fs, -Fk)."""
    R = sp.sqrt(sp.Rational("2.35") ** 2 + sp.Rational("0.3") ** 2)
    arrival = sp.asin(VB / R) - sp.asin(sp.Rational("0.3") / R)
    place = FK - sp.sqrt(R**2 - VB**2)
    return start("-1.35", "0.3"), [arrival, arrival + (FS - place) / VB], [(0,), (-1,)]


def resting() -> tuple[Problem, list[sp.Expr], list[Mode]]:
    """On the belt at x = -1.2, under a load between Fk and Fs."""
    return start("-1.2", VB), [(FS + sp.Rational("1.2")) / VB], [(-1,)]


STARTS = pytest.mark.parametrize("made", [arriving, resting])


@STARTS
@EACH
def test_a_solver_sticks_and_lets_go_at_the_limit(name: str, options: dict[str, float], bound: float, made) -> None:  # type: ignore[no-untyped-def]
    problem, times, modes = made()
    run = solver(name).prepare(problem, **options)()
    assert run.status == "ok", run.reason
    assert [t.to_mode for t in run.transitions] == modes
    assert [t.time for t in run.transitions] == pytest.approx([float(t) for t in times], abs=bound, rel=0)
    assert run.transitions[-1].state[0] == pytest.approx(1.5, abs=bound)


@STARTS
def test_the_run_in_multiprecision_does(made) -> None:  # type: ignore[no-untyped-def]
    problem, times, modes = made()
    run = simulate(problem, 256)
    assert [e.after for e in run.events] == modes
    with ctx.workprec(288):
        assert all(abs(e.time - exact_ball(t, 256)) < 1e-70 for e, t in zip(run.events, times, strict=True))


@STARTS
def test_the_proof_does(made) -> None:  # type: ignore[no-untyped-def]
    problem, times, modes = made()
    run = certify(problem)
    assert run.status == "certified", run.reason
    assert [t.to_mode for t in run.transitions] == modes
    with ctx.workprec(2 * run.bits):
        assert all(t.time.overlaps(enclose(e)) for t, e in zip(run.transitions, times, strict=True))


@pytest.mark.parametrize(
    ("x", "mode"),
    [
        pytest.param("0", (0,), id="where both fields point at the belt"),
        pytest.param("-1.4999", (0,), id="below Fs"),
        pytest.param("-1.5001", (1,), id="above Fs: pulled over the belt"),
        pytest.param("1.4999", (0,), id="below Fs on the other side"),
        pytest.param("1.5001", (-1,), id="above Fs: held back"),
        pytest.param("-1.5", (0,), id="at Fs, on the way in"),
        pytest.param("1.5", (-1,), id="at Fs, on the way out"),
    ],
)
def test_a_start_on_the_belt_is_held_up_to_the_limit(x: str, mode: Mode) -> None:
    problem = start(x, VB, "1e-5")
    assert initial_mode(in_doubles(problem.system).at_start(problem), problem).mode == mode
    with ctx.workprec(256):
        assert initial_mode(SeriesEvaluation(problem.system, 256).at_start(problem), problem).mode == mode
    proof = certify(problem)
    assert (proof.status, proof.mode) == ("certified", mode)
    run = solver("henon").prepare(problem, rtol=1e-12)()
    assert run.end_mode == mode


def test_a_load_that_stays_at_the_limit_is_held_for_good() -> None:
    """Gravity on a slope, balanced exactly by static friction."""
    v, s = sp.symbols("v s", real=True)
    hold = SlidingOverride(
        (sp.Integer(0),), (Release(FS - FS, "rising", 1), Release(2 * FS, "falling", -1)), entry="inside"
    )
    system = FilippovSystem((v,), (s,), (v,), (FS - FK * s,), overrides={0: hold})
    problem = Problem(system, sp.Integer(0), (sp.Integer(-1),), sp.Integer(2))
    run = solver("henon").prepare(problem, rtol=1e-12)()
    assert [(t.kind, t.time) for t in run.transitions] == [("stick", pytest.approx(0.4, abs=1e-15))]


def test_by_default_attraction_decides_and_the_block_crosses() -> None:
    """The rule of the listing and of Filippov; Fig. 8's ``listing_limit`` needs it."""
    problem, times, _ = arriving()
    attracting = replace(problem.system, overrides={0: replace(problem.system.overrides[0], entry="attracting")})
    problem = replace(problem, system=attracting, until=sp.Integer(1))
    assert SlidingOverride((), ()).entry == "attracting"
    for name in ("henon", "heyoka"):
        run = solver(name).prepare(problem, rtol=1e-12)()
        assert [t.kind for t in run.transitions] == ["crossing"]
        assert run.transitions[0].time == pytest.approx(float(times[0]), abs=1e-10)
    assert simulate(problem, 128).events[0].after == (1,)
    assert certify(problem).transitions[0].to_mode == (1,)


def touching(limit: str) -> Problem:
    """u = -(t - 1)^2 touches its surface at t = 1, exactly in binary; the hold zone ends at t = limit."""
    return (
        parse_case(
            CASE.format(
                field="2*(1 - t)", sliding=f'{{field: ["0"], entry: inside, release: [{{{LATE}}}]}}', limit=limit
            )
        )
        .readings[0]
        .problem
    )


LATE = 'when: "t - a", direction: rising, to: -1'
CASE = """\
schema: 1
name: touch
title: A touch
system: {{state: [u], parameters: {{a: {limit}}}, surfaces: {{s: u}}, field: ["{field}"]}}
sliding: {{s: {sliding}}}
initial: {{u: -1}}
until: 3
"""


@pytest.mark.parametrize(("limit", "expected"), [("2", [("stick", 1), ("release", 2)]), ("0.5", [("graze", 1)])])
def test_what_only_touches_the_belt_is_held_too(limit: str, expected: Sequence[tuple[str, float]]) -> None:
    problem = touching(limit)
    run = solver("henon").prepare(problem, rtol=1e-12)()
    assert [(t.kind, t.time) for t in run.transitions] == expected
    events = simulate(problem, 128).events
    assert [float(e.time) for e in events] == [time for _, time in expected]
    assert events[0].after == ((0,) if limit == "2" else (-1,))


def two_surfaces(load: str) -> Problem:
    """Where u reaches its surface another one slides (an override has no equations beside it)."""
    u, w, s, r = sp.symbols("u w s r", real=True)
    hold = SlidingOverride((sp.Integer(0), -r), (Release(sp.Rational(load) - 1, "rising", 1),), entry="inside")
    system = FilippovSystem((u, w), (s, r), (u, w), (sp.Integer(1), -r), overrides={0: hold})
    return Problem(system, sp.Integer(0), (sp.Integer(-1), sp.Integer(0)), sp.Integer(2))


def test_beside_another_sliding_surface_the_load_alone_decides() -> None:
    for load, after in (("2", (1, 0)), ("1/2", (0, 0))):
        problem = two_surfaces(load)
        hit = problem.system.equations((-1, 0)).guards[0]
        found: Mapping[str, Mode | None] = {
            "float": after_event(in_doubles(problem.system).at(1.0, [0.0, 0.0]), (-1, 0), [hit]).mode,
            "run": simulate(problem, 128).events[0].after,
        }
        assert set(found.values()) == {after}
        assert simulate(problem, 128).status == "ok"


def test_a_case_file_names_the_rule_and_a_wrong_one_is_refused_in_its_place() -> None:
    def read(entry: str) -> SlidingOverride:
        text = CASE.format(field="-s", limit="1", sliding=f'{{field: ["0"], {entry}release: [{{{LATE}}}]}}')
        reading = parse_case(text, file="case.yaml").readings[0]
        written = reading.mathematics["sliding"]["s"]
        # What was stored before there was a choice keeps its hash.
        assert ("entry" in written) == (reading.problem.system.overrides[0].entry != "attracting")
        return reading.problem.system.overrides[0]

    assert read("").entry == read("entry: attracting, ").entry == "attracting"
    assert read("entry: inside, ").entry == "inside"
    with pytest.raises(CaseError, match=r"^case.yaml:5:.*'entry'.*'attracting' or 'inside'.*'outside'"):
        read("entry: outside, ")
    with pytest.raises(CaseError, match=r"case.yaml:5:.*did you mean 'entry'"):
        read("entri: inside, ")


def test_enclosures_at_the_edge_are_exact() -> None:
    """At x = -Fs exactly the guard is zero by algebra, not by rounding: the stick lasts 2 Fs / vb."""
    run = certify(start(-FS, VB))
    assert run.status == "certified"
    assert run.transitions[0].time.overlaps(arb(6))
