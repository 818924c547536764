"""Compile units: functions that the loop calls by symbol."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest
from numba import float64, int64
from numba.core.dispatcher import Dispatcher

from henon_ref.casefile.case import load_case
from henon_ref.henon import compile_units
from henon_ref.henon.solver import HENON_SOLVER
from henon_ref.roots import double as polynomial

CASES = Path(__file__).parents[2] / "cases"


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
    value = compile_units.compile_unit(polynomial.value, float64, compile_units.ROW, int64, float64)

    @numba.njit
    def wrong(q, degree):  # type: ignore[no-untyped-def]
        return value(q, degree, 1)

    with pytest.raises(numba.TypingError, match="value takes"):
        wrong(np.zeros(3), 2)


def test_no_two_units_have_one_symbol(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compile_units, "UNITS", {})
    compile_units.compile_unit(polynomial.value, float64, compile_units.ROW, int64, float64)
    with pytest.raises(AssertionError, match="two compile units"):
        compile_units.compile_unit(polynomial.value, float64, compile_units.ROW, int64, float64)
