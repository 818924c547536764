"""Generated machine code: phases, linear forms, and convolutions in vector lanes against plain recurrences."""

from __future__ import annotations

import ctypes
import math
import random

import mpmath
import numpy as np
import pytest
import sympy as sp

from henon_ref.jit.ir_writer import declarations, row_length
from henon_ref.jit.native_module import NativeModule
from henon_ref.taylor.llvm.expansion import expansion_ir
from henon_ref.taylor.llvm.linear_forms import Forms
from henon_ref.taylor.series import expand
from henon_ref.taylor.tape import TIME, Tape, build_tape

x, y, z = sp.symbols("x y z", real=True)
a, b = sp.symbols("a b", real=True)


def run(
    tape: Tape, constants: list[float], time: tuple[float, float], at: list[float], order: int, sigma: float = 1.0
) -> np.ndarray:
    """Coefficients by the machine code, times powers of sigma; a constant's remainder stands behind all constants."""
    code = NativeModule(declarations() + expansion_ir(tape, len(at), order, "f"))
    function = ctypes.CFUNCTYPE(None, *[ctypes.c_double] * 3, *[ctypes.c_void_p] * 3)(code.address("f"))
    k, start = np.array(constants), np.array(at)
    out = np.zeros((len(at) + len(tape.outputs) + 1, row_length(order)))
    function(*time, sigma, start.ctypes.data, k.ctypes.data, out.ctypes.data)
    return out


def test_sines_of_a_phase_are_right_to_a_unit_of_the_last_place() -> None:
    """sin and cos of w t + p in double-double, from tiny phases to beyond the reach of the reduction."""
    tape = build_tape((x,), [x], [sp.sin(a * TIME + b), sp.cos(a * TIME + b)])
    code = NativeModule(declarations() + expansion_ir(tape, 1, 0, "f"))
    function = ctypes.CFUNCTYPE(None, *[ctypes.c_double] * 3, *[ctypes.c_void_p] * 3)(code.address("f"))
    drawn = random.Random(7)
    worst = 0.0
    mpmath.mp.prec = 200
    places = [drawn.uniform(-1, 1) * 10.0 ** drawn.randint(-8, 11) for _ in range(3000)]
    places += [k * math.pi / 2 for k in range(-9, 10)] + [k * math.pi / 4 for k in range(-9, 10)]
    out, start = np.zeros((3, row_length(0))), np.zeros(1)
    for place in places:
        slope, shift = drawn.uniform(0.1, 3), drawn.uniform(-2, 2)
        t = place / slope
        low = 0.3 * math.ulp(t)
        k = np.zeros(2 * len(tape.constants))
        for i, c in enumerate(tape.constants):
            k[i] = float(c.subs({a: slope, b: shift}))
        function(t, low, 1.0, start.ctypes.data, k.ctypes.data, out.ctypes.data)
        phase = mpmath.mpf(slope) * (mpmath.mpf(t) + mpmath.mpf(low)) + mpmath.mpf(shift)
        for found, exact in zip(out[1:, 0], (mpmath.sin(phase), mpmath.cos(phase)), strict=True):
            worst = max(worst, float(abs(found - exact)) / max(math.ulp(float(exact)), 1e-19))
    assert worst < 1.0


def test_a_phase_that_is_no_number_stays_none() -> None:
    tape = build_tape((x,), [x], [sp.sin(TIME)])
    assert math.isnan(run(tape, [0.0, 1.0, 0.0, 0.0], (math.inf, 0.0), [0.0], 0)[1, 0])


@pytest.mark.parametrize("order", [3, 7, 8, 12, 13, 20, 31])
def test_lanes_of_convolutions_add_up(order: int) -> None:
    """Products, quotients and reciprocals side by side, more of them than one vector holds, at any order."""
    field = [y * sp.sin(TIME) - x, 1 / (2 + a * y) - x * y * z, x**3 + z / (3 + y) + 1 / (4 + x * z)]
    field = [f.subs(a, sp.Rational(1, 3)) for f in field]
    tape = build_tape((x, y, z), field, [x + 2 * z - 1, x * y])
    numbers = [float(c) for c in tape.constants]
    point = [0.4, -0.3, 0.6]
    states, outputs = expand(tape, numbers, 0.3, point, order)
    out = run(tape, [*numbers, *[0.0] * len(numbers)], (0.3, 0.0), point, order)
    np.testing.assert_allclose(out[:5, : order + 1], np.array(states + outputs), rtol=3e-12, atol=1e-15)


@pytest.mark.parametrize("order", [3, 4, 9, 16, 24])
@pytest.mark.parametrize(
    "field",
    [
        # Quotients and a reciprocal with denominators in common.
        [x / (1 + y) + y / (1 + y), -x + y / (3 + x), z],
        # A sine that a rate and a reciprocal read; one that only one of them reads; sine and cosine of one clock.
        [3 * sp.sin(TIME) + 1 / (2 + sp.sin(TIME)), sp.cos(2 * TIME) - x * sp.sin(2 * TIME), 5 * sp.cos(TIME) - z * z],
        # States that follow one another: a chain, a circle, and one that follows itself.
        [2 * y, 3 * z, x * y],
        [y, z, -x],
        [y, y, -2 * z],
        # A form of a followed state, read by products.
        [3 * y, -((x - 2 * sp.sin(TIME)) ** 3) - 1 / (1 + y * y), z * (x - sp.sin(TIME))],
        # A reciprocal read by one rate, by two, and by a product.
        [7 / (2 + y), 1 / (3 + x) - 5 / (2 + y), z / (4 + z)],
    ],
)
def test_coefficients_are_those_of_the_recurrences_whatever_is_folded(field: list[sp.Expr], order: int) -> None:
    """Whatever is folded, skipped or stored from another row: the coefficients are those of plain recurrences."""
    tape = build_tape((x, y, z), field, [x - 2 * y, z * x + sp.cos(3 * TIME)])
    numbers = [float(c) for c in tape.constants]
    point = [0.4, -0.3, 0.6]
    states, outputs = expand(tape, numbers, 0.3, point, order)
    out = run(tape, [*numbers, *[0.0] * len(numbers)], (0.3, 0.0), point, order)
    np.testing.assert_allclose(out[:5, : order + 1], np.array(states + outputs), rtol=3e-12, atol=1e-15)
    assert not out[:5, order + 1 :].any()


def test_a_row_behind_its_coefficients_is_zero() -> None:
    tape = build_tape((x,), [-x * x], [1 - x])
    out = run(tape, [1.0, 0.0, 0.0, 0.0], (0.0, 0.0), [0.5], 9)
    assert not out[:2, 10:].any()


def test_linear_forms_stop_at_what_a_product_reads() -> None:
    """The sum that is squared is made once; the rate reads it instead of its parts."""
    tape = build_tape((x, y), [y, -a * (x - y) + (x - y) ** 2], [])
    forms = Forms(tape)
    form = forms.of(tape.field[1])
    (kept,) = forms.kept
    assert kept in form.terms
    assert set(forms.of(kept).terms) == {i for i, n in enumerate(tape.nodes) if n.op == "state"}


def test_a_reciprocal_reads_through_scale_and_shift() -> None:
    tape = build_tape((x, y), [1 / (1 + a * (y - b)), x], [])
    forms = Forms(tape)
    (base, _), *others = forms.affine_arguments.values()
    assert tape.nodes[base].op == "state"
    assert not others
    assert not forms.kept
