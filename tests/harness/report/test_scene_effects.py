"""Table of a scene's effects: operations on the tape and per step that are saved if an effect is left out."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

from henon_ref.casefile.case import load_case, parse_case
from henon_ref.harness.report.model import MOST_ROWS, effect_table
from henon_ref.harness.table import Table

CASES = Path(__file__).parents[3] / "cases"


def table_of(text: str) -> Table:
    (reading,) = parse_case(text).readings
    made = effect_table(SimpleNamespace(reading=reading))  # type: ignore[arg-type]
    assert made is not None
    return made[0]


def belt(connections: str) -> str:
    return f"""\
schema: 1
name: belt
title: Belt
scene:
  bodies: {{a: {{mass: 1}}, belt: {{velocity: 1}}, wall: fixed}}
  connections: [{connections}]
initial: {{x_a: 0, v_a: 0}}
until: 1
"""


COULOMB = "friction: {between: [a, belt], law: coulomb, force: 1}"
CUBIC = "spring: {between: [a, wall], cubic: 2}"


def test_an_effect_costs_what_is_gone_without_it() -> None:
    """By hand: x^3 is a square, a product and a factor; friction alone is a constant, v - 1 and its guard."""
    alone, both = table_of(belt(COULOMB)), table_of(belt(f"{COULOMB}, {CUBIC}"))
    assert [row[0] for row in both.rows] == ["`friction (a, belt)`", "`spring (a, wall)`", "*all*"]
    assert int(both.rows[1][1]) == int(both.rows[2][1]) - int(alone.rows[1][1])
    assert int(both.rows[1][1]) in (3, 4)
    assert int(both.rows[1][2]) == int(both.rows[2][2]) - int(alone.rows[1][2]) > 100


def test_many_effects_have_a_row_a_kind() -> None:
    spring = "spring: {between: [a, wall], stiffness: 1}"
    table = table_of(belt(", ".join([COULOMB, *[spring] * MOST_ROWS])))
    assert [row[0] for row in table.rows] == ["`friction (1 of them)`", f"`spring ({MOST_ROWS} of them)`", "*all*"]


def test_equations_that_are_written_out_have_no_effects() -> None:
    (reading,) = load_case(CASES / "rig_periodic.yaml").readings
    assert effect_table(SimpleNamespace(reading=reading)) is None  # type: ignore[arg-type]
