"""Cost of every solver: a ladder of tolerances, paired times of the cheapest settings, times of preparation."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from statistics import geometric_mean
from tempfile import TemporaryDirectory

from matplotlib.figure import Figure

from henon_ref.casefile.case import Case
from henon_ref.figures import style
from henon_ref.figures.style import describe
from henon_ref.harness import registry
from henon_ref.harness.campaign.options import Options
from henon_ref.harness.campaign.progress import ProgressLine
from henon_ref.harness.campaign.timing import timed
from henon_ref.harness.figures import label_column
from henon_ref.harness.result_files import csv_text
from henon_ref.harness.rows import ReadingRow, RunRow, number
from henon_ref.harness.score.ranking import LEVELS, by_solver, reaching, readings_of, right
from henon_ref.harness.studies.page import draw_line, in_fresh_process, rows_of, title
from henon_ref.harness.studies.pairs import FIRST, SECOND, PairedTiming, PairRow, TimedPair, bound, pairs_of, time_pairs
from henon_ref.harness.table import Table, duration, significant
from henon_ref.modes.problem import Problem
from henon_ref.text import code

FEWEST = 3
"""Smallest number of rounds of a pair, so that slow runs have a median, too."""
TIMEOUT = 4.0
"""Time that one run may take [s]; a slower run is never the cheapest if another solver reaches the digits."""
WHEN_NAMED = ("cvode-c-adams", "cvode-c-bdf", "octave-ode45")
"""Solvers that other commands run only if they are named, but that the ladder always includes."""
ALONE = f"{code(SECOND)}, its own calls alone"
COUNTS = {
    "wall_s": "wall time of one run, median",
    "rhs_evaluations": "right-hand sides (of henon and heyoka: whole Taylor expansions)",
    "steps": "steps",
}
"""Columns for the axis of cost, with their labels."""
AGAINST = {
    FIRST: ("heyoka", "scipy-dop853"),
    "heyoka": ("scipy-dop853",),
    "cvode-c-adams": ("cvode-adams",),
    "diffrax-dopri8": ("scipy-dop853",),
    "diffrax-kvaerno5": ("scipy-radau",),
    "diffsol-tsit45": ("scipy-dop853",),
    "diffsol-bdf": ("scipy-radau",),
}
"""Solvers that compile, and the solvers with which each is compared: quicker to prepare, slower to run."""


@dataclass(frozen=True)
class Ready(ReadingRow):
    """Preparation times of one solver on one reading."""

    solver: str
    rtol: float
    wall_s: float
    """Time of a run, interleaved with those of the other solvers [s]."""
    cold_s: float
    """Time of the preparation and the first run in a new process, minus the time of a run, without compiled code on
    disk [s]. The start of the interpreter and the imports that all solvers need are not included."""
    kept_s: float
    """The same time with the compiled code of the first process on disk [s]."""

    def paid_after(self, other: Ready) -> str:
        """Number of runs after which the total time is below that of ``other``: without / with code on disk."""
        gain = other.wall_s - self.wall_s
        extra = self.cold_s - other.cold_s, self.kept_s - other.kept_s
        return " / ".join("never" if gain <= 0 else significant(max(math.ceil(own / gain), 0), 2) for own in extra)


def solvers(chosen: Sequence[str] = ()) -> tuple[str, ...]:
    """Names of the ladder's solvers: the reference and ``chosen``, or the default solvers and :data:`WHEN_NAMED`.

    ``all`` includes the installed peers. Solvers with a fixed step use the steps of the case. CaseError if a name is
    unknown.
    """
    named = [registry.check(name) for name in chosen if name != registry.ALL]
    if registry.ALL in chosen:
        every = registry.expanded((registry.ALL,))
    else:
        every = () if named else (*registry.default_names(), *WHEN_NAMED)
    return tuple(dict.fromkeys((FIRST, *every, *named)))


def run_ladder(cases: Sequence[Case], options: Options, observer: ProgressLine) -> list[RunRow]:
    """Run the ladder on the cases' readings, except those for certain solvers only (Listing 1 as printed).

    The ladder uses its own tolerances and deadline. If a library refuses a tolerance, the row has its message.
    """
    changed = replace(options, tolerances=tuple(10.0**-k for k in range(3, 16)), timeout=TIMEOUT)
    open_to_all = [replace(case, readings=tuple(r for r in case.readings if r.solvers is None)) for case in cases]
    return rows_of(open_to_all, changed, observer)


def time_ladder_pairs(
    cases: Sequence[Case], rows: Sequence[RunRow], options: Options, observer: ProgressLine, seconds: float = 4.0
) -> tuple[list[TimedPair], list[str]]:
    """Time the pairs on every reading that both solvers solve; return the rows, and sentences on failed timings.

    ``seconds``: time that the runs of a pair may take [s].
    """
    by_reading = readings_of(rows)
    rivals = [solver for solver in by_solver(rows) if solver != FIRST]
    timings = [
        PairedTiming(case.name, reading.name, reading.problem, found, seconds, TIMEOUT, fewest=FEWEST)
        for case in cases
        for reading in case.readings
        for rival in rivals
        if (found := tuple(pairs_of(by_reading.get((case.name, reading.name), []), {rival: (rival,)}, LEVELS)))
    ]
    return time_pairs(timings, options, observer)


def samples_text(found: Sequence[TimedPair]) -> str:
    """Write the raw samples of the pairs' ratios as CSV: a row per solver, times [µs] in order, separated by blanks."""
    rows = []
    for row in found:
        for solver, rtol, step, samples in (
            (FIRST, row.rtol, None, row.samples_s),
            (row.rival, row.rival_rtol, row.rival_step_s, row.rival_samples_s),
        ):
            times = " ".join(f"{1e6 * sample:.5g}" for sample in samples)
            rows.append((*row.problem, row.against, row.digits, solver, rtol, step, times))
    return csv_text(("case", "reading", "against", "digits", "solver", "rtol", "step_s", "samples_us"), rows)


