"""Loops over nodes of the same shape, and several expansions at once, against straight-line code: the same bits, for
every rule and kind of row."""

from __future__ import annotations

import ctypes

import numpy as np
import pytest
import sympy as sp
from often import daily

from henon_ref.jit.ir_writer import LANES, declarations, row_length
from henon_ref.jit.native_module import NativeModule
from henon_ref.taylor.llvm.expansion import expansion_ir, lanes_expansion_ir
from henon_ref.taylor.llvm.looped import looped_expansion_ir
from henon_ref.taylor.llvm.step import looped_step_end_ir, step_end_ir
from henon_ref.taylor.rules import RULES
from henon_ref.taylor.tape import TIME, Tape, build_tape

EXPANSION = ctypes.CFUNCTYPE(None, *[ctypes.c_double] * 3, *[ctypes.c_void_p] * 3)
SEVERAL = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 4)
STEP_END = ctypes.CFUNCTYPE(None, ctypes.c_double, *[ctypes.c_void_p] * 2)
k, c = sp.symbols("k c", real=True)


def states_of(n: int) -> tuple[sp.Symbol, ...]:
    return tuple(sp.Symbol(f"x{i}", real=True) for i in range(n))


def chain(blocks: int) -> Tape:
    """Blocks with springs and friction that falls with the speed; guards that are linear, and others."""
    x = states_of(2 * blocks)
    field, guards = list(x[blocks:]), []
    for i in range(blocks):
        force = -x[i]
        force += sum(k * (x[j] - x[i]) for j in (i - 1, i + 1) if 0 <= j < blocks)
        sign = sp.Symbol(f"s{i}", real=True)
        field.append(force - sign / (1 + c * sign * (x[blocks + i] - sp.Rational(1, 2))))
        guards += [sign * (x[blocks + i] - sp.Rational(1, 2)), k * x[i] - x[blocks + i] / (1 + x[i])]
    return build_tape(x, field, guards)


def mean_field(n: int) -> Tape:
    """Each state is pulled to the mean of all, by a function with a step bound of its own."""
    x = states_of(n)
    mean = sp.Add(*x) / n
    return build_tape(x, [sp.tanh(mean - k * xi) + sp.exp(-xi) * sp.sin(TIME) for xi in x], [mean, x[0] * mean - 1])


def polynomials(n: int) -> Tape:
    """Motions that are polynomials in time, of all degrees from 1 on: rows that end early."""
    x = states_of(n)
    return build_tape(x, [c, *(k * xi for xi in x[:-1])], [x[0] + x[-1], x[1] * x[2], 3 + 0 * x[0], TIME**2 - x[0]])


def every_operation() -> list[Tape]:
    """Tapes that hold, between them, every operation that a tape can have: the suite's cases do not."""
    x, y = sp.symbols("x y", real=True)
    t, third = TIME, sp.Rational(1, 3)
    functions = [
        sp.exp(-x / 3) + sp.log(2 + x**2) + sp.sin(x) * sp.cos(y) + sp.sinh(x) * sp.cosh(y),
        sp.tan(x / 4) + sp.tanh(y) + sp.atan(x * y) + sp.asin(x / 5) - sp.acos(y / 7),
        sp.sqrt(3 + x) / sp.sqrt(3 + x * y) + (2 + x) ** third + (x - 1) / (y + 3) ** 2 + 1 / (1 + y),
        t**2 * sp.sin(3 * t + 1) + 5 * sp.cos(t) + (x + y) ** 5 / 5 - x**3 + 3 * sp.exp(t) + (1 + t) ** third,
        7 / (2 + y) + (y - sp.sin(t)) ** 3 * x + (1 + x**2) ** y,
    ]
    tapes = [build_tape((x, y), [f, x - y], [x * f]) for f in functions]
    return [*tapes, build_tape((x, y), [2 * y, sum(functions)], [x - 2 * y, *functions])]


TAPES = [
    *(pytest.param(tape, 2, id=f"operations{i}") for i, tape in enumerate(every_operation())),
    pytest.param(chain(5), 10, id="chain"),
    pytest.param(mean_field(6), 6, id="mean field"),
    pytest.param(polynomials(7), 7, id="polynomials"),
    pytest.param(build_tape(states_of(2), [], [k * states_of(2)[0], states_of(2)[1] ** 3]), 2, id="no field"),
]


def test_the_tapes_hold_every_rule() -> None:
    assert {node.op for tape in every_operation() for node in tape.nodes} >= RULES.keys()


