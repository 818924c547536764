"""Work on a stranger's text is bounded: what is derived from it, printed of it, and read of it.

From the report of an attack on the program: fields of 150 characters that SymPy simplified for ever while a report was
written or a case was read, and files of some KiB that took minutes to read.
"""

from __future__ import annotations

import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from itertools import pairwise

import pytest
import sympy as sp

from henon_ref.casefile import case as case_module
from henon_ref.casefile.case import parse_case
from henon_ref.errors import CaseError, ModelError
from henon_ref.expressions import operations as operations_module
from henon_ref.expressions.algebra import coefficients, expanded, known_positive, measured, simplified
from henon_ref.expressions.bounds import put
from henon_ref.expressions.evaluation import Walk
from henon_ref.expressions.traversal import size
from henon_ref.harness.report.model import as_written, general_form, mode_equations
from henon_ref.harness.truth.proofs import prove
from henon_ref.taylor.tape import build_tape

X, Y, S, U = (sp.Symbol(name, real=True) for name in "xysu")

QUOTIENTS = "+".join(f"s*tan({k}*x+v)/(1+exp({k}*v)+sqrt(x^2+{k}))" for k in range(1, 5))
BELT = """\
schema: 1
name: belt
title: a block on a belt
system:
  state: [x, v]
  surfaces: {{s: "{surface}"}}
  field: ["v", "-x - ({force})"]
initial: {{t: 0, x: {start}, v: 1{mode}}}
until: 20
"""


def belt(force: str, *, surface: str = "v - 1", start: str = "0", mode: str = "") -> str:
    return BELT.format(force=force, surface=surface, start=start, mode=mode)


def dense(count: int, row: Callable[[int], str], *, extra: str = "") -> str:
    """A system in which every sign acts on every state."""
    names = range(count)
    return "\n".join(
        [
            "schema: 1",
            "name: dense",
            "title: dense",
            "system:",
            f"  state: [{', '.join(f'x{i}' for i in names)}]",
            f"  surfaces: {{{', '.join(f's{i}: x{i}' for i in names)}}}",
            f"  field: [{', '.join(row(i) for i in names)}]",
            f"initial: {{{', '.join(f'x{i}: 1' for i in names)}}}",
            "until: 1",
            extra,
        ]
    )


@pytest.fixture
def operations(monkeypatch) -> Counter[str]:
    """How often the operation of each text is worked out."""
    seen: Counter[str] = Counter()
    kept = Walk._operation

    def counted(self, node, depth):  # type: ignore[no-untyped-def]
        seen[node.text()] += 1
        return kept(self, node, depth)

    monkeypatch.setattr(Walk, "_operation", counted)
    return seen


# -- what is derived -------------------------------------------------------------------------------------


def test_reading_cases_and_printing_their_modes_ends() -> None:
    """In a process of its own, so that a derivation without end is ended."""
    texts = (
        belt(QUOTIENTS, mode=", mode: {s: 0}"),
        belt(QUOTIENTS, mode=", mode: {s: 0}", surface="v - 1 + (" + QUOTIENTS.replace("s*tan", "tan") + ")/9"),
        belt("s*(" + "+".join(f"(x + {k}*v)/(1 + x^{k} + {k}*v*x + t^3)" for k in range(1, 9)) + ")"),
        belt("s*" + "*".join(f"sin({k}*v + x)" for k in range(1, 40))),
    )
    program = (
        "import sys\n"
        "from contextlib import suppress\n"
        "from henon_ref.errors import CaseError\n"
        "from henon_ref.casefile.case import parse_case\n"
        "from henon_ref.harness.report.model import general_form, mode_equations\n"
        "for text in sys.argv[1:]:\n"
        "    with suppress(CaseError):\n"
        "        system = parse_case(text).readings[0].problem.system\n"
        "        print(general_form(system), [mode_equations(system, (s,)) for s in (-1, 0, 1)])\n"
    )
    command = [sys.executable, "-c", program, *texts]
    assert subprocess.run(command, check=False, timeout=600, stdout=subprocess.DEVNULL).returncode == 0


