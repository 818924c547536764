"""Several runs of one integrator at once, from several threads: equal bit for bit to one after the other."""

from __future__ import annotations

import sys
import weakref
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from threading import Barrier, Event, Thread

import pytest
import sympy as sp
from problems import make_problem

import henon_ref as hr
from henon_ref.casefile.case import load_case
from henon_ref.harness.studies.price.chains import chain
from henon_ref.integrator.integrator import Integrator, Start
from henon_ref.integrator.run import Run, run_to_horizon
from henon_ref.kernel.library import ffi, kernel
from henon_ref.modes.problem import Problem
from henon_ref.trajectory import Trajectory

CASES = Path(__file__).parents[2] / "cases"
THREADS, EACH = 4, 6


@pytest.fixture(autouse=True)
def switch_often() -> Iterator[None]:
    """Threads take turns within every few operations of Python, not every 5 ms."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


def text(run: Trajectory) -> str:
    """Every double of a run, to the last bit."""
    transitions = [(t.kind, t.surface, t.to_mode, t.time, t.time_low, t.state) for t in run.transitions]
    return repr((run.status, transitions, run.end_time, run.end_state, run.end_mode))


def starts(integrator: Integrator, problem: Problem) -> list[Start]:
    """The problem's own, and some that do not go on as long: the same system, other runs."""
    length = problem.until - problem.start
    parts = [replace(problem, until=problem.start + length * part / 10) for part in (10, 9, 8)]
    return [integrator.start(part, tolerance=1e-12) for part in parts]


@pytest.mark.parametrize(
    ("path", "reading"),
    [
        ("hard/two_roots.yaml", None),
        ("hard/grazing_ballistic.yaml", "exact"),
        ("hard/simultaneous_events.yaml", "three"),
        ("hard/two_contacts.yaml", None),
        ("classic/three_blocks.yaml", "default"),
        ("two_blocks.yaml", "default"),
        ("stribeck_belt.yaml", None),
    ],
)
def test_runs_at_once_are_those_one_after_the_other(path: str, reading: str | None) -> None:
    case = load_case(CASES / path)
    problem = (case.reading(reading) if reading else case.readings[0]).problem
    alone = Integrator(problem.system, 18)
    expected = [text(Run(alone, start).to_horizon()) for start in starts(alone, problem)]
    assert len(set(expected)) > 1, "runs that are all the same would show nothing"

    fresh = Integrator(problem.system, 18)  # modes are compiled by whoever meets them first
    several, barrier = starts(fresh, problem), Barrier(THREADS)

    def work(thread: int) -> list[tuple[int, str]]:
        barrier.wait(60)
        turns = [(thread + k) % len(several) for k in range(EACH)]
        if thread % 2:  # by the short way of most runs
            return [(at, text(run_to_horizon(fresh, several[at]))) for at in turns]
        runs = [(at, Run(fresh, several[at])) for at in turns]
        return [(at, text(run.to_horizon())) for at, run in runs]

    with ThreadPoolExecutor(THREADS) as pool:
        for done in pool.map(work, range(THREADS)):
            assert [found for _, found in done] == [expected[at] for at, _ in done]


@pytest.mark.parametrize("run", [run_to_horizon, lambda *begun: Run(*begun).to_horizon()])
def test_data_that_another_thread_replaces_stay_until_the_loop_returns(run, monkeypatch: pytest.MonkeyPatch) -> None:
    problem = make_problem("x", ["t - s"], {"s": "x"}, [0], 3)
    integrator = Integrator(problem.system, 8)
    start = integrator.start(problem, tolerance=1e-6)
    memory, held = weakref.ref(start.constants.latest.memory), []

    def loop(*_: object) -> int:
        start.constants.latest = None  # as an update does
        held.append(memory() is not None)
        return kernel.HORIZON

    monkeypatch.setattr("henon_ref.integrator.run._loop", loop)
    monkeypatch.setattr("henon_ref.integrator.run._whole_run", loop)
    run(integrator, start)
    assert held == [True]


def turns_beside_a_compiled_call() -> int:
    """Count the turns of a loop in this thread while another thread is in one compiled call."""
    problem = make_problem("x y", ["y", "-x"], {"s": "x - 2"}, [0, 1], 10**6)
    integrator = Integrator(problem.system, 18)
    run = Run(integrator, integrator.start(problem, tolerance=1e-12))
    begun, ended, turns = Event(), Event(), 0

    def one_call() -> None:
        begun.set()
        kernel.advance(run.workspace.run, run.start.constants.latest.tables, ffi.NULL, 0)  # 50,000 steps
        ended.set()

    thread = Thread(target=one_call)
    thread.start()
    begun.wait()
    while not ended.is_set():
        turns += 1
    thread.join()
    return turns


