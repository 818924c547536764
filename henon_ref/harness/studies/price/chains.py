"""Chains of blocks on a belt, one surface per block: times over the number of states, and runs that enter new modes."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from statistics import median

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from henon_ref.figures import style
from henon_ref.grouping import grouped
from henon_ref.harness import registry
from henon_ref.harness.campaign.timing import Turns, interleaved, timed
from henon_ref.harness.rows import Row
from henon_ref.harness.score.ranking import by_solver
from henon_ref.harness.studies.page import draw_line, finish, fitted, largest_time_difference, shipped_problem
from henon_ref.harness.studies.pairs import FIRST, own_part
from henon_ref.harness.table import Table, duration
from henon_ref.modes.problem import Problem
from henon_ref.simulation.arguments import problem_of
from henon_ref.simulation.simulate import simulate
from henon_ref.simulation.system import System
from henon_ref.solver import Run, Solver
from henon_ref.text import code
from henon_ref.trajectory import Trajectory

RTOL = 1e-12
ROUNDS = 20
HORIZON = 20.0
"""Horizon of the runs without a transition, and of those from random initial states [s]."""
BELT = 0.5
"""Velocity of the belt in runs from random initial states [m/s]."""
BY_HAND_RTOL = 1e-9
"""Tolerance of these runs."""


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
        return self.smooth_s / HORIZON


@dataclass(frozen=True)
class ManyContacts(Row):
    """Measurement of a chain with a random initial state."""

    blocks: int
    transitions: int
    new_s: float
    """Wall time of the first run, with only its initial mode prepared [s]."""
    again_s: float
    """Median wall time of five further runs [s]."""
    by_hand_s: float | None
    """Wall time of a loop over SciPy's DOP853 [s]; None if its transitions differ."""


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


def chain_problem(blocks: int, *, belt: float = 0.2, until: float | None = None) -> Problem:
    """Make the problem of a chain that starts at rest, with all initial positions different.

    ``belt`` is the belt's velocity [m/s], and ``until`` the horizon [s]. The default horizon has seven to sixteen
    transitions, each to a new mode.
    """
    golden = (math.sqrt(5) - 1) / 2  # its multiples modulo 1 spread the positions evenly, without repetition
    initial = {name: value for i in range(1, blocks + 1) for name, value in ((f"x{i}", i * golden % 1), (f"v{i}", 0))}
    horizon = 40.0 * blocks**-1.4 if until is None else until
    start = {name: f"{x:.6f}" for name, x in initial.items()}
    return problem_of(chain(blocks, belt), start, until=f"{horizon:.6f}")[1]


def sizes(
    blocks: Sequence[int] = (1, 2, 4, 8, 16, 32, 64), solvers: Sequence[str] = ("henon", "heyoka", "scipy-dop853")
) -> list[Size]:
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
        no_contact = chain_problem(count, belt=5.0, until=HORIZON)  # no block reaches this velocity
        _, smooth_runs, smooth_times = _timed(no_contact, solvers)
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
    """Check whether transition times [s] and end states differ by at most 1e-9, so that wall times are comparable."""
    ends = zip(first.end_state, other.end_state, strict=True)
    return largest_time_difference(first, other) <= 1e-9 and all(abs(a - b) <= 1e-9 for a, b in ends)


def size_table(found: Sequence[Size]) -> Table:
    """Table of the times of runs with and without transitions, and of preparation, over the number of states."""
    solvers = list(by_solver(found))
    lines: list[tuple[str, ...]] = []
    for states, rows in grouped(found, lambda size: size.states).items():
        own = {size.solver: size for size in rows}
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
    return Table(headings, "r", lines)