def test_sliding_is_derived_without_simplifying_functions(monkeypatch) -> None:
    monkeypatch.setattr(sp, "simplify", lambda e: pytest.fail(f"simplified: {e}") if e.has(sp.Function) else e)
    system = parse_case(belt(QUOTIENTS)).readings[0].problem.system
    equations = system.equations((0,))
    at = {sp.Symbol("x", real=True): sp.Rational(1, 3)}
    (sign,) = equations.equivalent_signs.values()
    exact = [f.xreplace({sp.Symbol("v", real=True): sp.Integer(1)}) for f in system.field]
    assert abs(sp.N(exact[1].subs({**at, system.signs[0]: sign.subs(at)}))) < 1e-12


def test_an_expression_is_simplified_only_where_that_is_known_to_be_little_work(monkeypatch) -> None:
    asked: list[sp.Expr] = []
    monkeypatch.setattr(sp, "simplify", lambda e: asked.append(e) or e)
    large = [
        sp.Add(*(1 / (1 + X**k + k * Y) for k in range(1, 9))),
        sp.Mul(*(X + k * Y + S**k for k in range(1, 9))),
        (1 + X + Y) ** 40,
        X**64 * Y**64 * S**64 - 1,
    ]
    for expression in large:
        assert measured(expression) is None
        assert simplified(expression) is expression
        assert not known_positive(expression)
    assert asked == []
    simplified(sp.sin(X) * (X - 1) + 1 / Y)
    assert len(asked) == 1
    assert not asked[0].has(sp.sin)  # a function is a symbol to the rule


def test_the_factors_of_a_giant_number_are_not_looked_for(monkeypatch) -> None:
    asked: list[sp.Expr] = []
    monkeypatch.setattr(sp, "simplify", lambda e: asked.append(e) or e)
    giant = sp.Integer(10) ** 400 + 1
    assert simplified(X * Y + giant) == X * Y + giant
    assert [e.atoms(sp.Integer) for e in asked] == [set()]


def test_what_is_little_work_is_simplified() -> None:
    assert simplified((X**2 - 1) / (X - 1) - sp.sin(Y) * (X - X)) == X + 1
    assert known_positive(1 + X**2)
    assert not known_positive(1 - X**2)
    assert known_positive(sp.sqrt(2) - 1)


def test_products_of_many_sums_are_not_multiplied_out() -> None:
    product = sp.Mul(*(X + k for k in range(40)))
    assert expanded(product) is product
    assert expanded((X + 1) * (Y + 2)) == X * Y + 2 * X + Y + 2


def test_sizes_are_counted_up_to_a_limit() -> None:
    tower = X
    for _ in range(60):
        tower = sp.sin(tower) * sp.cos(tower)  # 2^60 operations, written out
    assert size(tower, 1000) == 1001
    assert size(X + 2 * Y, 1000) == 5


def test_coefficients_are_found_without_a_derivative(monkeypatch) -> None:
    monkeypatch.setattr(sp, "diff", lambda *_: pytest.fail("a derivative was taken"))
    assert coefficients(sp.sin(X) * (3 - 2 * S) + U * Y, [S, U]) == {S: -2 * sp.sin(X), U: Y}
    assert coefficients(X + Y, [S]) == {}
    assert coefficients(S * (U + 1), [S, U]) is None
    assert coefficients(S**2, [S]) is None


def test_equations_that_are_too_large_are_refused() -> None:
    force = "s*" + "*".join(f"sin({k}*v + x)" for k in range(1, 150))
    product = "*".join(f"sin({k}*v + x)" for k in range(1, 150))
    system = parse_case(belt(force, surface=product)).readings[0].problem.system
    with pytest.raises(ModelError, match="the equations of sliding on s are too large: more than 100000 operations"):
        system.equations((0,))


