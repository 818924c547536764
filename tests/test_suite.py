"""The suite of cases, run by the reference: every transition in order with its mode, every run with its right end.

The stories, sources and links stand in the case files. Nothing is tuned per case: each reading is run at the
tightest of its own tolerances.
"""

from __future__ import annotations

import runpy
from dataclasses import dataclass
from itertools import groupby, pairwise
from math import inf, isfinite
from pathlib import Path

import pytest
import sympy as sp
from shipped import CASES, paths, proven, read, readings, shipped

from henon_ref.baselines.henon import HENON_SOLVER
from henon_ref.casefile.case import Case, Reading, load_case
from henon_ref.harness.score.scoring import score
from henon_ref.harness.truth.compute import stored_truth
from henon_ref.harness.truth.store import folder_of
from henon_ref.modes.mode import transition_kind
from henon_ref.modes.problem import Problem
from henon_ref.taylor.tape import TIME
from henon_ref.trajectory import Trajectory, Transition

BOUND = 1e-11
"""Largest error of a well-conditioned transition time [s]."""
DEADLINE = 20.0


def _readings(*folders: str) -> list[pytest.param]:
    found = []
    for path in paths(*folders):
        for reading in readings(path):
            found.append(pytest.param(path, reading, id=f"{path.stem}.{reading}"))
    return found


def _run(reading: Reading) -> Trajectory:
    return HENON_SOLVER.prepare(reading.problem, rtol=min(reading.tolerances), deadline=DEADLINE)()


@pytest.mark.parametrize(("path", "name"), _readings("classic", "scenes", "hard"))
def test_reference_passes(path: Path, name: str) -> None:
    case = read(path)
    reading = case.reading(name)
    run = _run(reading)
    expected = reading.expect.status if reading.expect else "ok"
    assert run.status == expected, run.reason
    if expected != "ok":
        assert run.reason
    if reading.expect is not None and reading.expect.time is not None:
        # A branch point (failed) is seen when the terms that it spoils are worth a tolerance, a little before or after.
        near = 1e-6 if expected == "failed" else 1e-9
        assert run.end_time == pytest.approx(float(reading.expect.time), rel=near, abs=1e-12)
    _check_order(run)
    if reading.expect is not None and reading.expect.verdict:
        _check_verdict(case, reading, run)
        return
    if reading.exact is not None:
        _check_modes(reading, run)
        _check_times(reading, run)
    _check_truth(case, reading, run)


@pytest.mark.slow  # daily: each reading at its tightest tolerance, above
@pytest.mark.parametrize(("path", "name"), _readings(".", "classic", "scenes", "hard"))
def test_every_tolerance_ends_with_the_right_word(path: Path, name: str) -> None:
    """From 1e-3 to less than a double can tell: no run stalls, hangs or ends with another word."""
    reading = read(path).reading(name)
    if reading.solvers and HENON_SOLVER.name not in reading.solvers:
        pytest.skip("another solver's reading")
    expected = reading.expect.status if reading.expect else "ok"
    for exponent in range(3, 18):
        run = HENON_SOLVER.prepare(reading.problem, rtol=10.0**-exponent, deadline=DEADLINE)()
        assert run.status == expected, (exponent, run.reason)


def _check_order(run: Trajectory) -> None:
    """Times do not fall, modes follow on each other, and kinds say what the modes do."""
    instants = [list(same) for _, same in groupby(run.transitions, key=lambda t: (t.time, t.time_low, t.from_mode))]
    for before, after in pairwise(instants):
        assert (before[-1].time, before[-1].time_low) <= (after[0].time, after[0].time_low)
        assert before[-1].to_mode == after[0].from_mode
        touches = [t.surface for t in after if t.kind == "graze"] if before[0].time == after[0].time else []
        assert not set(touches) & {t.surface for t in before}, "a surface just left is not touched at once"
    for transition in run.transitions:
        sides = transition.from_mode[transition.surface], transition.to_mode[transition.surface]
        if transition.kind == "reset":
            assert sides[0] >= 0  # a body at rest on its stop may be struck
        else:
            assert transition.kind == transition_kind(*sides)


def _check_verdict(case: Case, reading: Reading, run: Trajectory) -> None:
    """What no double decides: no transition of the truth has a finite conditioning, and scoring says no other word."""
    expected = proven(case, reading)
    assert expected.transitions
    assert all(t.conditioning == inf for t in expected.transitions), "a well-posed question"
    assert reading.expect is not None
    for tolerance in reading.tolerances:
        assert score(run, expected, tolerance=tolerance).verdict.word in ("right", reading.expect.verdict)


def _check_modes(reading: Reading, run: Trajectory) -> None:
    exact = reading.exact
    assert exact is not None
    found = [t.to_mode for t in run.transitions]
    if exact.modes and (reading.expect is None or reading.expect.status != "failed"):
        assert found == list(exact.modes)
    elif exact.modes:  # transitions accumulate: there are more than can be listed
        assert found[: len(exact.modes)] == list(exact.modes)
    elif not exact.transition_times:
        assert not found


