"""Functions that the loop calls by their address are loaded when a run first needs them, and nothing is seen of it."""

from __future__ import annotations

import time
from pathlib import Path

import numba
import numpy as np
import pytest
from numba import float64, int64

from henon_ref.henon import apart, polynomial
from henon_ref.henon import registers as k
from henon_ref.henon import session as sessions
from henon_ref.henon.solvers import HENON_BRENT, HENON_SOLVER
from henon_ref.model.case import load_case

CASES = Path(__file__).parent.parent / "cases"


NEEDED = {
    "a step that is not told by the last ones": (k.A_TRUSTED, "stribeck_belt.yaml", "default", HENON_SOLVER),
    "signs that leave a root open": (k.A_ISOLATE, "classic/relay_feedback.yaml", "default", HENON_SOLVER),
    "a surface just left": (k.A_FACTORED, "classic/nonstop_coulomb.yaml", "default", HENON_SOLVER),
    "a flat touch": (k.A_FLAT, "hard/grazing_fourth_order.yaml", "exact", HENON_SOLVER),
    "a value below zero": (k.A_BELOW, "hard/near_ties.yaml", "d_1e_9", HENON_SOLVER),
    "a hold zone": (k.A_HELD, "hard/static_entry.yaml", "from_below", HENON_SOLVER),
    "Brent's landing": (k.A_BRENT, "free_coulomb.yaml", "default", HENON_BRENT),
}


@pytest.mark.parametrize("what", NEEDED)
def test_a_run_that_has_to_wait_for_a_function_is_the_same(what: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Transitions, end and counts, to the last bit; and it is asked for once."""
    register, file, reading, solver = NEEDED[what]
    asked: list[int] = []

    def load(register: int) -> int:
        asked.append(register)
        return apart.load(register)

    monkeypatch.setattr(apart, "_addresses", {always: apart.load(always) for always in k.ALWAYS})
    monkeypatch.setattr(sessions, "load", load)
    run = solver.prepare(load_case(CASES / file).reading(reading).problem, rtol=1e-9)
    first, again = run(), run()
    assert register in asked
    assert len(set(asked)) == len(asked)
    assert list(first.transitions) == list(again.transitions)
    assert first._replace(transitions=()) == again._replace(transitions=())


def test_compiling_it_is_not_counted_against_a_deadline(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = load_case(CASES / "stribeck_belt.yaml").reading("default").problem
    HENON_SOLVER.prepare(problem, rtol=1e-9)()  # what is compiled is compiled now
    monkeypatch.setattr(apart, "_addresses", {always: apart.load(always) for always in k.ALWAYS})

    def slow(register: int) -> int:
        time.sleep(0.3)
        return apart.load(register)

    monkeypatch.setattr(sessions, "load", slow)
    assert HENON_SOLVER.prepare(problem, rtol=1e-9, deadline=0.2)().status == "ok"


def test_the_loop_does_not_compile_with_other_types_than_a_function_takes(monkeypatch: pytest.MonkeyPatch) -> None:
    """A wrong type would be read as something else: compiled code checks nothing when it runs."""
    monkeypatch.setattr(apart, "FUNCTIONS", {})
    value = apart.apart(k.A_LAND, polynomial.value, float64, apart.ROW, int64, float64)

    @numba.njit
    def wrong(integers, q, degree):  # type: ignore[no-untyped-def]
        return value(integers, q, degree, 1)

    with pytest.raises(numba.TypingError, match="value takes"):
        wrong(np.zeros(k.I_SIZE, dtype=np.int64), np.zeros(3), 2)