def mean_costs(found: Sequence[PairRow], digits: int) -> dict[str, float]:
    """Geometric mean of each solver's time divided by that of ``henon``, at a level of digits.

    The mean is over all readings in which some other solver reaches the level. Solvers that do not reach it in each
    of these are left out. The entry :data:`ALONE` is for heyoka's own calls, if they are known in all readings.
    """
    own = [row for row in found if row.digits == digits]
    readings = {row.problem for row in own}
    costs: dict[str, list[float]] = {FIRST: [1.0] * len(readings)} if own else {}
    for row in own:
        costs.setdefault(row.rival, []).append(row.times_as_long)
        if row.rival == SECOND and row.own_times_as_long is not None:
            costs.setdefault(ALONE, []).append(row.own_times_as_long)
    return {solver: geometric_mean(ratios) for solver, ratios in costs.items() if len(ratios) == len(readings)}


def whole_table(rows: Sequence[RunRow], pairs: Sequence[PairRow]) -> Table:
    """Table of the solvers by their geometric mean cost over all readings, for every level."""
    means = {level: mean_costs(pairs, level) for level in LEVELS}
    solvers = sorted(by_solver(rows), key=lambda solver: min(own.get(solver, math.inf) for own in means.values()))
    lines = []
    for solver in solvers:
        cells = [
            significant(own[solver], 2) if solver in own else f"*{why_not(rows, solver, level)}*"
            for level, own in means.items()
        ]
        lines.append((code(solver), *cells))
        if solver == SECOND and any(ALONE in own for own in means.values()):
            lines.append((ALONE, *(significant(own[ALONE], 2) if ALONE in own else "" for own in means.values())))
    return Table(("solver", *(f"{level} digits" for level in LEVELS)), "lr", lines)


def why_not(rows: Sequence[RunRow], solver: str, digits: int) -> str:
    """Reason why a solver has no mean cost at a level, from the first reading in which it does not reach the level."""
    for own in readings_of(rows).values():
        ladder = [row for row in own if row.solver == solver]
        if reaching([row for row in own if row.solver != solver], digits) and not reaching(ladder, digits):
            ends = {"unsupported": "unsupported", "unavailable": "not installed"}
            if any(row.status == "timeout" for row in ladder):
                return f"over {TIMEOUT:g} s"
            return next((ends[row.status] for row in ladder if row.status in ends), "not reached")
    return ""


def own_times(pairs: Sequence[PairRow]) -> str:
    """Text of the geometric mean time of the reference's runs, for every level."""
    cells = []
    for level in LEVELS:
        times = {row.problem: row.wall_s for row in pairs if row.digits == level}
        if times:
            cells.append(f"{duration(geometric_mean(times.values()))} for {level} digits")
    return ", ".join(cells)


def rival_table(found: Sequence[PairRow]) -> Table:
    """Table of the rivals' times divided by ``henon``'s at equal digits, by reading, with heyoka's own calls."""
    ran = {row.rival for row in found}
    # The file contains the pairs of all rivals.
    shown = (
        "cvode-c-adams", "cvode-adams", "scipy-dop853", "diffrax-dopri8", "diffrax-kvaerno5", "diffsol-tsit45",
        "diffsol-bdf",
    )  # fmt: skip
    listed = [SECOND, *(rival for rival in shown if rival in ran)]
    columns = [SECOND, ALONE, *listed[1:]]
    cells: dict[tuple[str, str], dict[str, str]] = {}
    for row in found:
        if row.rival in listed:
            own = cells.setdefault((title(*row.problem), bound(row.digits)), {})
            # The row has henon's time divided by the rival's; in the inverse the ends of the interval are swapped.
            times, low, high = (significant(1.0 / ratio, 2) for ratio in (row.ratio, row.ratio_high, row.ratio_low))
            own[row.rival] = f"{times} ({low} to {high})"
            if row.rival == SECOND and row.own_times_as_long is not None:
                own[ALONE] = significant(row.own_times_as_long, 2)
    lines = [(*key, *(own.get(column, "") for column in columns)) for key, own in cells.items()]
    headings = [column if column == ALONE else code(column) for column in columns]
    return Table(("reading", "digits", *headings), "lr", lines)


