"""Agreement of two precisions, and the result if they disagree."""

from __future__ import annotations

import os
import time
from dataclasses import replace
from typing import Any

import pytest
import systems
from flint import arb

pytest.importorskip("heyoka")

from henon_ref.enclosure.run import EnclosedTransition
from henon_ref.harness.truth.multiprecision import route as multiprecision
from henon_ref.harness.truth.multiprecision.route import multiprecision as route
from henon_ref.harness.truth.multiprecision.run import Instant, Run, simulate
from henon_ref.harness.truth.multiprecision.stepper import _integrator
from henon_ref.harness.truth.proofs import prove
from henon_ref.modes.problem import Problem
from henon_ref.workers.worker import WorkerState


def event(time: str, after: int = 1) -> Instant:
    return (EnclosedTransition("crossing", 0, (-1,), (after,), arb(time), (arb(0),), arb(1)),)


def run(bits: int, *instants: Instant) -> Run:
    return Run(bits, instants=list(instants), end_time=arb(3))


def test_the_radius_holds_the_closed_form_and_is_small() -> None:
    found = route(systems.leaving_slide())
    (release,) = found.transitions
    assert found.status == "ok"
    assert release.kind == "release"
    assert abs(release.time - 1) <= release.radius < 1e-60
    assert not release.proven


def test_fields_that_differ_in_their_numbers_alone_are_compiled_once() -> None:
    """And what one run leaves in an integrator does not reach the next one."""
    problems = [systems.free_coulomb(friction=friction) for friction in ("0.6", "0.7")]
    alone = []
    for problem in problems:
        _integrator.cache_clear()
        alone.append(route(problem).transitions)
        made = _integrator.cache_info().misses
    assert len(alone[0]) > 2
    assert alone[0] != alone[1]
    _integrator.cache_clear()
    assert [route(problem).transitions for problem in (*problems, problems[0])] == [*alone, alone[0]]
    assert _integrator.cache_info().misses == made


@pytest.fixture
def shared(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, Run | None]]:
    """Any problem counts as long; precision and result of each run that a second process did."""
    done, by_worker = [], multiprecision._by_worker

    def noted(problem: Problem, bits: int, *given: Any) -> Run | None:
        done.append((bits, by_worker(problem, bits, *given)))
        return done[-1][1]

    monkeypatch.setattr(multiprecision, "LONG_RUN", -1.0)
    monkeypatch.setattr(multiprecision, "processors", lambda: 2)
    monkeypatch.setattr(multiprecision, "_by_worker", noted)
    return done


def test_a_second_process_does_the_same(shared: list[tuple[int, Run | None]]) -> None:
    """It does the run at the lower precision of a problem that takes long."""
    problem = systems.free_coulomb()
    parts: list[float] = []
    found = route(problem, progress=parts.append)
    ((bits, low),) = shared
    assert bits == 224
    assert low == replace(simulate(problem, 224), seconds=low.seconds)
    assert low.seconds > 0
    assert found.transitions == multiprecision._agreed(problem, simulate(problem, 256), low, seconds=0).transitions
    assert parts == sorted(parts)
    assert parts[-1] > 0.5


def die(state: WorkerState, *given: object) -> None:
    os._exit(1)


def wait(state: WorkerState, *given: object) -> str:
    time.sleep(20)
    return "late"


def test_without_an_answer_of_the_second_process_the_first_does_both_runs(
    shared: list[tuple[int, Run | None]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(multiprecision, "simulation_job", die)
    found = route(systems.free_coulomb())
    assert shared == [(224, None)]
    assert found.bits == (256, 224)
    assert not found.undecided


def test_an_interrupt_ends_the_second_process(
    shared: list[tuple[int, Run | None]], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(done: float) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(multiprecision, "simulation_job", wait)
    with pytest.raises(KeyboardInterrupt):
        route(systems.free_coulomb(), progress=interrupted)
    assert shared == [(224, None)]


def test_the_radius_is_the_difference_of_the_two_runs() -> None:
    late = run(224, event("1.0000000000000000000000000000000001"))
    agreed = multiprecision._agreed(systems.leaving_slide(), run(256, event("1")), late, seconds=0)
    assert agreed.undecided == ""
    assert agreed.transitions[0].radius == pytest.approx(2.2e-34, rel=0.05)


def test_times_known_too_roughly_are_left_out() -> None:
    agreed = multiprecision._agreed(
        systems.leaving_slide(),
        run(256, event("1"), event("2", -1)),
        run(224, event("1"), event("2.000000000001", -1)),
        seconds=0,
    )
    assert len(agreed.transitions) == 1
    assert agreed.status == "failed"
    assert "too roughly" in agreed.undecided
    assert agreed.end_digits.startswith("1.000")


def test_runs_that_see_different_events_end_where_they_part() -> None:
    agreed = multiprecision._agreed(
        systems.leaving_slide(), run(256, event("1"), event("2", 0)), run(224, event("1"), event("2", -1)), seconds=0
    )
    assert len(agreed.transitions) == 1
    assert "different events" in agreed.undecided


def test_runs_that_end_differently_are_undecided() -> None:
    high, low = run(256), replace(run(224), status="nonunique")
    assert "end differently" in multiprecision._agreed(systems.leaving_slide(), high, low, seconds=0).undecided


def test_precision_is_raised_until_it_suffices(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(multiprecision, "LADDER", ((96, 64), (192, 160)))
    found = route(systems.leaving_slide())
    assert found.bits == (192, 160)
    assert not found.undecided


def test_states_below_the_smallest_double_have_a_radius() -> None:
    tiny = tuple(replace(t, state=(arb("5e-320"),)) for t in event("1"))
    agreed = multiprecision._agreed(systems.leaving_slide(), run(256, tiny), run(224, tiny), seconds=0)
    assert 0 < agreed.transitions[0].state_radius < 1e-300


@pytest.mark.parametrize(("start", "until"), [("1", "1.00000000000000001"), ("0", "1e-300")])
def test_a_run_shorter_than_any_double_tells_is_proven_to_have_no_event_or_left_undecided(
    start: str, until: str
) -> None:
    problem = replace(systems.free_coulomb(), start=systems.number(start), until=systems.number(until))
    found = prove(problem, seconds=5)
    assert found.transitions == ()