@pytest.mark.parametrize(("tape", "states"), TAPES)
@pytest.mark.parametrize("order", daily([0, 1, 3, 4, 7, 8, 13, 24], some=[0, 1, 4, 7, 13]))
def test_loops_have_the_bits_of_straight_line_code(tape: Tape, states: int, order: int) -> None:
    if order and not tape.field:
        pytest.skip("values alone")
    width = max(row_length(order), row_length(4))
    text = expansion_ir(tape, states, order, "straight", width) + looped_expansion_ir(tape, states, order, "l", width)
    code = NativeModule(declarations() + text, optimised=False)
    drawn = np.random.default_rng(order)
    for t in (0.0, 0.7, 5.1):
        x = drawn.uniform(0.1, 0.9, states)
        constants = [drawn.uniform(-1.2, 1.2) if each.free_symbols else float(each) for each in tape.constants]
        constants = np.array([*constants, *(1e-17 * each for each in constants), 0.0])
        rows = [np.full((states + len(tape.outputs) + 4, width), 7.0) for _ in range(2)]
        for name, row in zip(("straight", "l"), rows, strict=True):
            row[:, order + 1 :] = 0.0
            arguments = (each.ctypes.data for each in (x, constants, row))
            EXPANSION(code.address(name))(t, 0.3 * np.spacing(t), 0.37, *arguments)
        assert np.isfinite(rows).all()
        of_sum = (states + len(tape.outputs)) * width + 2
        rows[0].flat[of_sum] = rows[1].flat[of_sum]  # of this sum only whether it is finite is used
        np.testing.assert_array_equal(*rows)


@pytest.mark.parametrize(("tape", "states"), TAPES[:-1])
@pytest.mark.parametrize("order", daily([3, 4, 7, 8, 13, 24], some=[3, 8, 13]))
def test_several_expansions_have_the_bits_of_each(tape: Tape, states: int, order: int) -> None:
    """Each lane has its own time (one beyond the reach of the reduction of phases), unit, state and constants."""
    text = expansion_ir(tape, states, order, "one") + lanes_expansion_ir(tape, states, order, "several")
    code = NativeModule(declarations() + text, optimised=False)
    drawn, rows = np.random.default_rng(order), states + len(tape.outputs)
    times = np.array([[0.0, 0.7, 3e15, 5.1], [0.0, 1e-17, 0.1, -3e-16], [0.37, 0.2, 1e-3, 0.6]])
    x, constants = drawn.uniform(0.1, 0.9, (LANES, states)), []
    for _ in range(LANES):
        own = [drawn.uniform(-1.2, 1.2) if each.free_symbols else float(each) for each in tape.constants]
        constants.append(np.array([*own, *(1e-17 * each for each in own), 0.0]))
    alone, together = np.zeros((2, LANES, rows + 1, row_length(order)))
    pointers = [(ctypes.c_void_p * LANES)(*(row.ctypes.data for row in each)) for each in (x, constants, together)]
    SEVERAL(code.address("several"))(times.ctypes.data, *pointers)
    for lane in range(LANES):
        arguments = (each.ctypes.data for each in (x[lane], constants[lane], alone[lane]))
        EXPANSION(code.address("one"))(*times[:, lane], *arguments)
    assert np.isfinite(alone[[0, 1, 3]]).all()
    np.testing.assert_array_equal(alone, together)


@pytest.mark.parametrize("order", [3, 12])
def test_a_row_that_is_not_finite_shows_in_the_sum(order: int) -> None:
    code = NativeModule(declarations() + looped_expansion_ir(chain(5), 10, order, "looped"))
    for broken in range(10):
        x = np.full(10, 0.2)
        x[broken] = np.nan
        rows = np.zeros((21, row_length(order)))
        constants = np.zeros(100)
        EXPANSION(code.address("looped"))(0.0, 0.0, 0.37, x.ctypes.data, constants.ctypes.data, rows.ctypes.data)
        assert np.isnan(rows[-1, 2])


@pytest.mark.parametrize("order", [4, 12, 24])
def test_ends_of_steps_have_the_same_bits(order: int) -> None:
    code = NativeModule(step_end_ir(5, 3, order, "straight") + looped_step_end_ir(5, 3, order, "looped"))
    rows = np.random.default_rng(order).uniform(-1, 1, (8, row_length(order)))
    found = [np.zeros(8), np.zeros(8)]
    for name, out in zip(("straight", "looped"), found, strict=True):
        STEP_END(code.address(name))(0.7, rows.ctypes.data, out.ctypes.data)
    np.testing.assert_array_equal(*found)


def test_code_does_not_grow_with_the_chain() -> None:
    """But for the tables of places."""
    lengths = [looped_expansion_ir(chain(n), 2 * n, 12, "f").count("\n") for n in (20, 60)]
    assert lengths[0] == lengths[1]
