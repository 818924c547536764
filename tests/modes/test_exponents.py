"""Exponents that are parameters: a power is the one that it is with the number put in."""

from __future__ import annotations

import pytest
import sympy as sp
from runs import run

import henon_ref as hr
from henon_ref.casefile.case import Reading, parse_case

SPRING = """\
schema: 1
name: hardening
title: A hardening spring whose exponent is a parameter
system: {state: [x, v], parameters: {n: 3, k: 2}, surfaces: {s: v}, field: [v, "-k*x^n - s/10"], valid: ["9 - x^n"]}
initial: {t: 0, x: 0, v: 1}
until: 8
readings:
  parameter: {}
  number: {system: {field: [v, "-k*x^3 - s/10"], valid: ["9 - x^3"]}}
  at_rest: {initial: {v: 0}}
  softer: {system: {parameters: {n: 1}}}
  root: {system: {parameters: {n: 1/2}}, initial: {x: 1, v: 0}, until: 1/2}
  switch: {system: {surfaces: {s: v, a: "(t - 1)^n"}, field: [v, "-x - s/2 + a/4"]}, initial: {v: 0}}
  constant: {system: {field: [v, "-k^n*x - s/10 - 2^(n*t)"]}}
  nested: {system: {field: [v, "-(1 + x^(n - 1))^n - s/10"]}}
  held: {sliding: {s: {field: [v, "-x^n"], release: [{when: "x^n - 1", direction: rising, to: 1}]}}}
"""
CASE = parse_case(SPRING)
X, V, S, K, N, T = (sp.Symbol(name, real=True) for name in "xvsknt")


def reading(name: str) -> Reading:
    return CASE.reading(name)


def test_exponents_are_numbers_and_every_other_parameter_stays() -> None:
    parameter, number = reading("parameter").problem.system, reading("number").problem.system
    assert parameter.field == number.field == (V, -K * X**3 - S / 10)
    assert parameter.valid == number.valid
    assert reading("softer").problem.system.field[1] == -K * X - S / 10
    assert reading("root").problem.system.field[1] == -K * sp.sqrt(X) - S / 10
    assert reading("nested").problem.system.field[1] == -((1 + X**2) ** 3) - S / 10
    assert reading("constant").problem.system.field[1] == -(K**N) * X - S / 10 - 2 ** (N * T)
    held = reading("held").problem.system.overrides[0]
    assert (held.field, held.release[0].when) == ((V, -(X**3)), X**3 - 1)


@pytest.mark.parametrize("rtol", [1e-6, 1e-12])
def test_a_power_of_zero_is_run_through(rtol: float) -> None:
    parameter, number = (run(reading(name).problem, rtol) for name in ("parameter", "number"))
    assert parameter.status == "ok"
    assert [e.time for e in parameter.transitions] == [e.time for e in number.transitions]
    assert len(number.transitions) == 3


def test_a_power_of_zero_is_decided_on() -> None:
    at_rest, switch = (run(reading(name).problem, 1e-9) for name in ("at_rest", "switch"))
    assert (at_rest.status, len(at_rest.transitions)) == ("ok", 0)
    assert [(e.time, e.kind) for e in switch.transitions] == [(1.0, "crossing")]
    assert switch.status == "ok"


def test_a_run_has_its_own_exponent_in_a_reset_map() -> None:
    """A changed parameter in an exponent of a map makes another system, as in a rate."""

    def end(exponent: float, **changed: float) -> tuple[float, ...]:
        maps = {"s": {"map": {"v": "(1 + v^2)^n/10"}}}
        ball = hr.System(["x", "v"], {"n": exponent}, {"s": "x"}, ["v", "-10"], resets=maps)
        return hr.simulate(ball, {"x": 1, "v": 0}, until=0.6, parameters=changed).trajectory.end_state

    assert end(1.0) != end(0.5) == end(1.0, n=0.5)
