"""The price list's tables, as rows of text."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from henon_ref.harness.report.text.paired_times import FIRST, SECOND, PairRow, bound
from henon_ref.harness.report.text.ranking import LEVELS, by_solver, reaching, readings_of
from henon_ref.harness.rows import RunRow, number
from henon_ref.harness.studies.price.compiling import AGAINST, Ready, paid_after
from henon_ref.harness.studies.price.effects import Step
from henon_ref.harness.studies.price.growth import Horizon
from henon_ref.harness.studies.price.ladder import TIMEOUT
from henon_ref.harness.studies.price.landings import Landed
from henon_ref.harness.studies.price.states import Size
from henon_ref.harness.table import Table, duration, error, significant

LISTED = (
    SECOND, "cvode-c-adams", "cvode-adams", "scipy-dop853", "diffrax-dopri8", "diffrax-kvaerno5", "diffsol-tsit45",
    "diffsol-bdf",
)  # fmt: skip
"""Rivals whose pairs are shown reading by reading, where they ran; those of all are in the file."""


def title(case: str, reading: str) -> str:
    """What a reading is called."""
    return case if reading == "default" else f"{case}, {reading}"


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


def ready_table(found: Sequence[Ready]) -> Table:
    """Preparation times, and the runs after which they are made up for."""
    lines: list[tuple[str, ...]] = []
    for own in found:
        others = {o.solver: o for o in found if (o.case, o.reading) == (own.case, own.reading)}
        paid = [
            f"{_runs(paid_after(own, others[rival], cold=True))} / {_runs(paid_after(own, others[rival], cold=False))}"
            f" against `{rival}`"
            for rival in AGAINST.get(own.solver, ())
            if rival in others
        ]
        lines.append(
            (
                title(own.case, own.reading),
                f"`{own.solver}`",
                duration(own.wall_s),
                duration(own.cold_s),
                duration(own.kept_s),
                "; ".join(paid),
            )
        )
    headings = (
        "reading", "solver", "a run", "ready, nothing on disk", "ready, code on disk",
        "paid for after runs (nothing on disk / code on disk)",
    )  # fmt: skip
    return Table(headings, "llrrrl", lines)


def _runs(runs: float) -> str:
    return "never" if math.isinf(runs) else significant(runs, 2)


def landing_table(found: Sequence[Landed]) -> Table:
    """Evaluations, time and error of the three landings, and the time with Hénon's over that with bracketing."""
    solvers = list(dict.fromkeys(one.solver for one in found))
    columns: tuple[Callable[[Landed], str], ...] = (
        lambda one: f"{one.evaluations:.1f}",
        lambda one: duration(one.wall_s),
        lambda one: "another sequence" if math.isnan(one.error_s) else error(one.error_s),
    )
    lines = []
    for case, reading in dict.fromkeys((own.case, own.reading) for own in found):
        own = {one.solver: one for one in found if (one.case, one.reading) == (case, reading)}
        cells = [column(own[solver]) for column in columns for solver in solvers]
        ratio = own[FIRST].to_bracketing
        note = "bracketing is quicker" if ratio > 1 else ""
        lines.append((title(case, reading), *cells, f"{ratio:.2f}", note))
    words = ("evaluations", "run", "error [s]")
    headings = (
        "reading",
        *(f"{word}, `{solver}`" for word in words for solver in solvers),
        "run over bracketing",
        "note",
    )
    return Table(headings, "l" + "r" * len(words) * len(solvers) + "rl", lines)


def effect_table(steps: Sequence[Step]) -> Table:
    """Operations and times of every effect, and of the scene with all others compiled in at zero."""
    headings = (
        "body", "effect added", "operations", "time a step", "more than before", "operations, all carried",
        "time a step, all carried", "run over one with all carried",
    )  # fmt: skip
    lines: list[tuple[str, ...]] = []
    for before, step in zip((None, *steps), steps, strict=False):
        more = before and before.body == step.body and step.effect
        lines.append(
            (
                step.body,
                step.effect or "*a motion that sticks*",
                f"{step.operations}",
                f"{1e9 * step.per_step_s:.0f} ns",
                f"{1e9 * (step.per_step_s - before.per_step_s):+.0f} ns" if before and more else "",
                "" if step.carried is None else f"{step.carried}",
                "" if step.carried_per_step_s is None else f"{1e9 * step.carried_per_step_s:.0f} ns",
                "" if step.to_carried is None else f"{step.to_carried:.2f}",
            )
        )
    return Table(headings, "llrrrrrr", lines)


def growth_table(found: Sequence[Horizon]) -> Table:
    """Cost, memory and accuracy over the horizon."""
    lines: list[tuple[str, ...]] = [
        (
            f"`{own.solver}`",
            f"{own.until:.0e} s",
            f"{own.transitions}",
            duration(own.wall_s),
            duration(own.per_transition_s),
            f"{own.grown:.1f} MiB",
            "not settled yet" if math.isnan(own.stick_error_s) else f"{error(own.stick_error_s)} s",
        )
        for own in found
    ]
    headings = (
        "solver", "horizon", "transitions", "wall time", "a transition", "growth of peak memory", "last sticks' error",
    )  # fmt: skip
    return Table(headings, "lrrrrrr", lines)


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