def _check_times(reading: Reading, run: Trajectory) -> None:
    exact, problem = reading.exact, reading.problem
    assert exact is not None
    assert len(run.transitions) >= len(exact.transition_times)
    unit = _unit(problem)
    worst = 1.0
    for transition, time in zip(run.transitions, exact.transition_times, strict=False):
        error = abs(sp.Float(transition.time, 50) + sp.Float(transition.time_low, 50) - sp.N(time, 50))
        if error > BOUND * unit:
            worst = max(worst, _conditioning(problem, transition, unit))
        assert error <= BOUND * unit * worst, f"{transition.kind} at {float(time)!r} is off by {float(error):.2g} s"


def _check_truth(case: Case, reading: Reading, run: Trajectory) -> None:
    """Hold the run against the stored truth, which has to be there and of these mathematics."""
    if reading.expect is not None and reading.expect.status != "ok":
        return
    truth = stored_truth(case, reading, folder_of(case.path))
    assert truth is not None, "no truth of this is stored: run henon-ref truth with its case file"
    found = [(t.kind, t.surface, t.from_mode, t.to_mode) for t in run.transitions]
    assert found == [(t.kind, t.surface, t.from_mode, t.to_mode) for t in truth.transitions]
    unit = _unit(reading.problem)
    worst = 1.0
    for ours, theirs in zip(run.transitions, truth.transitions, strict=True):
        error = abs((ours.time - theirs.time) + (ours.time_low - theirs.time_low))
        if isfinite(theirs.conditioning):  # seconds an error of a unit of the state makes
            worst = max(worst, theirs.conditioning * max(1.0, *map(abs, ours.state)) / unit)
        assert theirs.kind == "graze" or error <= BOUND * unit * worst + theirs.radius, (
            f"{ours} is off by {error:.2g} s"
        )


def _unit(problem: Problem) -> float:
    """What an error is measured by: a second, or the run where that is of another magnitude altogether."""
    span = float(problem.until - problem.start)
    return 1.0 if 0.1 < span < 1e4 else span / 20


def _conditioning(problem: Problem, transition: Transition, unit: float) -> float:
    """Error of the time, in units, that a relative error of the state makes: size of the guard over its speed."""
    system = problem.system
    equations = system.equations(transition.from_mode)
    at = {
        TIME: sp.Float(transition.time, 30) + sp.Float(transition.time_low, 30),
        **dict(zip(system.states, (sp.Float(x, 30) for x in transition.state), strict=True)),
    }
    speeds = [sp.Integer(1), *(system.numeric(f).subs(at) for f in equations.field)]
    best = inf
    for guard in equations.guards:
        if guard.index != transition.surface or guard.kind == "valid" or transition.kind == "graze":
            continue
        slopes = [system.numeric(sp.diff(guard.expression, z)).subs(at) for z in (TIME, *system.states)]
        size = sum(abs(slope * z) for slope, z in zip(slopes, at.values(), strict=True))
        size += sum(abs(slope) * abs(float(x)) for slope, x in zip(slopes[1:], problem.initial, strict=True))
        speed = abs(sum(slope * v for slope, v in zip(slopes, speeds, strict=True))) * unit
        best = min(best, float(size / speed) if speed > 0 else inf)
    return 1.0 if best == inf else best


@dataclass(frozen=True)
class _Scaled:
    times: list[sp.Expr]
    modes: list[tuple[int, ...]]


def _scaled(reading: Reading) -> _Scaled:
    """Transition times in units of the reading's T."""
    unit = next(v for p, v in reading.problem.system.parameters.items() if p.name == "T")
    run = _run(reading)
    times = [(sp.Rational(t.time) + sp.Rational(t.time_low)) / unit for t in run.transitions]
    return _Scaled(times, [t.to_mode for t in run.transitions])


def test_other_units_give_the_same_digits() -> None:
    case = load_case(CASES / "hard" / "units.yaml")
    plain = _scaled(case.reading("plain"))
    assert len(plain.times) == 8
    others = [r for r in case.readings if r.name not in ("plain", "coulomb_small", "coulomb_large")]
    assert len(others) == 8
    for reading in others:
        scaled = _scaled(reading)
        assert scaled.modes == plain.modes
        for ours, theirs in zip(scaled.times, plain.times, strict=True):
            assert abs(float((ours - theirs) / theirs)) <= 2 * 2.0**-52, reading.name


def test_readme_lists_the_cases(monkeypatch: pytest.MonkeyPatch) -> None:
    catalogue = runpy.run_path(str(CASES.parent / "docs" / "catalogue.py"))["catalogue"]
    monkeypatch.setitem(catalogue.__globals__, "load_case", read)
    assert (CASES / "README.md").read_text(encoding="utf-8") == catalogue(), "run python docs/catalogue.py"


def test_every_case_of_the_suite_is_documented() -> None:
    names = [case.name for case in shipped()]
    assert len(names) == len(set(names)), "two cases of one name would share a report"
    for case in shipped():
        assert case.path is not None
        assert (case.name, tuple(r.name for r in case.readings)) == (case.path.stem, readings(case.path))
        assert case.source
        for reading in case.readings:
            assert reading.story, case.name
            assert reading.equations, case.name
            assert reading.tags, case.name
