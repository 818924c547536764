"""Systems with known solutions, for the tests of any solver: cases of the suite, and some as `FilippovSystem` objects.

Sources and closed forms stand with each; numbers are exact. Each is built once: deriving the equations of its
modes costs more than most runs.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import sympy as sp
from shipped import CASES, read

from henon_ref.modes.problem import Problem
from henon_ref.modes.switched_field import Release, SlidingOverride
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.tape import TIME

X, V, S = sp.symbols("x v s", real=True)
X1, X2 = sp.symbols("x1 x2", real=True)


def number(text: str | int) -> sp.Expr:
    """An exact number from its decimal digits."""
    return sp.Rational(str(text))


@cache
def of_case(name: str, until: str, reading: str = "") -> Problem:
    """A reading of a case of the suite (the first one) up to some horizon."""
    case = read(CASES / f"{name}.yaml")
    return replace((case.reading(reading) if reading else case.readings[0]).problem, until=number(until))


@cache
def leaving_slide(until: str = "3") -> Problem:
    """x' = t - sgn x from 0: slides to t = 1, then x = (t - 1)^2 / 2."""
    system = FilippovSystem((X,), (S,), (X,), (TIME - S,))
    return Problem(system, sp.Integer(0), (sp.Integer(0),), number(until))


@cache
def free_coulomb(start: str = "5.3", friction: str = "0.6", until: str = "20") -> Problem:
    """x'' + x = -F sgn x' from rest: turns at k pi, sticks for good at N pi, N = ceil((x0 - F) / (2 F))."""
    force = sp.Symbol("F", real=True)
    system = FilippovSystem((X, V), (S,), (V,), (V, -X - force * S), {force: number(friction)})
    return Problem(system, sp.Integer(0), (number(start), sp.Integer(0)), number(until))


@cache
def static_belt(until: str = "20") -> Problem:
    """Belt with static > kinetic friction, (Fs, Fk, vb) = (1.5, 1, 0.5), from (Fs, vb) in slip.

    Slip 2 pi - 2 atan(d / vb), stick 2 d / vb with d = Fs - Fk; lands at 2 Fk - Fs.
    """
    static, kinetic, belt = number("1.5"), sp.Integer(1), number("0.5")
    hold = SlidingOverride(
        (belt, sp.Integer(0)), (Release(X - static, "rising", -1), Release(X + static, "falling", 1))
    )
    system = FilippovSystem((X, V), (S,), (V - belt,), (V, -X - kinetic * S), overrides={0: hold})
    return Problem(system, sp.Integer(0), (static, belt), number(until), {0: -1})


@cache
def at_rest_for_good() -> Problem:
    """x' = (1 - sgn x)/2 from -1: at rest from t = 1, in a mode that nothing leaves."""
    system = FilippovSystem((X,), (S,), (X,), ((1 - S) / 2,))
    return Problem(system, sp.Integer(0), (sp.Integer(-1),), sp.Integer(10))


def stribeck_belt(until: str = "40") -> Problem:
    """x'' + x = -sgn(v) / (1 + 3 abs(v)), v = x' - 0.2, from (1, 0.2) (Leine 1998).

    Slip 4.295999525480, stick 7.705031769350, period 12.001031294831.
    """
    return of_case("stribeck_belt", until)


@cache
def rotating_crossing(until: str = "1.5") -> Problem:
    """x' = A2 x inside the unit circle, A1 x outside, from (1/e, 0): crosses at t = 1, at (1, 0)."""
    turn = 2 * sp.pi
    system = FilippovSystem((X1, X2), (S,), (X1**2 + X2**2 - 1,), (X1 + S * turn * X2, X2 - S * turn * X1))
    return Problem(system, sp.Integer(0), (sp.exp(-1), sp.Integer(0)), number(until))


def twisting(until: str = "4") -> Problem:
    """x1' = x2, x2' = -2 sgn x1 - sgn x2 from (0, 1.5): crossings accumulate at 3.2320508075688776 (Zeno)."""
    return of_case("classic/twisting", until)


def relay_feedback(until: str = "5") -> Problem:
    """x' = A x - B sgn x1 (di Bernardo, Johansson, Vasca 2001): first release at 2.812403376023301."""
    return of_case("classic/relay_feedback", until)


def three_blocks() -> Problem:
    """Three blocks with three contacts (Stewart 1996): several stick at once."""
    return of_case("classic/three_blocks", "12")


@cache
def spontaneous_switch() -> Problem:
    """x' = sgn x from 0: no unique future."""
    return Problem(FilippovSystem((X,), (S,), (X,), (S,)), sp.Integer(0), (sp.Integer(0),), sp.Integer(1))


@cache
def blow_up() -> Problem:
    """x' = x^2 from 1, far from the surface x = -1: leaves every bound at t = 1."""
    return Problem(FilippovSystem((X,), (S,), (X + 1,), (X**2,)), sp.Integer(0), (sp.Integer(1),), sp.Integer(3))


def fig8(reading: str = "listing_limit", until: str = "70") -> Problem:
    """Fig. 8 of Olejnik and Awrejcewicz (2013), Eqs. (17)-(18).

    ``equations``: as stated, Filippov sliding. ``listing_limit``: what the appendix's listing computes as its
    step goes to 0: the slip field times 3, stick released where z rises through z* only, into s = -1.
    """
    return of_case("fig8", until, reading)


@cache
def switch_before_a_surface() -> Problem:
    """x' = -1 from x = 131/200, -1/2 behind t = 13/20; then through x = 0 at t = 33/50, within a step of the switch."""
    late, below = sp.symbols("s1 s2", real=True)
    system = FilippovSystem((X,), (late, below), (TIME - sp.Rational(13, 20), X), ((late - 3) / 4,))
    return Problem(system, sp.Integer(0), (sp.Rational(131, 200),), sp.Integer(2))


def same_surface_twice() -> Problem:
    """x' = 1 below the surface x = 0 and 3 above it, for two signs of the same x: both change at t = 1."""
    upper, lower = sp.symbols("s1 s2", real=True)
    system = FilippovSystem((X,), (upper, lower), (X, X), ((4 + upper + lower) / 2,))
    return Problem(system, sp.Integer(0), (sp.Integer(-1),), sp.Integer(2))
