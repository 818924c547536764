"""The memory of a run is used again by later runs, and may then hold numbers that are not finite."""

from __future__ import annotations

import ctypes

import numpy as np
import pytest

import henon_ref as hr
from henon_ref.jit.ir_writer import declarations, row_length
from henon_ref.jit.native_module import NativeModule
from henon_ref.taylor.llvm.step import looped_step_end_ir, step_end_ir


@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-9, 1e-12])
def test_a_run_that_diverges_changes_no_later_run(rtol: float) -> None:
    fields = ["v*(1 + s)/2 + v^2*(1 - s)/2", "v^5*(1 + s)/2 - v*(1 - s)/2"]
    system = hr.System(["x", "v"], {}, {"s": "v - 10"}, fields)

    def found(v: float) -> tuple[str, list[float]]:
        run = hr.simulate(system, {"x": 0, "v": v}, until=2, rtol=rtol)
        return run.status, run.y[:, -1].tolist()

    before = found(1)
    assert found(1e58)[0] != "ok"
    assert (before[0], found(1)) == ("ok", before)


@pytest.mark.parametrize("order", [4, 5, 6, 12, 13, 14, 24])
@pytest.mark.parametrize("write", [step_end_ir, looped_step_end_ir])
def test_the_end_of_a_step_reads_nothing_behind_a_row(write, order: int) -> None:
    code = NativeModule(declarations() + write(5, 3, order, "end"))
    call = ctypes.CFUNCTYPE(None, ctypes.c_double, *[ctypes.c_void_p] * 2)(code.address("end"))
    rows, found = np.random.default_rng(order).uniform(-1, 1, (8, row_length(order))), []
    for behind in (0.0, np.nan):
        rows[:, order + 1 :] = behind
        found.append(np.zeros(8))
        call(0.7, rows.ctypes.data, found[-1].ctypes.data)
    np.testing.assert_array_equal(*found)
