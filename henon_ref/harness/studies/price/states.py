"""Times over the number of states: chains of 1 to 64 blocks on a belt, one surface per block."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

from matplotlib.figure import Figure

from henon_ref.figures import style
from henon_ref.harness import registry
from henon_ref.harness.campaign.timing import Turns, interleaved
from henon_ref.harness.rows import Row
from henon_ref.harness.studies.page import largest_time_difference, shipped_problem
from henon_ref.harness.studies.pairs import FIRST, own_part
from henon_ref.harness.studies.price.measure import draw_line, finish, fitted, problem_of
from henon_ref.harness.table import Table, duration
from henon_ref.modes.problem import Problem
from henon_ref.simulation.system import System
from henon_ref.solver import Run, Solver
from henon_ref.text import code
from henon_ref.trajectory import Trajectory

BLOCKS = (1, 2, 4, 8, 16, 32, 64)
SOLVERS = ("henon", "heyoka", "scipy-dop853")
RTOL = 1e-12
ROUNDS = 20
AGREED = 1e-9
"""Largest difference of two solvers' transition times [s] and end states at which their times are compared."""
GOLDEN = (math.sqrt(5) - 1) / 2
"""The multiples of this number modulo 1 spread the blocks' initial positions evenly, without repetition."""
MANY = 16
"""Smallest number of states at which powers are fitted."""
BELT, FAST = 0.2, 5.0
"""Velocity of the belt, and a velocity that no block reaches [m/s]."""
SMOOTH_S = 20.0
"""Horizon of the runs without a transition [s]."""


@dataclass(frozen=True)
class Size(Row):
    """Times of one solver on the chains of one length."""

    states: int
    solver: str
    transitions: int
    ready_s: float
    """Wall time of preparing the run with transitions and all modes that it visits [s]."""
    wall_s: float
    """Wall time of a run with transitions [s]."""
    ratio: float
    """Time of the first solver divided by that of this solver, median over the rounds."""
    steps: int
    """Steps of the run without a transition."""
    smooth_s: float
    """Wall time of a run without a transition [s]."""
    smooth_ratio: float
    agrees: bool
    """Whether transitions and end states agree with those of the first solver."""
    own_s: float | None = None
    """Time of the library's own calls in the run with transitions [s]; None if it is unknown."""

    @property
    def per_second(self) -> float:
        """Wall time of a simulated second without a transition [s/s]."""
        return self.smooth_s / SMOOTH_S


def chain(blocks: int, belt: float) -> System:
    """Make a chain of blocks joined by springs, each with a spring to the wall and falling friction on a belt.

    ``xi'' + xi + kc (2 xi - xi-1 - xi+1) = -F sgn(vi) / (1 + delta abs(vi))`` after Burridge and Knopoff, Bull.
    Seismol. Soc. Am. 57 (1967) 341-371; ``belt`` is the belt's velocity [m/s].
    """
    numbers = range(1, blocks + 1)
    pulls = {i: "".join(f" - kc*(x{i} - x{j})" for j in (i - 1, i + 1) if j in numbers) for i in numbers}
    return System(
        state=[name for i in numbers for name in (f"x{i}", f"v{i}")],
        parameters={"kc": 1.2, "F": 1, "delta": 3, "vp": belt},
        surfaces={f"s{i}": f"v{i} - vp" for i in numbers},
        field=[rate for i in numbers for rate in (f"v{i}", f"-x{i}{pulls[i]} - F*s{i}/(1 + delta*s{i}*(v{i} - vp))")],
    )


def chain_problem(blocks: int, *, belt: float = BELT, until: float | None = None) -> Problem:
    """Make the problem of a chain that starts at rest, with all initial positions different.

    ``until`` is the horizon [s]. The default horizon has seven to sixteen transitions, each to a new mode.
    """
    initial = {name: value for i in range(1, blocks + 1) for name, value in ((f"x{i}", i * GOLDEN % 1), (f"v{i}", 0))}
    horizon = 40.0 * blocks**-1.4 if until is None else until
    return problem_of(chain(blocks, belt), {name: f"{x:.6f}" for name, x in initial.items()}, f"{horizon:.6f}")


