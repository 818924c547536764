"""Like expressions are derived once, and the names of their symbols change nothing."""

from __future__ import annotations

from itertools import pairwise

import pytest
import sympy as sp

import henon_ref as hr
from henon_ref.modes import equations
from henon_ref.modes.equations import by_pattern, renamed
from henon_ref.taylor.tape import TIME

X9, X10, X11, K, KC = sp.symbols("x_9 x_10 x_11 k kc", real=True)
WRITTEN = [
    K * (X10 - X9) - KC * (X10 - X11),
    sp.sqrt(1 + X10**2) / (TIME - 2 * X9) + sp.sin(TIME * KC) * sp.exp(-X11 / K),
    (X9 - X10) ** 2 / (X10 - X9) ** 3 - sp.Rational(1, 3) * TIME,
    sp.Integer(2),
]


@pytest.mark.parametrize("expression", WRITTEN)
def test_names_by_place_keep_the_order_of_terms(expression: sp.Expr) -> None:
    (form,), names = renamed([expression])
    sorted_anew = expression.xreplace(names)
    assert (form, form.args) == (sorted_anew, sorted_anew.args)
    (back,) = by_pattern(lambda e: (e,), expression) or ()
    assert (back, back.args) == (expression, expression.args)
    assert by_pattern(lambda e: (sp.expand(e), sp.diff(e, TIME)), expression) == (
        sp.expand(expression),
        sp.diff(expression, TIME),
    )


def test_expressions_of_one_pattern_are_equal_and_others_are_not() -> None:
    assert renamed([K * X9 - TIME])[0] == renamed([KC * X11 - TIME])[0]
    assert renamed([K * X9 - TIME])[0] != renamed([K * X9 - KC])[0]


@pytest.mark.parametrize("static", [None, "Fs"])
def test_contacts_of_a_chain_are_derived_once_a_pattern(static: str | None, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []
    made = equations._made
    monkeypatch.setattr(equations, "_made", lambda rule, forms: asked.append((rule, forms)) or made(rule, forms))
    count, scene = 40, hr.Scene(parameters={"k": 1, "kc": 2, "Fs": 1.5, "Fk": 1})
    bodies = [scene.body(f"b{i}", mass=1) for i in range(count)]
    for body in bodies:
        scene.spring(body, scene.wall, stiffness="k")
        scene.friction(body, scene.wall, law="coulomb", force="Fk", **({"static": static} if static else {}))
    for one, other in pairwise(bodies):
        scene.spring(one, other, stiffness="kc")
    assert scene.system().model.switched is not None
    assert len(asked) == count
    assert len(set(asked)) < 10  # the two at the ends, and orders of names such as x_b9, x_b10, x_b11