def readiness(cases: Sequence[Case], pairs: Iterable[PairRow]) -> list[Ready]:
    """Measure preparation times on every reading, at the settings of the pairs with nine digits."""
    problems = {(case.name, reading.name): reading.problem for case in cases for reading in case.readings}
    named = {*AGAINST, *(other for others in AGAINST.values() for other in others)}
    settings: dict[tuple[str, str, str], tuple[float, float]] = {}
    for row in pairs:
        if row.digits == 9:
            settings.setdefault((*row.problem, FIRST), (number(row.rtol), row.wall_s))
            if row.rival in named:
                settings[(*row.problem, row.rival)] = number(row.rival_rtol), row.rival_wall_s
    found = []
    for (case, reading, solver), (rtol, wall) in settings.items():
        with TemporaryDirectory() as folder:
            given = problems[case, reading], solver, rtol
            cold, kept = (in_fresh_process(getting_ready, *given, cache=folder) for _ in range(2))
        found.append(Ready(case, reading, solver, rtol, wall, cold, kept))
    return found


def getting_ready(problem: Problem, solver: str, rtol: float) -> float:
    """Time to the end of the first run, minus the shortest time of three later runs [s]."""
    began = time.perf_counter()
    run = registry.solver(solver).prepare(problem, rtol=rtol, atol=rtol, deadline=TIMEOUT)
    run()
    first = time.perf_counter() - began
    return first - min(timed(run) for _ in range(3))


def ready_table(found: Sequence[Ready]) -> Table:
    """Table of the preparation times and the number of runs that compensate them."""
    lines: list[tuple[str, ...]] = []
    for own in found:
        others = {other.solver: other for other in found if other.problem == own.problem}
        rivals = [rival for rival in AGAINST.get(own.solver, ()) if rival in others]
        paid = "; ".join(f"{own.paid_after(others[rival])} against {code(rival)}" for rival in rivals)
        times = map(duration, (own.wall_s, own.cold_s, own.kept_s))
        lines.append((title(*own.problem), code(own.solver), *times, paid))
    headings = (
        "reading", "solver", "run", "preparation, no code on disk", "preparation, code on disk",
        "compensated after runs (no code on disk / code on disk)",
    )  # fmt: skip
    return Table(headings, "llrrrl", lines)


def scatter(rows: Sequence[RunRow]) -> dict[str, int]:
    """Number of times of a reading, of those that scatter by more than a tenth, and of those without a range."""
    own = [row for row in rows if row.wall_s is not None]
    return {
        "times": len(own),
        "wide": sum(number(row.wall_s_iqr) > 0.1 * number(row.wall_s) for row in own),
        "few": sum(row.wall_s_iqr is None for row in own),
    }


def draw_ladder(rows: Sequence[RunRow], count: str) -> Figure:
    """Draw the largest error of a transition time against a cost, one line per solver, for one reading.

    Bars of times are the 95 % intervals of the medians.
    """
    is_time = count == "wall_s"
    ladders = by_solver(row for row in right(rows) if row.max_time_error_s is not None and getattr(row, count))
    lines = style.lines_of(by_solver(right(rows)))
    tips, floor = {}, 1e-16  # smaller errors [s] are drawn as this one
    with style.figure(4.4) as figure:
        axes = figure.add_axes((0.1, 0.12, 0.645, 0.8))
        axes.set(xscale="log", yscale="log")
        if ladders and all(number(row.max_time_error_s) <= floor for ladder in ladders.values() for row in ladder):
            axes.set_ylim(0.1 * floor, 10.0 * floor)  # matplotlib finds no limits around one small number
        for solver, ladder in ladders.items():
            errors = [max(number(row.max_time_error_s), floor) for row in ladder]
            points = [(getattr(row, count), error) for row, error in zip(ladder, errors, strict=True)]
            draw_line(axes, lines[solver], points, "", ms=3.5)
            if is_time:
                low, high = ([number(getattr(row, end)) for row in ladder] for end in ("wall_s_low", "wall_s_high"))
                axes.hlines(errors, low, high, color=lines[solver].colour, lw=0.8)
            tips[solver] = min(errors)
        style.decades(axes.xaxis, style.time_text if is_time else style.power_of_ten)
        style.decades(axes.yaxis)
        ordered = sorted(tips, key=lambda solver: -tips[solver])
        label_column(axes, [(solver, lines[solver]) for solver in ordered], gap=0.05)
        if is_time:
            axes.plot([], [], color=style.GREY, lw=0.8, label="95 % interval of the median")
            axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), borderaxespad=0.2)
        axes.set(xlabel=COUNTS[count], ylabel="worst error of a transition time [s]")
        least = "; ".join(f"{solver} {tips[solver]:.1e} s" for solver in ordered)
        describe(
            figure,
            f"Accuracy against {'time' if is_time else count.replace('_', ' ')}",
            f"Logarithmic axes: {COUNTS[count]} (horizontal), and worst error of a transition time (vertical). "
            f"Least error of each solver: {least}.",
        )
    return figure
