"""Modes of a system: Filippov's sliding, its guards and its ends."""

from __future__ import annotations

import pytest
import sympy as sp
from problems import make_problem

from henon_ref.errors import ModelError
from henon_ref.modes.switched_field import Release, SlidingOverride
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.tape import TIME

x1, x2, s = sp.symbols("x1 x2 s", real=True)
mu, vp = sp.symbols("mu vp", positive=True)


def belt() -> FilippovSystem:
    """Eq. (5) of the paper, with -T and a linear spring."""
    v = x2 - vp
    return FilippovSystem((x1, x2), (s,), (v,), (x2, -x1 - s * mu / (1 + s * v)))


def test_stick_moves_with_the_belt() -> None:
    equations = belt().equations((0,))
    assert equations.field == (vp, 0)
    assert sp.simplify(equations.equivalent_signs[0] + x1 / mu) == 0


def test_release_is_where_friction_can_hold_no_longer() -> None:
    guards = belt().equations((0,)).guards
    ends = {g.to_sign: sp.solve(g.expression, x1) for g in guards}
    assert ends == {1: [-mu], -1: [mu]}
    assert all(g.expression.subs(x1, 0) == mu for g in guards)  # positive inside the stick zone


def test_a_moving_surface_is_followed() -> None:
    belt_speed = sp.sin(TIME)
    system = FilippovSystem((x1, x2), (s,), (x2 - belt_speed,), (x2, -x1 - s * mu))
    assert system.equations((0,)).field == (belt_speed, sp.cos(TIME))


def test_sliding_on_a_curved_surface_keeps_h_at_zero() -> None:
    h = x1**2 + x2**2 - 1
    system = FilippovSystem((x1, x2), (s,), (h,), (x2 - s * x1, -x1 - 2 * s * x2 + mu))
    equations = system.equations((0,))
    drift = 2 * x1 * equations.field[0] + 2 * x2 * equations.field[1]
    assert sp.simplify(drift) == 0


def test_friction_that_is_not_linear_in_its_sign_slides_by_the_convex_combination() -> None:
    """On a curved surface sign**2 terms do not cancel by sight: interpolate between the two fields."""
    system = FilippovSystem((x1, x2), (s,), (x1 + x2**3,), (sp.exp(-s) + x2, x1))
    f = [f.subs(s, sign) for sign in (1, -1) for f in system.field]
    above, below = (f[k] + 3 * x2**2 * f[k + 1] for k in (0, 2))
    lam = below / (below - above)
    mixed = [lam * f[0] + (1 - lam) * f[2], lam * f[1] + (1 - lam) * f[3]]
    point = {x2: sp.Rational(1, 3), x1: -sp.Rational(1, 27)}
    expected = [m.subs(point) for m in mixed]
    got = [e.subs(point) for e in system.equations((0,)).field]
    assert [sp.N(a - b, 20, chop=1e-15) for a, b in zip(got, expected, strict=True)] == [0, 0]


def test_two_coupled_contacts_stick_together() -> None:
    """A friction force that acts on both blocks: the equivalent signs solve a linear system."""
    problem = make_problem("a b", ["-2*s - u + t", "-s - 3*u - t"], {"s": "a", "u": "b"}, [0, 0], 1)
    equations = problem.system.equations((0, 0))
    signs = [equations.equivalent_signs[i] for i in (0, 1)]
    f = [e.subs(dict(zip(problem.system.signs, signs, strict=True))) for e in problem.system.field]
    assert [sp.simplify(e) for e in f] == [0, 0]


def test_an_override_replaces_field_and_release() -> None:
    override = SlidingOverride((vp, sp.Integer(0)), (Release(x1 - 1, "rising", -1),))
    system = FilippovSystem((x1, x2), (s,), (x2 - vp,), belt().field, overrides={0: override})
    (guard,) = system.equations((0,)).guards
    assert (guard.to_sign, guard.expression, guard.rising_only) == (-1, 1 - x1, True)


def test_signs_that_multiply_each_other_on_an_intersection_are_refused() -> None:
    problem = make_problem("a b", ["-s*u", "-u"], {"s": "a", "u": "b"}, [0, 0], 1)
    with pytest.raises(ModelError, match="multiply each other"):
        problem.system.equations((0, 0))
