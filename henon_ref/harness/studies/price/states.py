"""Growth in the number of states: chains of 1 to 64 blocks on a belt, one surface a block."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass

from henon_ref.casefile.case import parse_case
from henon_ref.harness import registry
from henon_ref.harness.campaign.timing import Turns, interleaved
from henon_ref.harness.rows import Row
from henon_ref.harness.studies.paired_times.own_calls import clocked, own_part
from henon_ref.harness.studies.paired_times.rows import FIRST
from henon_ref.harness.studies.price.measure import orbit_problem
from henon_ref.harness.studies.runs import largest_time_difference
from henon_ref.harness.table import Table, duration
from henon_ref.modes.problem import Problem
from henon_ref.solver import Run
from henon_ref.trajectory import Trajectory

BLOCKS = (1, 2, 4, 8, 16, 32, 64)
SOLVERS = ("henon", "heyoka", "scipy-dop853")
RTOL = 1e-12
ROUNDS = 20
AGREED = 1e-9
"""Largest distance of two solvers' transition times [s] and last states at which their times are taken down."""
GOLDEN = (math.sqrt(5) - 1) / 2
"""Its multiples modulo 1 spread the blocks' initial positions evenly, no two alike."""
MANY = 16
"""Powers are fitted from so many states on."""
BELT, FAST = 0.2, 5.0
"""Velocity of the belt [m/s], and one that no block reaches."""
SMOOTH_S = 20.0
"""Horizon of the runs without a transition [s]."""


@dataclass(frozen=True)
class Size(Row):
    """One solver on the chains of one length."""

    states: int
    solver: str
    transitions: int
    ready_s: float
    """Wall time of making it ready for the run with transitions, all modes that it visits included [s]."""
    wall_s: float
    """Wall time of a run with transitions [s]."""
    ratio: float
    """The first solver's time over its own, median over the rounds."""
    steps: int
    """Steps of the run without a transition."""
    smooth_s: float
    """Wall time of a run without a transition [s]."""
    smooth_ratio: float
    agrees: bool
    """Whether its transitions and last states are those of the first solver."""
    own_s: float = math.nan
    """What of the run with transitions its library's own calls take [s]; NaN where that is not known."""

    @property
    def per_second(self) -> float:
        """Wall time of a simulated second without a transition [s/s]."""
        return self.smooth_s / SMOOTH_S


def horizon(blocks: int) -> float:
    """Horizon of a chain with transitions [s]: seven to sixteen of them, each leading to a mode of its own."""
    return 40.0 * blocks**-1.4


def chain(blocks: int, *, belt: float = BELT, until: float | None = None) -> Problem:
    """Blocks in a row, each on a spring to the wall, joined by springs, with falling friction on a belt.

    ``xi'' + xi + kc (2 xi - xi-1 - xi+1) = -F sgn(vi) / (1 + delta abs(vi))`` after Burridge and Knopoff, Bull.
    Seismol. Soc. Am. 57 (1967) 341-371; the blocks start at rest at places that never repeat.

    Parameters
    ----------
    blocks : int
    belt : float
        Velocity of the belt [m/s].
    until : float, optional
        Horizon [s]; :func:`horizon` where it is not given.
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
        f"  parameters: {{kc: 1.2, F: 1, delta: 3, vp: {belt}}}",
        f"  surfaces: {{{', '.join(f's{i}: v{i} - vp' for i in numbers)}}}",
        "  field:",
        *(f"    - {rate}" for rate in field),
        f"initial: {{{', '.join(initial)}}}",
        f"until: {horizon(blocks) if until is None else until:.6f}",
    ]
    return parse_case("\n".join(lines) + "\n").readings[0].problem


def sizes(blocks: Sequence[int] = BLOCKS, solvers: Sequence[str] = SOLVERS) -> list[Size]:
    """Run every solver on every chain, with and without transitions, timed in turn."""
    found = []
    for problem in (orbit_problem(), chain(3)):  # what chains of all lengths share is imported and compiled here
        for name in solvers:
            registry.solver(name).prepare(problem, rtol=RTOL)()
    first = solvers[0]
    for count in blocks:
        problem = chain(count)
        ready, runs, times = _timed(problem, solvers)
        _, smooth_runs, smooth_times = _timed(chain(count, belt=FAST, until=SMOOTH_S), solvers)
        ends, smooth_ends = ({name: run() for name, run in own.items()} for own in (runs, smooth_runs))
        for name in solvers:
            found.append(
                Size(
                    states=2 * count,
                    solver=name,
                    transitions=len(ends[name].transitions),
                    ready_s=ready[name],
                    wall_s=times.median(name),
                    ratio=times.ratio(first, name),
                    steps=smooth_ends[name].counts.steps,
                    smooth_s=smooth_times.median(name),
                    smooth_ratio=smooth_times.ratio(first, name),
                    agrees=_agree(ends[first], ends[name])
                    and _agree(smooth_ends[first], smooth_ends[name])
                    and not smooth_ends[name].transitions,
                    own_s=_own_part(problem, name, runs[name]) * times.median(name),
                )
            )
    return found


def _timed(problem: Problem, solvers: Sequence[str]) -> tuple[dict[str, float], dict[str, Run], Turns[str]]:
    """Each solver's preparation time [s], its run, and its times in interleaved runs."""
    runs: dict[str, Run] = {}
    ready: dict[str, float] = {}
    for name in solvers:
        began = time.perf_counter()
        runs[name] = registry.solver(name).prepare(problem, rtol=RTOL)
        runs[name]()  # modes are made ready where they are first met
        ready[name] = time.perf_counter() - began
    return ready, runs, interleaved(runs, rounds=ROUNDS)


def _own_part(problem: Problem, name: str, run: Run) -> float:
    """What part of a run its library's own calls are; NaN where that is not known."""
    solver = clocked(registry.solver(name))
    if solver is None:
        return math.nan
    return own_part(run, solver.prepare(problem, rtol=RTOL), solver.clock, rounds=ROUNDS)


def _agree(first: Trajectory, other: Trajectory) -> bool:
    ends = zip(first.end_state, other.end_state, strict=True)
    return largest_time_difference(first, other) <= AGREED and all(abs(a - b) <= AGREED for a, b in ends)


def size_table(found: Sequence[Size]) -> Table:
    """Time of a run with and without transitions, and of getting ready, over the number of states."""
    solvers = list(dict.fromkeys(size.solver for size in found))
    lines: list[tuple[str, ...]] = []
    for states in dict.fromkeys(own.states for own in found):
        own = {size.solver: size for size in found if size.states == states}
        runs, smooth, ready = (
            [duration(value(own[s])) if own[s].agrees else "other answer" for s in solvers]
            for value in (lambda s: s.wall_s, lambda s: s.smooth_s, lambda s: s.ready_s)
        )
        ratios = [f"{value:.2g}" for value in (own["heyoka"].ratio, own["heyoka"].smooth_ratio)]
        first, alone = own[FIRST], own["heyoka"].own_s
        calls = "" if math.isnan(alone) else duration(alone)
        lines.append((f"{states}", f"{first.transitions}", *runs, ratios[0], calls, *smooth, ratios[1], *ready))
    names = [f"`{solver}`" for solver in solvers]
    headings = (
        "states", "transitions", *(f"run, {n}" for n in names), "`henon` / `heyoka`", "run, `heyoka`'s own calls alone",
        *(f"without transitions, {n}" for n in names), "`henon` / `heyoka`", *(f"ready, {n}" for n in names),
    )  # fmt: skip
    return Table(headings, "r" * len(headings), lines)
