"""Random blocks that touch each other and stand on stops, all at rest, against a bounded least squares problem.

Coulomb friction and reactions at zero speed: of all loads within their limits and all reactions that do not pull, those
act that make the kinetic energy of the accelerations, half of a^T M a, least (Moreau's form of Gauss's principle of
least constraint, *SIAM J. Control* 4 (1966) 153-158). Loads and reactions need not be unique, the accelerations are.
Static friction, where a contact has it, is here as large as friction in sliding.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from henon_ref.casefile.case import parse_case
from henon_ref.filippov.problem import Problem
from henon_ref.filippov.switching import Switching
from henon_ref.taylor.tape import TIME
from henon_ref.truth.multiprecision.mode_selection import ModeSelection

NAMES = ("a", "b", "c", "wall")
Pair = tuple[int, int]


def scene(
    contacts: Sequence[Pair],
    stops: Sequence[Pair],
    masses: Sequence[float],
    limits: Sequence[float],
    static: Sequence[bool],
    forces: Sequence[float],
) -> Problem:
    """Blocks on one place, at rest; a body's number is its place in :data:`NAMES`, the wall's the last."""
    names = [*NAMES[: len(masses)], NAMES[-1]]
    lines = ["schema: 1", "name: rest", "title: t", "scene:", "  bodies:", "    wall: fixed"]
    lines += [f"    {b}: {{mass: {mass}}}" for b, mass in zip(names, masses, strict=False)]
    lines += ["  connections:"]
    for (p, q), limit, own in zip(contacts, limits, static, strict=True):
        keys = f"law: coulomb, force: {limit}" + (f", static: {limit}" if own else "")
        lines.append(f"    - friction: {{between: [{names[p]}, {names[q]}], {keys}}}")
    lines += [f"    - stop: {{between: [{names[p]}, {names[q]}], gap: 0, restitution: 0}}" for p, q in stops]
    lines += [f"    - force: {{on: {b}, value: {force}}}" for b, force in zip(names, forces, strict=False)]
    states = [f"x_{b}: 0, v_{b}: 0" for b in names[:-1]]
    return parse_case("\n".join([*lines, f"initial: {{{', '.join(states)}}}", "until: 1", ""])).readings[0].problem


def accelerations(
    contacts: Sequence[Pair], stops: Sequence[Pair], masses: np.ndarray, limits: np.ndarray, forces: np.ndarray
) -> np.ndarray:
    """Of the blocks, by their loads and reactions; shape (blocks,)."""
    pairs = [*((q, p) for p, q in contacts), *stops]  # a load acts on the second body, a reaction on the first
    acting = np.zeros((len(masses) + 1, len(pairs)))
    for j, (p, q) in enumerate(pairs):
        acting[p, j] += 1
        acting[q, j] -= 1
    acting, root = acting[:-1], 1 / np.sqrt(masses)
    none, free = np.zeros(len(stops)), np.full(len(stops), np.inf)
    bounds = np.concatenate([-limits, none]), np.concatenate([limits, free])
    found = lsq_linear(root[:, None] * acting, -root * forces, bounds=bounds, method="bvls", tol=1e-14)
    return (forces + acting @ found.x) / masses


@pytest.mark.parametrize("with_static", [False, True])
def test_bodies_at_rest_start_as_gauss_principle_says(with_static: bool) -> None:
    generator, seen = np.random.default_rng(34), set()
    for _ in range(20):
        count = int(generator.integers(2, 4))
        pairs = list(combinations((*range(count), count), 2))
        draw = [pairs[k] for k in sorted(generator.choice(len(pairs), min(4, len(pairs)), replace=False))]
        contacts = draw[: int(generator.integers(1, len(draw) + 1))]
        chosen = sorted(generator.choice(len(pairs), int(generator.integers(1, 3)), replace=False))
        stops = [pairs[k] if generator.integers(2) else pairs[k][::-1] for k in chosen]
        masses, limits = generator.integers(1, 9, count) / 2, generator.integers(2, 12, len(contacts)) / 8
        forces = generator.integers(-16, 17, count) / 8 + generator.integers(1, 63, count) / 512
        static = [with_static and bool(generator.integers(2)) for _ in contacts]
        problem = scene(contacts, stops, masses, limits, static, forces)
        system, start = problem.system, (problem.start, problem.initial)
        mode = Switching(system).initial_mode(*start).mode
        assert mode is not None
        assert ModeSelection(system, 256).initial_mode(*start, {}).mode == mode
        at = {TIME: 0} | dict.fromkeys(system.states, 0)
        rates = [float(rate.xreplace(at)) for rate in system.equations(mode).field[1::2]]
        assert rates == pytest.approx(list(accelerations(contacts, stops, masses, limits, forces)), abs=1e-9)
        seen |= {mode[i] for i in system.resets}
    assert seen == {0, 1}  # some rest, some lift off