def sizes(blocks: Sequence[int] = BLOCKS, solvers: Sequence[str] = SOLVERS) -> list[Size]:
    """Time every solver on every chain, with and without transitions, in interleaved runs."""
    found = []
    # Import and compile everything that chains of all lengths share.
    for problem in (shipped_problem("fig8", "listing_limit"), chain_problem(3)):
        for name in solvers:
            registry.solver(name).prepare(problem, rtol=RTOL)()
    first = solvers[0]
    for count in blocks:
        problem = chain_problem(count)
        ready, runs, times = _timed(problem, solvers)
        _, smooth_runs, smooth_times = _timed(chain_problem(count, belt=FAST, until=SMOOTH_S), solvers)
        ends, smooth_ends = ({name: run() for name, run in own.items()} for own in (runs, smooth_runs))
        for name in solvers:
            part = own_part(name, runs[name], partial(_prepared, problem=problem), rounds=ROUNDS)
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
                    own_s=None if part is None else part * times.median(name),
                )
            )
    return found


def _prepared(solver: Solver, problem: Problem) -> Run:
    return solver.prepare(problem, rtol=RTOL)


def _timed(problem: Problem, solvers: Sequence[str]) -> tuple[dict[str, float], dict[str, Run], Turns[str]]:
    """Return each solver's preparation time [s], its run, and its times in interleaved runs."""
    runs: dict[str, Run] = {}
    ready: dict[str, float] = {}
    for name in solvers:
        began = time.perf_counter()
        runs[name] = _prepared(registry.solver(name), problem)
        runs[name]()  # modes are prepared at their first visit
        ready[name] = time.perf_counter() - began
    return ready, runs, interleaved(runs, rounds=ROUNDS)


def _agree(first: Trajectory, other: Trajectory) -> bool:
    ends = zip(first.end_state, other.end_state, strict=True)
    return largest_time_difference(first, other) <= AGREED and all(abs(a - b) <= AGREED for a, b in ends)


def size_table(found: Sequence[Size]) -> Table:
    """Table of the times of runs with and without transitions, and of preparation, over the number of states."""
    solvers = list(dict.fromkeys(size.solver for size in found))
    lines: list[tuple[str, ...]] = []
    for states in dict.fromkeys(own.states for own in found):
        own = {size.solver: size for size in found if size.states == states}
        runs, smooth, ready = (
            [duration(getattr(own[s], column)) if own[s].agrees else "other result" for s in solvers]
            for column in ("wall_s", "smooth_s", "ready_s")
        )
        first, heyoka = own[FIRST], own["heyoka"]
        lines.append(
            (
                f"{states}", f"{first.transitions}", *runs, f"{heyoka.ratio:.2g}", duration(heyoka.own_s),
                *smooth, f"{heyoka.smooth_ratio:.2g}", *ready,
            )
        )  # fmt: skip
    names = list(map(code, solvers))
    headings = (
        "states", "transitions", *(f"run, {n}" for n in names), "`henon` / `heyoka`", "run, calls of `heyoka` alone",
        *(f"without transitions, {n}" for n in names), "`henon` / `heyoka`", *(f"preparation, {n}" for n in names),
    )  # fmt: skip
    return Table(headings, "r" * len(headings), lines)


def draw_sizes(found: Sequence[Size]) -> Figure:
    """Draw the times of a simulated second and of preparation over the number of states, for every solver."""
    columns = {
        "per_second": (1e3, "wall time of a simulated second [ms]"),
        "ready_s": (1.0, "wall time of the preparation [s]"),
    }
    powers = {
        solver: [str(fitted(found, solver, "states", column, MANY)) for column in columns]
        for solver in dict.fromkeys(own.solver for own in found)
    }
    ticks = sorted({size.states for size in found})
    with style.figure(3.2) as figure:
        panels = figure.subplots(1, 2)
        for k, (column, (unit, words)) in enumerate(columns.items()):
            for solver, fits in powers.items():
                own = [size for size in found if size.solver == solver and size.agrees]
                points = [(size.states, unit * getattr(size, column)) for size in own]
                draw_line(panels[k], style.line_of(solver), points, f"{solver}: ~ states^({fits[k]})")
            panels[k].set_xticks(ticks, [str(tick) for tick in ticks], minor=False)
            panels[k].set_xticks([], minor=True)
            panels[k].set(xlabel="states", ylabel=words)
        finish(
            figure,
            "Time of a simulated second and of the preparation over the number of states",
            "Two panels with logarithmic axes, one line per solver. Times grow with a power of the number of states: "
            + "; ".join(f"{solver} {', '.join(fits)}" for solver, fits in powers.items())
            + ".",
            panels,
        )
    return figure