def test_signs_that_act_on_each_other_by_large_factors_are_refused() -> None:
    rows = ["+".join(f"s{j}*(1 + x{i}*t + {i + j}*t^2)" for j in range(8)) for i in range(8)]
    start = ", ".join(f"x{i}: 0" for i in range(8))
    text = dense(8, rows.__getitem__).replace("x0: 1, x1: 1, x2: 1, x3: 1, x4: 1, x5: 1, x6: 1, x7: 1", start)
    system = parse_case(text).readings[0].problem.system
    with pytest.raises(ModelError, match=r"8 signs .* the formulas would be too large"):
        system.equations((0,) * 8)


def test_many_contacts_that_act_on_each_other_by_numbers_slide_all_at_once() -> None:
    count = 16
    rows = ["+".join(f"{-9 if i == j else 1}/{count}*s{j}" for j in range(count)) + " + 1/2" for i in range(count)]
    system = parse_case(dense(count, rows.__getitem__)).readings[0].problem.system
    equations = system.equations((0,) * count)
    signs = {system.signs[i]: value for i, value in equations.equivalent_signs.items()}
    assert {f.xreplace(signs) for f in system.field} == {sp.S.Zero}


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (belt("s", surface="2^x - v", start="10^30"), "the surface of 's' has no value at the start"),
        (belt("s*x^x", surface="x - 10^30", start="10^30", mode=", mode: {s: 0}"), "cannot slide together"),
    ],
)
def test_a_power_that_becomes_a_giant_where_values_are_put_in_is_refused(text: str, says: str) -> None:
    with pytest.raises(CaseError, match=says) as caught:
        parse_case(text, file="case.yaml")
    assert (caught.value.line, "too large" in str(caught.value)) == (8, True)


@pytest.mark.parametrize("surface", ["1/x", "log(x)", "tan(x + pi/2)", "sqrt(x - 1)"])
def test_a_start_at_which_a_surface_has_no_value_is_refused(surface: str) -> None:
    with pytest.raises(CaseError, match="the surface of 's' has no finite real value at the start") as caught:
        parse_case(belt("s", surface=surface, start="0"), file="case.yaml")
    assert caught.value.line == 8


def test_values_are_put_in_as_sympy_does_it() -> None:
    for expression in (X**Y + sp.exp(X * S) * 2**Y, sp.sin(X) / Y):
        values = {X: sp.Integer(3), Y: sp.Integer(2)}
        assert put(expression, values) == expression.xreplace(values)
    with pytest.raises(ModelError, match="exact numbers may have 4096 bits"):
        put(sp.Integer(9) ** (sp.Integer(9) ** X), {X: sp.Integer(9)})


def test_a_long_function_of_time_is_not_differentiated_twice(monkeypatch) -> None:
    time = sp.Symbol("t", real=True)
    product = sp.Mul(*(sp.sin(k * time + 1) for k in range(1, 60)))
    derivative = sp.diff
    monkeypatch.setattr(sp, "diff", lambda e, *by: pytest.fail(f"of {e}") if e == product else derivative(e, *by))
    assert build_tape([X], [product]).counts["sin"] == 59


def test_a_proof_whose_variational_equations_are_too_large_is_not_begun(monkeypatch) -> None:
    problem = parse_case(belt("s")).readings[0].problem
    monkeypatch.setattr("henon_ref.enclosure.model.MAX_VARIED", 10)
    assert prove(problem).undecided == "with 2 states the variational equations are too large: more than 10 operations"


# -- what is printed -------------------------------------------------------------------------------------


def test_what_is_too_long_for_a_formula_stands_in_the_report_as_the_file_has_it() -> None:
    force = "+".join(f"s*tan({k}*x+v)/(1+exp({k}*v))" for k in range(1, 60))
    system = parse_case(belt(force)).readings[0].problem.system
    assert as_written(system) == [f"`v' = -x - ({force})`"]
    assert r"\dot{x}" in general_form(system)
    assert r"\dot{v}" not in general_form(system)
    _, equations, notes = mode_equations(system, (1,))
    assert (equations, notes) == ("", ["its equations are too long to be printed"])


