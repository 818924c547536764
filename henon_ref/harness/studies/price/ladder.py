"""Every solver at every tolerance, 1e-3 to 1e-15; then the cheapest for so many digits in turn: rows and prices."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from statistics import geometric_mean

from matplotlib.figure import Figure

from henon_ref.casefile.case import Case
from henon_ref.figures import style
from henon_ref.figures.description import describe
from henon_ref.harness import registry
from henon_ref.harness.campaign.options import Options
from henon_ref.harness.campaign.progress import Observer
from henon_ref.harness.figures.labels import label_column
from henon_ref.harness.report.text.ranking import LEVELS, by_solver, reaching, readings_of, right
from henon_ref.harness.rows import Row, RunRow, number
from henon_ref.harness.studies.page import rows_of
from henon_ref.harness.studies.pairs import FIRST, SECOND, PairedTiming, PairRow, TimedPair, bound, pairs_of, time_pairs
from henon_ref.harness.studies.price.measure import draw_line, title
from henon_ref.harness.table import Table, duration, significant
from henon_ref.text import code

LISTED = (
    SECOND, "cvode-c-adams", "cvode-adams", "scipy-dop853", "diffrax-dopri8", "diffrax-kvaerno5", "diffsol-tsit45",
    "diffsol-bdf",
)  # fmt: skip
"""Rivals whose pairs are shown reading by reading, where they ran; those of all are in the file."""
SECONDS, FEWEST = 4.0, 3
"""Time that the runs of a pair may take [s]; rounds at least, so that a median is taken of three even of slow ones."""
LADDER = tuple(10.0**-k for k in range(3, 16))
"""Relative tolerances. A library that refuses one says so, and the row with it."""
TIMEOUT = 4.0
"""Seconds that one run may take: a slower one is never the cheapest where any other gets there."""
WHEN_NAMED = ("cvode-c-adams", "cvode-c-bdf", "octave-ode45")
"""Solvers that run when named elsewhere, which belong here all the same."""
ALONE = f"{code(SECOND)}, its own calls alone"
COUNTS = {
    "wall_s": "wall time of one run, median",
    "rhs_evaluations": "right-hand sides (of henon and heyoka: whole Taylor expansions)",
    "steps": "steps",
}
"""What may stand on the axis of cost."""


def solvers(chosen: Sequence[str] = ()) -> tuple[str, ...]:
    """Names of the solvers; those of a fixed step run at the steps that the case names.

    Parameters
    ----------
    chosen : sequence of str
        Those asked for, to which the reference is added that prices are multiples of. None: those that run by default
        and :data:`WHEN_NAMED`; with ``all`` the peers that are installed as well.

    Raises
    ------
    CaseError
        For an unknown name.
    """
    named = [registry.check(name) for name in chosen if name != registry.ALL]
    if registry.ALL in chosen:
        every = registry.expanded((registry.ALL,))
    else:
        every = () if named else (*registry.default_names(), *WHEN_NAMED)
    return tuple(dict.fromkeys((FIRST, *every, *named)))


def run_ladder(cases: Sequence[Case], options: Options, observer: Observer) -> list[RunRow]:
    """Rows of the ladder on the cases' readings, but for those tied to a solver of their own (Listing 1 as printed).

    Tolerances and deadline are its own.
    """
    changed = replace(options, tolerances=LADDER, timeout=TIMEOUT)
    open_to_all = [replace(case, readings=tuple(r for r in case.readings if r.solvers is None)) for case in cases]
    return [row for own in rows_of(open_to_all, changed, observer).values() for row in own]


def time_ladder_pairs(
    cases: Sequence[Case], rows: Sequence[RunRow], options: Options, observer: Observer, seconds: float = SECONDS
) -> tuple[list[TimedPair], list[str]]:
    """Time the pairs on every reading that both solve, by the ladder's rows; what could not be timed beside them."""
    by_reading = readings_of(rows)
    rivals = [solver for solver in by_solver(rows) if solver != FIRST]
    timings = {
        case.name: [
            PairedTiming(case.name, reading.name, reading.problem, found, seconds, TIMEOUT, fewest=FEWEST)
            for reading in case.readings
            for rival in rivals
            if (found := tuple(pairs_of(by_reading.get((case.name, reading.name), []), {rival: (rival,)}, LEVELS)))
        ]
        for case in cases
    }
    return time_pairs(timings, options, observer)


@dataclass(frozen=True)
class SampleRow(Row):
    """The raw samples of one side of a pair."""

    case: str
    reading: str
    against: str
    digits: int | None
    solver: str
    rtol: float | None
    step_s: float | None
    samples_us: str
    """In their order, with blanks between them."""


def samples_of(found: Sequence[TimedPair]) -> list[SampleRow]:
    """The raw samples behind the pairs' ratios: two rows a pair."""
    rows = []
    for row in found:
        pair = (*row.problem, row.against, row.digits)
        for solver, rtol, step, samples in (
            (FIRST, row.rtol, None, row.samples_s),
            (row.rival, row.rival_rtol, row.rival_step_s, row.rival_samples_s),
        ):
            rows.append(SampleRow(*pair, solver, rtol, step, " ".join(f"{1e6 * sample:.5g}" for sample in samples)))
    return rows


