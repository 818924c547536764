"""Functions that the loop calls by their address are loaded when a run first needs them, and nothing is seen of it."""

from __future__ import annotations

import time
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules

import numba
import numpy as np
import pytest
from numba import float64, int64
from numba.core.dispatcher import Dispatcher

from henon_ref import henon
from henon_ref.henon import apart, polynomial
from henon_ref.henon import registers as k
from henon_ref.henon import session as sessions
from henon_ref.henon.solvers import HENON_BRENT, HENON_SOLVER
from henon_ref.henon.views import row_of
from henon_ref.model.case import load_case

CASES = Path(__file__).parent.parent / "cases"


NEEDED = {
    "a step that is not told by the last ones": (k.A_TRUSTED, "stribeck_belt.yaml", "default", HENON_SOLVER),
    "signs that leave a root open": (k.A_ISOLATE, "classic/relay_feedback.yaml", "default", HENON_SOLVER),
    "a surface just left": (k.A_FACTORED, "classic/nonstop_coulomb.yaml", "default", HENON_SOLVER),
    "a flat touch": (k.A_FLAT, "hard/grazing_fourth_order.yaml", "exact", HENON_SOLVER),
    "a value below zero": (k.A_BELOW, "hard/near_ties.yaml", "d_1e_9", HENON_SOLVER),
    "a hold zone": (k.A_HELD, "hard/static_entry.yaml", "from_below", HENON_SOLVER),
    "a polynomial of a higher degree": (k.A_STEADY, "hard/grazing_fourth_order.yaml", "outside1e2", HENON_SOLVER),
    "Brent's landing": (k.A_BRENT, "free_coulomb.yaml", "default", HENON_BRENT),
}


@pytest.mark.parametrize("what", NEEDED)
def test_a_run_that_has_to_wait_for_a_function_is_the_same(what: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Transitions, end and counts, to the last bit; and it is asked for once."""
    place, file, reading, solver = NEEDED[what]
    asked: list[int] = []

    def load(place: int) -> None:
        asked.append(place)
        apart.load(place)

    monkeypatch.setattr(apart, "_table", np.zeros_like(apart._table))
    monkeypatch.setattr(sessions, "load", load)
    run = solver.prepare(load_case(CASES / file).reading(reading).problem, rtol=1e-9)
    first, again = run(), run()
    assert place in asked
    assert len(set(asked)) == len(asked)
    assert list(first.transitions) == list(again.transitions)
    assert first._replace(transitions=()) == again._replace(transitions=())


def test_no_function_that_stands_apart_is_left_out_of_this() -> None:
    """Every one is asked for by one of these runs, or loaded with one that is, or with the loop."""
    asked = {place for place, *_ in NEEDED.values()}
    assert asked | {*k.ALWAYS} == {*range(1, k.A_SIZE)} == {*apart.FUNCTIONS}


def test_what_the_compiler_may_fuse_is_compiled_in_one_place() -> None:
    """In the process that compiles it would be there twice, by itself and in who calls it, with other last digits."""
    modules = [import_module(f"henon_ref.henon.{each.name}") for each in iter_modules(henon.__path__)]
    compiled = {made for module in modules for made in vars(module).values() if isinstance(made, Dispatcher)}
    fused = {made for made in compiled if made.targetoptions.get("fastmath")}
    inlined = {made for made in fused if made.targetoptions.get("forceinline")}
    assert fused - inlined == {apart.FUNCTIONS[k.A_LAND][0], apart.FUNCTIONS[k.A_BRENT][0]}
    assert len(inlined) > 10


def test_compiling_it_is_not_counted_against_a_deadline(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = load_case(CASES / "stribeck_belt.yaml").reading("default").problem
    HENON_SOLVER.prepare(problem, rtol=1e-9)()  # what is compiled is compiled now
    monkeypatch.setattr(apart, "_table", np.zeros_like(apart._table))
    waited = 0

    def slow(place: int) -> None:
        nonlocal waited
        waited += 1
        time.sleep(0.3)
        apart.load(place)

    run = HENON_SOLVER.prepare(problem, rtol=1e-9, deadline=0.2)
    monkeypatch.setattr(sessions, "load", slow)
    assert (run().status, waited) > ("ok", 0)


def test_the_loop_does_not_compile_with_other_types_than_a_function_takes(monkeypatch: pytest.MonkeyPatch) -> None:
    """A wrong type would be read as something else: compiled code checks nothing when it runs."""
    monkeypatch.setattr(apart, "FUNCTIONS", {})
    value = apart.apart(k.A_LAND, polynomial.value, float64, apart.ROW, int64, float64)

    @numba.njit
    def wrong(integers, q, degree):  # type: ignore[no-untyped-def]
        return value(row_of(integers), q, degree, 1)

    with pytest.raises(numba.TypingError, match="value takes"):
        wrong(np.zeros(k.I_SIZE, dtype=np.int64), np.zeros(3), 2)
