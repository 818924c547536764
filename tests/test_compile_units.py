"""Compile units: functions that the loop calls by symbol."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import Any

import numba
import numpy as np
import pytest
from numba import float64, int64
from numba.core.dispatcher import Dispatcher

from henon_ref import henon
from henon_ref.henon import compile_units, landing, polynomial
from henon_ref.henon.solvers import HENON_SOLVER
from henon_ref.model.case import load_case

CASES = Path(__file__).parent.parent / "cases"


def test_what_the_compiler_may_fuse_is_compiled_in_one_place() -> None:
    """In the process that compiles it would be there twice, by itself and in who calls it, with other last digits."""
    modules = [import_module(f"henon_ref.henon.{each.name}") for each in iter_modules(henon.__path__)]
    compiled = {made for module in modules for made in vars(module).values() if isinstance(made, Dispatcher)}
    fused = {made for made in compiled if made.targetoptions.get("fastmath")}
    inlined = {made for made in fused if made.targetoptions.get("forceinline")}
    assert fused - inlined == {landing.land, landing.brent}
    assert {landing.land, landing.brent} <= {function for function, _ in compile_units.UNITS.values()}
    assert len(inlined) > 10


def test_nothing_is_compiled_but_before_a_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a system whose modes are all known at the start: steps, landings, a graze."""

    def never(*_: Any, **__: Any) -> None:
        raise AssertionError("compiled")

    for file, reading in (("stribeck_belt.yaml", "default"), ("hard/grazing.yaml", "inside1e10")):
        run = HENON_SOLVER.prepare(load_case(CASES / file).reading(reading).problem, rtol=1e-9)
        with monkeypatch.context() as patch:
            patch.setattr(Dispatcher, "compile", never)
            assert run().status == "ok"


def test_the_loop_does_not_compile_with_other_types_than_a_unit_takes(monkeypatch: pytest.MonkeyPatch) -> None:
    """A wrong type would be read as something else: compiled code checks nothing when it runs."""
    monkeypatch.setattr(compile_units, "UNITS", {})
    value = compile_units.unit(polynomial.value, float64, compile_units.ROW, int64, float64)

    @numba.njit
    def wrong(q, degree):  # type: ignore[no-untyped-def]
        return value(q, degree, 1)

    with pytest.raises(numba.TypingError, match="value takes"):
        wrong(np.zeros(3), 2)


def test_no_two_units_have_one_symbol(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compile_units, "UNITS", {})
    compile_units.unit(polynomial.value, float64, compile_units.ROW, int64, float64)
    with pytest.raises(AssertionError, match="two compile units"):
        compile_units.unit(polynomial.value, float64, compile_units.ROW, int64, float64)
