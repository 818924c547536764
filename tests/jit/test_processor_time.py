"""Deadlines are in processor time, and what is compiled counts for no run; made-up clocks, no real ones."""

from __future__ import annotations

import pytest
from fakes import case, found, trajectory

from henon_ref.baselines.henon import HENON_SOLVER
from henon_ref.baselines.library import DeadlinePassed, Work
from henon_ref.casefile.case import parse_case
from henon_ref.harness.campaign.jobs import run_once
from henon_ref.integrator.mode_table import ModeTable
from henon_ref.integrator.run import Run
from henon_ref.jit import processor_time
from henon_ref.jit.processor_time import Deadline, compile_listener, compiling, run_time
from henon_ref.workers.worker import COMPILING, WorkerState


class Clocks:
    """Wall time and processor time, which pass when they are told to."""

    def __init__(self) -> None:
        self.wall = self.processor = 100.0

    def work(self, seconds: float) -> None:
        self.wall += seconds
        self.processor += seconds

    def wait(self, seconds: float) -> None:
        self.wall += seconds


@pytest.fixture
def clocks(monkeypatch) -> Clocks:
    made = Clocks()
    for module in (processor_time, __import__("henon_ref.baselines.library", fromlist=["library"])):
        monkeypatch.setattr(module, "perf_counter", lambda: made.wall)
    monkeypatch.setattr(processor_time, "thread_time", lambda: made.processor)
    return made


def test_a_deadline_passes_by_work_and_not_by_waiting(clocks):
    deadline = Deadline(1.0)
    for _ in range(5):
        clocks.wait(10.0)
        assert not deadline.passed()
    clocks.work(0.9)
    assert not deadline.passed()
    clocks.work(0.2)
    assert deadline.passed()
    assert deadline.passed()


def test_none_never_passes(clocks):
    deadline = Deadline(None)
    clocks.work(1e9)
    assert not deadline.passed()


def test_what_is_compiled_is_off_the_clock(clocks):
    deadline, began, told = Deadline(1.0), run_time(), []
    with compile_listener(told.append), compiling():
        clocks.work(5.0)
        with compiling():
            clocks.wait(2.0)
    assert told == [None, 5.0]
    clocks.work(0.9)
    assert not deadline.passed()
    assert run_time() - began == pytest.approx(0.9)
    clocks.work(0.2)
    assert deadline.passed()


def test_a_library_s_callbacks_look_at_the_same_clock(clocks):
    work = Work(1.0)
    clocks.wait(10.0)
    work.count_rhs()
    clocks.work(0.6)
    work.count_event()
    clocks.work(0.6)
    with pytest.raises(DeadlinePassed):
        work.check()
    with compiling():
        work.start()
        clocks.work(5.0)
    work.check()


def test_the_time_of_a_run_is_without_what_is_compiled_in_it(clocks):
    told: list[object] = []
    state = WorkerState(lambda kind, value: told.append((kind, value)))

    def run():
        clocks.work(0.25)
        with compiling():
            clocks.work(5.0)
        clocks.work(0.25)
        return trajectory(found())

    state.kept["run"] = run, case().readings[0].problem
    assert run_once(state, 100)[1] == pytest.approx(0.5)
    assert told == [(COMPILING, None), (COMPILING, 5.0)]


def test_the_reference_compiles_off_the_clock_of_its_run(clocks, monkeypatch):
    """Modes of two surfaces are compiled when a run meets them; here that takes longer than the run may."""
    text = case.__globals__["CASE"].replace("state: [x]", "state: [x, y]").replace("{{s: x}}", "{{s: x, r: y}}")
    text = text.replace('["cos(t) - F*s"]', '["cos(t) - F*s", "sin(t) - F*r"]').replace("x: 1}}", "x: 1, y: 1}}")
    problem = parse_case(text.format(name="two")).readings[0].problem
    run = HENON_SOLVER.prepare(problem, rtol=1e-6, deadline=1.0)
    slow, advance, compiled_modes = ModeTable._code, Run._advance, []

    def row(self, mode):
        compiled_modes.append(mode)
        clocks.work(50.0)
        return slow(self, mode)

    def in_pieces(self, *, stop=False):
        clocks.work(0.01)
        return advance(self, stop=stop)

    monkeypatch.setattr(ModeTable, "_code", row)
    monkeypatch.setattr(Run, "_advance", in_pieces)
    assert run().status == "ok"
    assert compiled_modes
