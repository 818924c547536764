"""Cuts of loops of contacts, by themselves: those into two parts, and what they hold is what a linear program says."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
import sympy as sp
from contact_scenes import scene
from flint import ctx
from scipy.optimize import linprog

from henon_ref.harness.truth.multiprecision.points import SeriesEvaluation
from henon_ref.modes.contact_loops import closed, cuts, independent, loops, relations
from henon_ref.modes.mode_evaluation import in_doubles
from henon_ref.modes.selection import initial_mode
from henon_ref.modes.switched_field import SwitchedField
from henon_ref.taylor.tape import TIME

ONE = "{mass: 1}"


def random_contacts(generator: np.random.Generator) -> tuple[int, list[tuple[int, int]]]:
    """2 to 4 blocks and a floor (the last), and 3 to 7 contacts of them, each pair at most once."""
    count = int(generator.integers(2, 5))
    pairs = list(combinations(range(count + 1), 2))
    number = int(generator.integers(3, min(7, len(pairs)) + 1))
    chosen = generator.choice(len(pairs), number, replace=False)
    return count, [pairs[k] for k in sorted(chosen)]


def carried(count: int, contacts: list[tuple[int, int]], static: np.ndarray, forces: np.ndarray) -> bool:
    """Whether loads within the limits keep all bodies that the contacts join from moving beside each other."""
    # Unknown: loads, then the blocks' accelerations. m a_k = f_k - loads that k is the first body of + the others.
    balance = np.zeros((count + len(contacts), len(contacts) + count))
    right = np.concatenate([forces, np.zeros(len(contacts))])
    for j, (p, q) in enumerate(contacts):
        for body, way in ((p, 1), (q, -1)):
            if body < count:
                balance[body, j] += way
                balance[count + j, len(contacts) + body] += way
    balance[:count, len(contacts) :] = np.eye(count)
    bounds = [(-limit, limit) for limit in static] + [(None, None)] * count
    found = linprog(np.zeros(balance.shape[1]), A_eq=balance, b_eq=right, bounds=bounds)
    return bool(found.status == 0)


def test_the_cuts_say_what_a_linear_program_says() -> None:
    generator, seen, looped = np.random.default_rng(35), set(), 0
    for _ in range(14):
        count, contacts = random_contacts(generator)
        static = generator.integers(2, 12, len(contacts)) / 8
        forces = generator.integers(-12, 13, count) / 8 + 1 / 64
        names = [*"abcd"[:count], "floor"]
        bodies = dict.fromkeys(names[:-1], ONE) | {"floor": "fixed"}
        keys = [f"force: {limit / 2}, static: {limit}" for limit in static]
        problem = scene(
            bodies,
            [(names[p], names[q], own) for (p, q), own in zip(contacts, keys, strict=True)],
            {b: str(f) for b, f in zip(names, forces, strict=False)},
            "1",
        )
        guards = problem.system.equations((0,) * len(contacts)).guards
        at = {TIME: sp.Integer(0)} | dict(zip(problem.system.states, problem.initial, strict=True))
        values = [float(g.expression.xreplace(at)) for g in guards]
        expected = carried(count, contacts, static, forces)
        assert (min(values) > 0) == expected, (contacts, static, forces, values)
        mode = initial_mode(in_doubles(problem.system).at_start(problem), problem).mode
        assert mode is not None
        assert (not any(mode)) == expected  # the problem of Gauss's principle says the same
        seen.add(expected)
        looped += bool(problem.system.has_loops)
    assert seen == {True, False}
    assert looped > 4


@pytest.mark.parametrize(
    ("surfaces", "relation", "count"),
    [
        ("v w v-w", {0: -1, 1: 1, 2: 1}, 3),
        ("v-w w-u u-v", {0: 1, 1: 1, 2: 1}, 3),
        ("v 2*v", {0: -2, 1: 1}, 1),
        ("v-sin(t) w-sin(t) 3*v-3*w", {0: -3, 1: 3, 2: 1}, 3),
        ("v-1 w-2 v-w", None, 0),  # never zero at once
        ("v*w w v", None, 0),
        ("v w u", None, 0),
    ],
)
def test_relations_and_cuts_of_surfaces(surfaces: str, relation: dict[int, int] | None, count: int) -> None:
    states = sp.symbols("u v w", real=True)
    names = dict(zip("uvw", states, strict=True)) | {"t": TIME}
    written = tuple(sp.sympify(h, locals=names) for h in surfaces.split())
    system = SwitchedField(states, sp.symbols(f"s:{len(written)}"), written, (sp.S.Zero,) * 3)
    found = relations(system, tuple(range(len(written))))
    assert [dict(own) for own in found] == ([relation] if relation else [])
    assert sum(1 for loop in loops(found) for _ in cuts(loop)) == count
    assert len(independent(system, range(len(written)))) == len(written) - bool(relation)


def test_the_cuts_of_four_bodies_that_all_touch_are_those_into_two_parts() -> None:
    states = sp.symbols("a b c d", real=True)
    pairs = list(combinations(range(4), 2))
    surfaces = tuple(states[p] - states[q] for p, q in pairs)
    system = SwitchedField(states, sp.symbols("s:6"), surfaces, (sp.S.Zero,) * 4)
    ((*found,),) = loops(relations(system, tuple(range(6))))
    parts = [set(own) for size in (1, 2) for own in combinations(range(4), size) if size == 1 or 0 in own]
    expected = {frozenset(j for j, (p, q) in enumerate(pairs) if (p in own) != (q in own)) for own in parts}
    assert {frozenset(cut) for cut in cuts(found)} == expected
    assert all(abs(y) == 1 for cut in cuts(found) for y in cut.values())
    assert closed(system, frozenset({0, 1}), tuple(range(6))) == {0, 1, 3}


def test_double_precision_and_multiprecision_agree_at_rest() -> None:
    generator, statuses = np.random.default_rng(36), set()
    for _ in range(6):
        static = generator.integers(2, 12, 3) / 8
        kinetic = np.maximum(1, np.floor(8 * static * generator.uniform(0.4, 1, 3))) / 8
        forces = generator.integers(-20, 21, 2) / 8 + 1 / 64
        keys = [f"force: {low}, static: {high}" for low, high in zip(kinetic, static, strict=True)]
        problem = scene(
            {"a": ONE, "b": ONE, "floor": "fixed"},
            [(p, q, own) for (p, q), own in zip([("a", "floor"), ("b", "floor"), ("a", "b")], keys, strict=True)],
            {b: str(f) for b, f in zip("ab", forces, strict=True)},
            "1",
        )
        evaluations = in_doubles(problem.system), SeriesEvaluation(problem.system, 256)
        with ctx.workprec(256):
            one, other = (initial_mode(modes.at_start(problem), problem) for modes in evaluations)
        assert (one.status, one.mode) == (other.status, other.mode)
        assert (one.mode == (0, 0, 0)) == carried(2, [(0, 2), (1, 2), (0, 1)], static, forces)
        statuses.add(one.status)
    assert "unique" in statuses