def test_a_compiled_call_lets_go_of_the_interpreter_lock() -> None:
    """If the call kept the lock, this thread would get no turn. On a busy machine it may miss a call or two."""
    assert any(turns_beside_a_compiled_call() > 1000 for _ in range(20))


def test_a_workspace_serves_the_next_run() -> None:
    problem = make_problem("x", ["t - s"], {"s": "x"}, [0], 3)
    integrator = Integrator(problem.system, 8)
    start = integrator.start(problem, tolerance=1e-6)
    for _ in range(5):
        Run(integrator, start).to_horizon()
        run_to_horizon(integrator, start)
    assert len(integrator.free) == 1
    both = [Run(integrator, start) for _ in range(2)]
    assert not integrator.free
    assert both[0].to_horizon().end_state == both[1].to_horizon().end_state
    del both
    assert len(integrator.free) == 2


def test_another_problem_of_a_system_without_values_compiles_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """x' = a t - s from 0 slides until t = 1/a; one integrator, the values come with the problem."""
    a, s, t = (sp.Symbol(name, real=True) for name in "ast")
    symbolic = replace(make_problem("x", ["t - s"], {"s": "x"}, [0], 3).system, field=(a * t - s,))
    integrator = Integrator(symbolic, 12)

    def released(value: sp.Expr, integrator: Integrator) -> float:
        problem = Problem(replace(symbolic, parameters={a: value}), sp.Integer(0), (sp.Integer(0),), sp.Integer(3))
        run = Run(integrator, integrator.start(problem, tolerance=1e-13)).to_horizon()
        (transition,) = run.transitions
        return transition.time

    assert released(sp.Integer(1), integrator) == 1.0
    monkeypatch.setattr("henon_ref.taylor.machine_code.NativeModule", None)
    monkeypatch.setattr("henon_ref.modes.system.FilippovSystem.shared_equations", None)
    assert released(sp.Integer(2), integrator) == 0.5
    assert released(sp.Rational(1, 2), integrator) == 2.0


def test_contacts_at_rest_are_decided_at_other_parameter_values_without_a_new_tape(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Four blocks at rest on a belt, in a row of springs: one tape for all modes."""
    blocks = chain(4, 0.5)
    start = [value for k in range(4) for value in (0.03 * k, 0.5)]
    first = hr.simulate(blocks, start, until=0.01, parameters={"F": 2.0})
    monkeypatch.setattr("henon_ref.modes.mode_evaluation.build_tape", None)
    monkeypatch.setattr("henon_ref.integrator.precise_modes.constant_program", None)
    other = hr.simulate(blocks, start, until=0.01, parameters={"F": 2.5})
    assert first.final_mode == other.final_mode == "s1=0 s2=0 s3=0 s4=0"


def test_what_was_compiled_before_changes_no_bit_of_a_run_through_more_modes_than_are_remembered() -> None:
    """Seven surfaces crossed at their own rates, so that 128 modes come by; each drives an oscillator another way."""
    names = [f"s{i}" for i in range(7)]
    surfaces = {name: f"sin(x*sqrt({k}))" for name, k in zip(names, (2, 3, 5, 7, 11, 13, 17), strict=True)}
    field = ["1", "v", "-y - y**3 + " + " + ".join(f"{name}/{3 + i}" for i, name in enumerate(names))]
    problem = make_problem("x y v", field, surfaces, ["1/10", 1, 0], 60)

    def run(order_of: Sequence[tuple[int, ...]]) -> tuple[Trajectory, Integrator]:
        integrator = Integrator(problem.system, 10)
        for mode in order_of:
            integrator.mode_table.row(mode)
        return Run(integrator, integrator.start(problem, tolerance=1e-7)).to_horizon(), integrator

    first, integrator = run(())
    modes = integrator.mode_table.modes
    assert len(modes) > kernel.REMEMBERED_STEPS
    again, other = run(modes[::-1])
    assert other.mode_table.modes == modes[::-1]
    assert text(again) == text(first)
    assert again.counts == first.counts
