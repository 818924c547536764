"""Every solver at every tolerance, 1e-3 to 1e-15; then the cheapest for so many digits in turn: rows and prices."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from henon_ref.casefile.case import Case
from henon_ref.harness import registry
from henon_ref.harness.campaign.options import Options
from henon_ref.harness.campaign.progress import Observer
from henon_ref.harness.report.text.ranking import LEVELS, by_solver, reaching, readings_of
from henon_ref.harness.rows import Row, RunRow, number
from henon_ref.harness.studies.paired_times.rows import FIRST, SECOND, PairRow, bound
from henon_ref.harness.studies.paired_times.timing import PairedTiming, TimedPair, pairs_of, time_pairs
from henon_ref.harness.studies.price.measure import title
from henon_ref.harness.studies.runs import rows_of
from henon_ref.harness.table import Table, duration, significant

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
    """Rows of the ladder on the cases' readings; tolerances and deadline are its own."""
    changed = replace(options, solvers=options.solvers or solvers(), tolerances=LADDER, timeout=TIMEOUT)
    by_case = rows_of([_without_listings(case) for case in cases], changed, observer)
    return [row for own in by_case.values() for row in own]


def _without_listings(case: Case) -> Case:
    """The readings that are not tied to a solver of their own (Listing 1 as printed)."""
    return replace(case, readings=tuple(reading for reading in case.readings if reading.solvers is None))


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


def whole_table(rows: Sequence[RunRow], pairs: Sequence[PairRow]) -> Table:
    """Solvers by their geometric mean cost over all readings, for every level."""
    means = {level: mean_costs(pairs, level) for level in LEVELS}
    solvers = list(by_solver(rows))
    solvers.sort(key=lambda solver: min(own.get(solver, math.inf) for own in means.values()))
    lines = []
    for solver in solvers:
        cells = [
            significant(own[solver], 2) if solver in own else f"*{why_not(rows, solver, level)}*"
            for level, own in means.items()
        ]
        lines.append((f"`{solver}`", *cells))
        if solver == SECOND and any(alone := [mean_own_cost(pairs, level) for level in LEVELS]):
            words = (significant(cost, 2) if cost else "" for cost in alone)
            lines.append((f"`{SECOND}`, its own calls alone", *words))
    return Table(("solver", *(f"{level} digits" for level in LEVELS)), "l" + "r" * len(LEVELS), lines)


def own_times(pairs: Sequence[PairRow]) -> str:
    """Geometric mean time of the reference's runs, for every level."""
    cells = []
    for level in LEVELS:
        times = {row.problem: row.wall_s for row in pairs if row.digits == level}
        if times:
            mean = math.exp(sum(math.log(time) for time in times.values()) / len(times))
            cells.append(f"{duration(mean)} for {level} digits")
    return ", ".join(cells)


def rival_table(found: Sequence[PairRow]) -> Table:
    """How many times as long as `henon` others take, for the same digits, reading by reading."""
    ran = {row.rival for row in found}
    listed = [SECOND, *(rival for rival in LISTED[1:] if rival in ran)]
    ratios: dict[tuple[str, str, str], dict[str, PairRow]] = {}
    for row in found:
        if row.rival in listed:
            key = (*row.problem, bound(row.digits))
            ratios.setdefault(key, {})[row.rival] = row
    lines = []
    for (case, reading, digits), own in ratios.items():
        cells = [_times_as_long(own[rival]) if rival in own else "" for rival in listed]
        ratio = own[SECOND].own_ratio() if SECOND in own else None
        alone = "" if ratio is None else significant(ratio, 2)
        lines.append((title(case, reading), digits, *cells[:1], alone, *cells[1:]))
    headings = [f"`{rival}`" for rival in listed]
    headings.insert(1, f"`{SECOND}`, its own calls alone")
    return Table(("reading", "digits", *headings), "lr" + "r" * len(headings), lines)


def _times_as_long(row: PairRow) -> str:
    """How many times as long as ``henon`` a solver takes, and the interval: a row has ``henon``'s time over its own."""
    times, low, high = (significant(1.0 / ratio, 2) for ratio in (row.ratio, row.ratio_high, row.ratio_low))
    return f"{times} ({low} to {high})"


def scatter(rows: Sequence[RunRow]) -> dict[str, int]:
    """How many times of a reading there are, how many scatter by more than a tenth, and how many have no range."""
    timed = [row for row in rows if row.wall_s is not None]
    return {
        "times": len(timed),
        "wide": sum(number(row.wall_s_iqr) > 0.1 * number(row.wall_s) for row in timed),
        "few": sum(row.wall_s_iqr is None for row in timed),
    }


def costs(found: Sequence[PairRow], reading: tuple[str, str], digits: int) -> dict[str, float]:
    """Each solver's time over that of ``henon``, for so many digits in one reading."""
    rows = [row for row in found if row.problem == reading and row.digits == digits]
    return {row.rival: 1.0 / row.ratio for row in rows} | ({FIRST: 1.0} if rows else {})


def mean_costs(found: Sequence[PairRow], digits: int) -> dict[str, float]:
    """Geometric mean of these over all readings that another solver gets to so many digits, too.

    Solvers that do not get there in every one are left out.
    """
    readings = dict.fromkeys(row.problem for row in found if row.digits == digits)
    each = [costs(found, reading, digits) for reading in readings]
    common = [solver for solver in dict.fromkeys(s for own in each for s in own) if all(solver in own for own in each)]
    return {solver: math.exp(sum(math.log(own[solver]) for own in each) / len(each)) for solver in common}


def mean_own_cost(found: Sequence[PairRow], digits: int) -> float | None:
    """The same mean for heyoka's own calls alone; None where they are not known in every reading of its mean."""
    own = [row.own_ratio() for row in found if (row.rival, row.digits) == (SECOND, digits)]
    known = [ratio for ratio in own if ratio]
    if not known or len(known) < len(own) or SECOND not in mean_costs(found, digits):
        return None
    return math.exp(sum(map(math.log, known)) / len(known))


def why_not(rows: Sequence[RunRow], solver: str, digits: int) -> str:
    """Why a solver has no mean cost for so many digits: what keeps it from them in the first reading where it fails."""
    for own in readings_of(rows).values():
        if reaching([row for row in own if row.solver != solver], digits):
            ladder = [row for row in own if row.solver == solver]
            if not reaching(ladder, digits):
                return _failure(ladder)
    return ""


def _failure(ladder: Sequence[RunRow]) -> str:
    ends = {"unsupported": "unsupported", "unavailable": "not installed"}
    if any(row.status == "timeout" for row in ladder):
        return f"over {TIMEOUT:g} s"
    return next((ends[row.status] for row in ladder if row.status in ends), "not reached")
