"""Growth in the number of states: ever longer chains of blocks on a belt, one surface a block."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from henon_ref import registry
from henon_ref.model.case import parse_case
from henon_ref.score.turns import in_turn
from henon_ref.solver import Run
from henon_ref.trajectory import Problem, Trajectory

BLOCKS = (1, 2, 4, 8, 16, 32, 64)
SOLVERS = ("henon", "heyoka", "scipy-dop853")
RTOL = 1e-12
ROUNDS = 20
AGREED = 1e-9
"""Largest distance of two solvers' transition times [s] at which their times are taken down."""
GOLDEN = (math.sqrt(5) - 1) / 2
FITTED = 16
"""Exponents are fitted from so many states on."""


@dataclass(frozen=True)
class Size:
    """One solver on one chain."""

    states: int
    solver: str
    transitions: int
    steps: int
    prepare_s: float
    """Wall time of making it ready, all modes that the run visits included [s]."""
    wall_s: float
    ratio: float
    """The first solver's time over its own, median over the rounds."""
    agrees: bool
    """Whether its transitions are those of the first solver."""

    @property
    def per_step_s(self) -> float:
        """Wall time of a step, events and all [s]."""
        return self.wall_s / self.steps


def horizon(blocks: int) -> float:
    """Horizon of a chain [s]: ten to thirty transitions, whatever its length (each leads to a mode of its own)."""
    return 40.0 * blocks**-1.4


def chain(blocks: int) -> Problem:
    """Blocks in a row, each on a spring to the wall, joined by springs, with falling friction on a belt.

    ``xi'' + xi + kc (2 xi - xi-1 - xi+1) = -F sgn(vi) / (1 + delta abs(vi))`` after Burridge and Knopoff, Bull.
    Seismol. Soc. Am. 57 (1967) 341-371; the blocks start at rest at places that never repeat.
    """
    numbers = range(1, blocks + 1)
    field, initial = [], ["t: 0"]
    for i in numbers:
        springs = "".join(f" - kc*(x{i} - x{j})" for j in (i - 1, i + 1) if j in numbers)
        field += [f"v{i}", f"-x{i}{springs} - F*s{i}/(1 + delta*s{i}*(v{i} - vp))"]
        initial += [f"x{i}: {i * GOLDEN % 1:.6f}", f"v{i}: 0"]
    lines = [
        "schema: 1",
        "name: chain",
        f"title: A chain of {blocks} blocks",
        "system:",
        f"  state: [{', '.join(f'x{i}, v{i}' for i in numbers)}]",
        "  parameters: {kc: 1.2, F: 1, delta: 3, vp: 0.2}",
        f"  surfaces: {{{', '.join(f's{i}: v{i} - vp' for i in numbers)}}}",
        "  field:",
        *(f"    - {rate}" for rate in field),
        f"initial: {{{', '.join(initial)}}}",
        f"until: {horizon(blocks):.6f}",
    ]
    return parse_case("\n".join(lines) + "\n").readings[0].problem


def sizes(blocks: Sequence[int] = BLOCKS, solvers: Sequence[str] = SOLVERS) -> list[Size]:
    """Run every solver on every chain, timed in turn."""
    found = []
    for count in blocks:
        problem = chain(count)
        runs, prepared = {}, {}
        for name in solvers:
            runs[name], prepared[name] = _prepared(name, problem)
        ends = {name: run() for name, run in runs.items()}
        times = in_turn(runs, rounds=ROUNDS)
        first = ends[solvers[0]]
        for name in solvers:
            end = ends[name]
            found.append(
                Size(
                    states=2 * count,
                    solver=name,
                    transitions=len(end.transitions),
                    steps=end.counts.steps,
                    prepare_s=prepared[name],
                    wall_s=times.median(name),
                    ratio=times.ratio(solvers[0], name),
                    agrees=_agree(first, end),
                )
            )
    return found


def _prepared(name: str, problem: Problem) -> tuple[Run, float]:
    began = time.perf_counter()
    run = registry.solver(name).prepare(problem, rtol=RTOL)
    run()  # modes are made ready where they are first met
    return run, time.perf_counter() - began


def _agree(first: Trajectory, other: Trajectory) -> bool:
    pairs = zip(first.transitions, other.transitions, strict=False)
    return len(first.transitions) == len(other.transitions) and all(
        a.to_mode == b.to_mode and abs(a.time - b.time) <= AGREED for a, b in pairs
    )


def exponent(found: Sequence[Size], solver: str) -> float:
    """p of the fit: time of a step ~ states^p, from :data:`FITTED` states on."""
    own = [s for s in found if s.solver == solver and s.states >= FITTED]
    if len(own) < 2:
        return math.nan
    slope, _ = np.polyfit(np.log([s.states for s in own]), np.log([s.per_step_s for s in own]), 1)
    return float(slope)
