"""Random blocks that touch each other and stand on stops, all at rest, against a bounded least squares problem.

Coulomb friction and reactions at zero speed: of all loads within their limits and all reactions that do not pull, those
act that make the kinetic energy of the accelerations, half of a^T M a, least (Moreau's form of Gauss's principle of
least constraint, *SIAM J. Control* 4 (1966) 153-158). Loads and reactions need not be unique, the accelerations are.
Where static friction is above friction in sliding, what slips and had not slipped before falls to friction in sliding,
and the problem is solved again, until nothing new slips. A drive is a body of :data:`HEAVY` kg.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from itertools import combinations
from typing import Any

import numpy as np
import pytest
from often import daily
from scipy.optimize import lsq_linear

from henon_ref.casefile.case import parse_case
from henon_ref.enclosure.enclosure import UndecidedError
from henon_ref.enclosure.mode_selection import initial_entry
from henon_ref.enclosure.model import SystemModel
from henon_ref.harness.truth.multiprecision.points import SeriesEvaluation
from henon_ref.modes.mode_evaluation import in_doubles
from henon_ref.modes.problem import Problem
from henon_ref.modes.selection import initial_mode
from henon_ref.taylor.tape import TIME

NAMES = ("a", "b", "c", "d")
HEAVY = 1e10
SLIPS = 1e-6
"""Relative acceleration from which on a contact slips [m/s^2]."""
Pair = tuple[int, int]
"""Bodies by number: blocks, then the wall, then drives."""


def scene(
    contacts: Sequence[Pair],
    stops: Sequence[Pair],
    masses: Sequence[float],
    limits: Sequence[float],
    static: Sequence[float | None],
    forces: Sequence[float],
    drives: Sequence[float] = (),
) -> Problem:
    """Blocks on one place, at rest; ``static``: static friction of each contact that has it [N]."""
    names = [*NAMES[: len(masses)], "wall", *(f"drive{k}" for k in range(len(drives)))]
    lines = ["schema: 1", "name: rest", "title: t", "scene:", "  bodies:", "    wall: fixed"]
    lines += [f"    {b}: {{mass: {mass}}}" for b, mass in zip(names, masses, strict=False)]
    lines += [f'    drive{k}: {{velocity: "{rate}*t"}}' for k, rate in enumerate(drives)]
    lines += ["  connections:"]
    for (p, q), limit, own in zip(contacts, limits, static, strict=True):
        keys = f"law: coulomb, force: {limit}" + ("" if own is None else f", static: {own}")
        lines.append(f"    - friction: {{between: [{names[p]}, {names[q]}], {keys}}}")
    lines += [f"    - stop: {{between: [{names[p]}, {names[q]}], gap: 0, restitution: 0}}" for p, q in stops]
    lines += [f"    - force: {{on: {b}, value: {force}}}" for b, force in zip(names, forces, strict=False)]
    states = [f"x_{b}: 0, v_{b}: 0" for b in names[: len(masses)]]
    return parse_case("\n".join([*lines, f"initial: {{{', '.join(states)}}}", "until: 1", ""])).readings[0].problem


def accelerations(
    contacts: Sequence[Pair],
    stops: Sequence[Pair],
    masses: np.ndarray,
    limits: np.ndarray,
    forces: np.ndarray,
    drives: Sequence[float] = (),
) -> np.ndarray:
    """Of the blocks, the wall and the drives, by their loads and reactions; shape (bodies,)."""
    pairs = [*((q, p) for p, q in contacts), *stops]  # a load acts on the second body, a reaction on the first
    masses = np.concatenate([masses, np.full(1 + len(drives), HEAVY)])
    forces = np.concatenate([forces, HEAVY * np.array([0.0, *drives])])
    acting = np.zeros((len(masses), len(pairs)))
    for j, (p, q) in enumerate(pairs):
        acting[p, j] += 1
        acting[q, j] -= 1
    root = 1 / np.sqrt(masses)
    none, free = np.zeros(len(stops)), np.full(len(stops), np.inf)
    bounds = np.concatenate([-limits, none]), np.concatenate([limits, free])
    found = lsq_linear(root[:, None] * acting, -root * forces, bounds=bounds, method="bvls", tol=1e-14)
    return (forces + acting @ found.x) / masses


@pytest.mark.parametrize("with_static", [False, True])
def test_bodies_at_rest_start_as_gauss_principle_says(with_static: bool) -> None:
    generator, seen = np.random.default_rng(34), set()
    for _ in range(12):
        count = int(generator.integers(2, 4))
        pairs = list(combinations((*range(count), count), 2))
        draw = [pairs[k] for k in sorted(generator.choice(len(pairs), min(4, len(pairs)), replace=False))]
        contacts = draw[: int(generator.integers(1, len(draw) + 1))]
        chosen = sorted(generator.choice(len(pairs), int(generator.integers(1, 3)), replace=False))
        stops = [pairs[k] if generator.integers(2) else pairs[k][::-1] for k in chosen]
        masses, limits = generator.integers(1, 9, count) / 2, generator.integers(2, 12, len(contacts)) / 8
        forces = generator.integers(-16, 17, count) / 8 + generator.integers(1, 63, count) / 512
        static = [limit if with_static and generator.integers(2) else None for limit in limits]
        problem = scene(contacts, stops, masses, limits, static, forces)
        system = problem.system
        mode = initial_mode(in_doubles(system).at_start(problem), problem).mode
        assert mode is not None
        assert initial_mode(SeriesEvaluation(system, 256).at_start(problem), problem).mode == mode
        at = {TIME: 0} | dict.fromkeys(system.states, 0)
        rates = [float(rate.xreplace(at)) for rate in system.equations(mode).field[1::2]]
        expected = accelerations(contacts, stops, masses, limits, forces)[:count]
        assert rates == pytest.approx(list(expected), abs=1e-8)
        seen |= {mode[i] for i in system.resets}
    assert seen == {0, 1}  # some rest, some lift off


def with_static_friction(
    contacts: Sequence[Pair], static: np.ndarray, kinetic: np.ndarray, **given: Any
) -> tuple[np.ndarray, set[int]]:
    """Accelerations where what slips falls from static to kinetic friction, and the contacts that did."""
    slipped: set[int] = set()
    while True:
        limits = np.array([kinetic[k] if k in slipped else static[k] for k in range(len(contacts))])
        found = accelerations(contacts, limits=limits, **given)
        new = {k for k, (p, q) in enumerate(contacts) if abs(found[p] - found[q]) > SLIPS} - slipped
        if not new:
            return found, slipped
        slipped |= new


@pytest.mark.parametrize("seed", daily(range(4), some=range(1)))
def test_groups_at_rest_start_by_their_static_friction(seed: int) -> None:
    """Loops, stops and drives that pull apart, static friction up to three times friction in sliding."""
    generator, proven, fell = np.random.default_rng(46 + seed), 0, set[bool]()
    for _ in range(12):
        count, driven = int(generator.integers(2, 5)), int(generator.integers(0, 3))
        blocks, bodies = range(count), range(count + 1 + driven)
        pairs = [(p, q) for p, q in combinations(bodies, 2) if p in blocks]
        number = int(generator.integers(2, min(7, len(pairs)) + 1))
        contacts = [pairs[k] for k in sorted(generator.choice(len(pairs), number, replace=False))]
        inner = [pair for pair in pairs if pair[1] <= count]
        chosen = generator.choice(len(inner), int(generator.integers(0, 2)), replace=False)
        stops = [inner[k] if generator.integers(2) else inner[k][::-1] for k in chosen]
        masses = generator.integers(1, 9, count) / 2
        kinetic = generator.integers(2, 12, number) / 8
        own = generator.uniform(size=number) < 0.7
        static = np.where(own, np.round(64 * kinetic * generator.uniform(1, 3, number)) / 64 + 1 / 1024, kinetic)
        forces = generator.integers(-24, 25, count) / 8 + generator.integers(1, 63, count) / 512
        drives = (generator.integers(-12, 13, driven) / 8 + 1 / 256).tolist()
        limits = [value if held else None for value, held in zip(static, own, strict=True)]
        problem = scene(contacts, stops, masses, kinetic, limits, forces, drives)
        given = {"stops": stops, "masses": masses, "forces": forces, "drives": drives}
        expected, slipped = with_static_friction(contacts, static, kinetic, **given)
        system = problem.system
        evaluations = in_doubles(system), SeriesEvaluation(system, 256)
        decisions = [initial_mode(modes.at_start(problem), problem) for modes in evaluations]
        assert decisions[0].mode is not None, decisions[0].reason
        assert decisions[1].mode == decisions[0].mode
        at = {TIME: 0} | dict.fromkeys(system.states, 0)
        rates = [float(rate.xreplace(at)) for rate in system.equations(decisions[0].mode).field[1::2]]
        assert rates == pytest.approx(list(expected[:count]), abs=1e-7)
        with suppress(UndecidedError):  # where a load is at its limit
            entry = initial_entry(SystemModel(system), problem)
            assert entry.mode == decisions[0].mode
            proven += 1
        fell.add(bool(slipped))
    assert True in fell
    assert proven >= 8