def draw_sizes(found: Sequence[Size]) -> Figure:
    """Draw the times of a simulated second and of preparation over the number of states, for every solver."""
    columns = {
        "per_second": (1e3, "wall time of a simulated second [ms]"),
        "ready_s": (1.0, "wall time of the preparation [s]"),
    }
    solvers = by_solver(found)
    powers = {solver: [fitted(own, "states", name, since=16) for name in columns] for solver, own in solvers.items()}
    ticks = sorted({size.states for size in found})
    with style.figure(3.2) as figure:
        panels = figure.subplots(1, 2)
        for k, (column, (unit, words)) in enumerate(columns.items()):
            for solver, fits in powers.items():
                points = [(size.states, unit * getattr(size, column)) for size in solvers[solver] if size.agrees]
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


def many_contacts(blocks: int) -> ManyContacts:
    """Measure a run from a random initial state that enters new modes, the same run again, and SciPy's loop."""
    system = chain(blocks, BELT)
    x, v = np.random.default_rng(blocks).uniform(-1, 1, (2, blocks)).round(3)
    start = np.column_stack([2 * x, v]).ravel().tolist()
    run = partial(simulate, system, start, rtol=BY_HAND_RTOL, dense_output=False)
    run(until=1e-6)  # prepares the system, with its initial mode only
    new, *again = (timed(partial(run, until=HORIZON)) for _ in range(6))
    exact = run(until=HORIZON).transitions["time_s"].to_numpy()
    times: list[float] = []
    by_hand = timed(lambda: times.extend(switching_by_hand(2 * x, v)))
    agrees = len(times) == len(exact) and bool(np.abs(exact - times).max() <= 1e-6)
    return ManyContacts(blocks, len(exact), new, median(again), by_hand if agrees else None)


def switching_by_hand(x: NDArray[np.float64], v: NDArray[np.float64]) -> list[float]:
    """Transition times of the chain [s] by ``solve_ivp`` with one right-hand side for all modes.

    A block has the sign -1 or 1 in slip, and 0 in stick.
    """
    count = len(x)
    between = 1.2 * (np.diag([2.0] * count) - np.eye(count, k=1) - np.eye(count, k=-1))
    between[[0, -1], [0, -1]] = 1.2
    stiffness = np.eye(count) + between
    signs, t, y, times = np.sign(v - BELT), 0.0, np.concatenate([x, v]), []

    def field(t: float, y: NDArray[np.float64]) -> NDArray[np.float64]:
        slip = y[count:] - BELT
        return np.concatenate([y[count:], (signs != 0) * (-stiffness @ y[:count] - signs / (1 + 3 * signs * slip))])

    def guard(i: int) -> Callable[..., float]:
        def value(t: float, y: NDArray[np.float64]) -> float:
            """Positive while the block slides in its direction, or sticks."""
            return float(signs[i] * (y[count + i] - BELT) if signs[i] else 1 - abs(stiffness[i] @ y[:count]))

        value.terminal, value.direction = True, -1  # type: ignore[attr-defined]
        return value

    guards = [guard(i) for i in range(count)]
    while t < HORIZON:
        run = solve_ivp(field, (t, HORIZON), y, "DOP853", events=guards, rtol=BY_HAND_RTOL, atol=BY_HAND_RTOL)
        t, y = run.t[-1], run.y[:, -1]
        for i in (i for i, own in enumerate(run.t_events) if own.size):
            pull = -stiffness[i] @ y[:count]
            signs[i] = np.sign(pull) if signs[i] == 0 or abs(pull) > 1 else 0
            y[count + i] = BELT + signs[i] * 1e-12  # a released block slides, or its contact would stick again at once
            times.append(t)
    return times


def contact_table(found: Sequence[ManyContacts]) -> Table:
    """Table of transitions and times over the number of blocks."""
    headings = ("blocks", "transitions", "first run", "second run", "SciPy DOP853 by hand")
    lines = []
    for own in found:
        by_hand = "other result" if own.by_hand_s is None else duration(own.by_hand_s)
        lines.append((f"{own.blocks}", f"{own.transitions}", duration(own.new_s), duration(own.again_s), by_hand))
    return Table(headings, "r", lines)
