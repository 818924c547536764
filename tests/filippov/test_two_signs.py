"""Where both normal velocities are clear of zero their signs decide, as the full search of modes does."""

from __future__ import annotations

import math

import pytest
import sympy as sp

from henon_ref.filippov.equations import Guard
from henon_ref.filippov.switching import Switching
from henon_ref.filippov.system import FilippovSystem
from henon_ref.filippov.two_signs import CLEAR, sign_after

X, S = sp.symbols("x s", real=True)


@pytest.mark.parametrize("below", [-2, 1, sp.Rational(1, 10**6)])
@pytest.mark.parametrize("above", [-1, 3, -sp.Rational(1, 10**6)])
def test_the_signs_say_what_the_search_of_modes_finds(below, above):
    field = (below * (1 - S) + above * (1 + S)) / 2
    system = FilippovSystem((X,), (S,), (X,), (field,))
    sign = sign_after(float(below), float(above))
    assert (sign is None) == (below < 0 < above)
    if sign is None:
        return
    for mode in ((-1,), (1,)):
        (hit,) = (g for g in system.equations(mode).guards if g.kind == "surface")
        assert isinstance(hit, Guard)
        assert Switching(system).after_event(0.0, (0.0,), mode, [hit]).mode == (sign,)


@pytest.mark.parametrize("velocity", [0.0, 0.5 * CLEAR, -0.5 * CLEAR, math.nan])
def test_a_velocity_near_zero_decides_nothing(velocity):
    for other in (-1.0, 1.0):
        assert sign_after(velocity, other) is sign_after(other, velocity) is None