def test_what_is_short_is_a_formula() -> None:
    system = parse_case(belt("s")).readings[0].problem.system
    assert as_written(system) == []
    assert r"\dot{v} &= - s - x" in general_form(system)


# -- what is read ----------------------------------------------------------------------------------------


def test_a_text_is_worked_out_once_however_often_it_stands_in_a_file(operations: Counter[str]) -> None:
    row = "+".join(f"s{i}" for i in range(100))
    parse_case(dense(100, lambda _: row))
    # As it is written, and with all signs at either side.
    assert [count for text, count in operations.items() if "+" in text] == [3]


def test_a_part_of_a_text_is_worked_out_once(operations: Counter[str]) -> None:
    parse_case(dense(20, lambda i: "+".join(f"{i + j}*s{j}/(2 + s{j})" for j in range(20))))
    parts = {text: count for text, count in operations.items() if text.startswith("2 + s")}
    assert (len(parts), set(parts.values())) == (20, {3})


@pytest.mark.parametrize("row", ["x0 + s0/(1 - s1)", "x0*sqrt(s1 - 1)", "x0 + s0*log(s1 - 1)", "1/(x0*(s1 + 1))"])
def test_what_a_sign_makes_senseless_is_found_at_its_side(row: str) -> None:
    with pytest.raises(CaseError, match=r"\(at s1 = [-+]1\)"):
        parse_case(dense(2, lambda _: row))


def test_readings_with_the_same_system_share_it() -> None:
    text = belt("s") + "readings: {a: {}, b: {until: 3}, c: {system: {parameters: {k: 2}}, until: k}}\n"
    a, b, c = (reading.problem.system for reading in parse_case(text).readings)
    assert a is b
    assert a is not c


def test_the_work_of_a_file_is_bounded(monkeypatch) -> None:
    monkeypatch.setattr(operations_module, "MAX_WORK", 2_000)
    text = dense(30, lambda i: f"s{i} + {i}*x{i}")
    with pytest.raises(
        CaseError, match=r"too much work: .* 2000 characters are allowed; make the expressions"
    ) as caught:
        parse_case(text, file="case.yaml")
    assert caught.value.line == 7  # in the field, whose first rows were read
    assert caught.value.column is not None


def test_what_readings_hold_written_out_is_bounded(monkeypatch) -> None:
    monkeypatch.setattr(case_module, "MAX_WRITTEN_OUT", 100)
    text = belt("s") + "readings:\n" + "".join(f"  r{i}: {{}}\n" for i in range(50))
    with pytest.raises(CaseError, match="give fewer readings") as caught:
        parse_case(text, file="case.yaml")
    assert 12 < caught.value.line < 20


def test_a_large_system_is_read_with_little_of_the_work_that_is_allowed(monkeypatch) -> None:
    made: list[operations_module.Work] = []
    kept = operations_module.Work.__init__
    monkeypatch.setattr(operations_module.Work, "__init__", lambda self: (made.append(self), kept(self))[0])
    springs = [f"-x{j}*s{i}/(1 + 3*s{i}*(x{i} - 1/2))" for i, j in pairwise([0, *range(64)])]
    parse_case(dense(64, springs.__getitem__))
    parse_case(dense(64, lambda i: "+".join(f"{(i * j) % 7 + 1}*s{j}" for j in range(64))))
    assert max(work.done for work in made) < operations_module.MAX_WORK / 4


def test_exact_times_are_compared_by_their_digits(monkeypatch) -> None:
    asked: list[sp.Expr] = []
    monkeypatch.setattr("henon_ref.expressions.bounds.exact_sign", lambda number: asked.append(number) or 1)
    times = ", ".join(f"{i}*sqrt(2)/9" for i in range(1, 101))
    parse_case(belt("s") + f"exact: {{transition_times: [{times}]}}\n")
    assert asked == []