def mean_costs(found: Sequence[PairRow], digits: int) -> dict[str, float]:
    """Geometric mean of each solver's time over that of ``henon``, for so many digits.

    Over all readings that another solver gets to so many digits, too; solvers that do not get there in every one are
    left out. heyoka's own calls, where they are known in all, are one more entry, :data:`ALONE`.
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
    """Solvers by their geometric mean cost over all readings, for every level."""
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
    return Table(("solver", *(f"{level} digits" for level in LEVELS)), "l" + "r" * len(LEVELS), lines)


def why_not(rows: Sequence[RunRow], solver: str, digits: int) -> str:
    """Why a solver has no mean cost for so many digits: what keeps it from them in the first reading where it fails."""
    for own in readings_of(rows).values():
        ladder = [row for row in own if row.solver == solver]
        if reaching([row for row in own if row.solver != solver], digits) and not reaching(ladder, digits):
            ends = {"unsupported": "unsupported", "unavailable": "not installed"}
            if any(row.status == "timeout" for row in ladder):
                return f"over {TIMEOUT:g} s"
            return next((ends[row.status] for row in ladder if row.status in ends), "not reached")
    return ""


def own_times(pairs: Sequence[PairRow]) -> str:
    """Geometric mean time of the reference's runs, for every level."""
    cells = []
    for level in LEVELS:
        times = {row.problem: row.wall_s for row in pairs if row.digits == level}
        if times:
            cells.append(f"{duration(geometric_mean(times.values()))} for {level} digits")
    return ", ".join(cells)


def rival_table(found: Sequence[PairRow]) -> Table:
    """How many times as long as `henon` others take, for the same digits, by reading, and heyoka's own calls."""
    ran = {row.rival for row in found}
    listed = [rival for rival in LISTED if rival == SECOND or rival in ran]
    columns = [SECOND, ALONE, *listed[1:]]
    cells: dict[tuple[str, str], dict[str, str]] = {}
    for row in found:
        if row.rival in listed:
            own = cells.setdefault((title(*row.problem), bound(row.digits)), {})
            # A row has henon's time over the other's: the ends of its interval change places.
            times, low, high = (significant(1.0 / ratio, 2) for ratio in (row.ratio, row.ratio_high, row.ratio_low))
            own[row.rival] = f"{times} ({low} to {high})"
            if row.rival == SECOND and row.own_times_as_long is not None:
                own[ALONE] = significant(row.own_times_as_long, 2)
    lines = [(*key, *(own.get(column, "") for column in columns)) for key, own in cells.items()]
    headings = [column if column == ALONE else code(column) for column in columns]
    return Table(("reading", "digits", *headings), "lr" + "r" * len(headings), lines)


def scatter(rows: Sequence[RunRow]) -> dict[str, int]:
    """How many times of a reading there are, how many scatter by more than a tenth, and how many have no range."""
    timed = [row for row in rows if row.wall_s is not None]
    return {
        "times": len(timed),
        "wide": sum(number(row.wall_s_iqr) > 0.1 * number(row.wall_s) for row in timed),
        "few": sum(row.wall_s_iqr is None for row in timed),
    }


def draw_ladder(rows: Sequence[RunRow], count: str) -> Figure:
    """Worst error of a transition's time against a cost, one line a solver, for one reading.

    Times have bars, the 95 % intervals of the medians.
    """
    is_time = count == "wall_s"
    ladders = by_solver(row for row in right(rows) if row.max_time_error_s is not None and getattr(row, count))
    lines = style.lines_of(by_solver(right(rows)))
    tips = {}
    with style.figure(4.4) as figure:
        axes = figure.add_axes((0.1, 0.12, 0.645, 0.8))
        axes.set(xscale="log", yscale="log")
        for solver, ladder in ladders.items():
            errors = [max(number(row.max_time_error_s), 1e-16) for row in ladder]
            points = [(getattr(row, count), error) for row, error in zip(ladder, errors, strict=True)]
            draw_line(axes, lines[solver], points, "", ms=3.5)
            if is_time:
                low, high = ([number(getattr(row, end)) for row in ladder] for end in ("wall_s_low", "wall_s_high"))
                axes.hlines(errors, low, high, color=lines[solver].colour, lw=0.8)
            tips[solver] = min(errors)
        style.decades(axes.xaxis, style.time_text if is_time else style.power_of_ten)
        style.decades(axes.yaxis)
        ordered = sorted(tips, key=lambda solver: -tips[solver])
        label_column(axes, [(solver, lines[solver]) for solver in ordered], x=1.045, gap=0.05)
        if is_time:
            axes.plot([], [], color=style.GREY, lw=0.8, label="95 % interval of the median")
            axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), borderaxespad=0.2)
        axes.set(xlabel=COUNTS[count], ylabel="worst error of a transition time [s]")
        least = "; ".join(f"{solver} {tips[solver]:.1e} s" for solver in ordered)
        describe(
            figure,
            f"Accuracy against {'time' if is_time else count.replace('_', ' ')}",
            f"Across, {COUNTS[count]}; upward, the worst error of a transition time; both axes are logarithmic. "
            f"Least error of each solver: {least}.",
        )
    return figure
