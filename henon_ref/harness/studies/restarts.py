"""Study of restarts: each library with each restart over the suite, and with options of its event location."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, TypeVar, get_args

from henon_ref.baselines.adapter import Adapter
from henon_ref.baselines.heyoka_taylor import HEYOKA
from henon_ref.baselines.scipy_ivp import BDF, DOP853, LSODA, RADAU, RK45
from henon_ref.casefile.case import Case
from henon_ref.grouping import grouped
from henon_ref.harness import registry
from henon_ref.harness.report.folder import RUNS
from henon_ref.harness.result_files import earlier_rows, rows_text
from henon_ref.harness.rows import NOT_RUN, Row, RunRow
from henon_ref.harness.score.ranking import LEVELS
from henon_ref.harness.score.scoring import EARLY
from henon_ref.harness.studies.page import report_link, rows_of, write
from henon_ref.harness.studies.study import StudyRequest, StudyResult
from henon_ref.harness.table import Table, duration
from henon_ref.harness.truth.compute import stored_truth
from henon_ref.text import code

SUITE, OPTIONS = "suite.csv", "options.csv"
MAX_DIGITS = LEVELS[-1]
"""Largest number of digits that counts; more digits are rounding."""
QUICKER = 0.8
"""At equal right runs and digits, a restart is better if it takes less than this part of the time. Other work on the
machine changes times by less."""
Ending = Literal["right", "wrong", "ended_early", "failed"]
ENDINGS = get_args(Ending)
"""Kinds of a run's end: transitions of the exact run, other transitions, before the horizon, or failed."""
COUNTED = (*ENDINGS, "missed", "spurious", "elsewhere")


@dataclass(frozen=True)
class SuiteRow(Row):
    """Results of a library with a restart on a case, summed over its readings and tolerances."""

    case: str
    solver: str
    restart: str
    runs: int
    """Number of runs; the next four fields are the numbers of each kind of end (:data:`ENDINGS`)."""
    right: int
    wrong: int
    ended_early: int
    failed: int
    missed: int
    """Missed transitions of all runs."""
    spurious: int
    elsewhere: int
    """Runs that are not right although the run with another restart is, on the same reading and tolerance."""
    digits: float
    """Sum of the digits of the right runs, each at most MAX_DIGITS."""
    wall_s: float
    """Sum of the times of the right runs [s]."""


@dataclass(frozen=True)
class OptionRow(Row):
    """Results of a library without and with an option."""

    solver: str
    option: str
    runs: int
    """Number of runs that were made both without and with the option."""
    right_without: int
    right_with: int
    without_alone: int
    """Runs that are right only without the option."""
    with_alone: int
    digits_without: float
    """Sum of the digits, over the runs that are right both without and with the option."""
    digits_with: float


LibraryRow = TypeVar("LibraryRow", bound=SuiteRow | OptionRow)


@dataclass(frozen=True)
class Merit:
    """Result of all runs of one restart, for comparison."""

    right: int
    digits: float
    wall_s: float

    def __str__(self) -> str:
        return f"right in {self.right}, {self.digits:.0f} digits in all, {self.wall_s:.3g} s"

    def beats(self, other: Merit) -> bool:
        """Check whether this result is better: more right runs, or then more digits, or then clearly less time."""
        if self.right != other.right:
            return self.right > other.right
        if round(self.digits) != round(other.digits):
            return self.digits > other.digits
        return self.wall_s < QUICKER * other.wall_s


def run_restarts(request: StudyRequest) -> StudyResult:
    """Run the study on all readings with a stored truth, and write its page; the remarks name the beaten defaults.

    Earlier rows of other cases and libraries are kept, so that the study can be made case by case.
    """
    names = registry.expanded(request.options.solvers or registry.default_names())
    libraries = list(
        dict.fromkeys(registry.base_name(name) for name in names if isinstance(name, str) and registry.restart_of(name))
    )
    cases = [own for case in request.cases if (own := _with_truths(case, libraries)).readings]
    if not cases or not libraries:
        return StudyResult(None)
    ways = [registry.with_restart(library, way) for library in libraries for way in registry.RESTARTS]
    options = options_of(libraries)
    solvers: tuple[Any, ...] = (*ways, *(solver for *_, solver in options))
    changed = replace(request.options, solvers=solvers, timed=False, folder=request.folder)
    every = rows_of(cases, changed, request.observer)
    rows = [row for row in every if row.solver in ways]
    suite = merged(suite_rows(rows), earlier_rows(SuiteRow, request.folder / SUITE))
    tried = merged(option_rows(options, every), earlier_rows(OptionRow, request.folder / OPTIONS))
    context = {
        "runs": f"{sum(row.runs for row in suite)}",
        "cases": len({row.case for row in suite}),
        "limit": f"{changed.timeout:g}",
        "summary": summary_table(suite).markdown,
        "most": MAX_DIGITS,
        "quicker": round(100 * (1 - QUICKER)),
        "defaults": default_table(suite).markdown,
        "beaten": beaten_table(suite).markdown,
        "options": option_table(tried).markdown if tried else "",
        "origin": request.origin,
    }
    files = {RUNS: rows_text(RunRow, rows), SUITE: rows_text(SuiteRow, suite)}
    files |= {OPTIONS: rows_text(OptionRow, tried)} if tried else {}
    return StudyResult(write(request.folder, "restarts", context, files), wrong_defaults(suite))


def _with_truths(case: Case, libraries: Sequence[str]) -> Case:
    """Return the case with its readings that have a stored truth and on which one of the libraries may run."""
    readings = [
        reading
        for reading in case.readings
        if (reading.solvers is None or set(libraries) & set(reading.solvers))
        and stored_truth(case, reading) is not None
    ]
    return replace(case, readings=tuple(readings))


def suite_rows(runs: Iterable[RunRow]) -> list[SuiteRow]:
    """Sum rows of runs, whose solver names include their restarts, to rows of the suite."""
    made = [row for row in runs if row.status not in NOT_RUN]
    solved = {_problem(row) for row in made if row.verdict == "right"}
    found = []
    for (case, solver), rows in grouped(made, lambda row: (row.case, row.solver)).items():
        right = [row for row in rows if row.verdict == "right"]
        ends = Counter(map(ending, rows))
        found.append(
            SuiteRow(
                case,
                registry.base_name(solver),
                registry.restart_of(solver),
                runs=len(rows),
                **{end: ends[end] for end in ENDINGS},
                missed=sum(row.missed or 0 for row in rows),
                spurious=sum(row.spurious or 0 for row in rows),
                elsewhere=sum(row.verdict != "right" and _problem(row) in solved for row in rows),
                digits=round(sum(min(row.digits, MAX_DIGITS) for row in right if row.digits is not None), 2),
                wall_s=float(f"{sum(row.wall_s or 0.0 for row in right):.4g}"),
            )
        )
    return found


def _problem(row: RunRow) -> tuple[object, ...]:
    """Key of the problem that a row's library solves: reading and tolerance."""
    return row.case, row.reading, row.rtol, registry.base_name(row.solver)


def ending(row: RunRow) -> Ending:
    """Kind of the end of a run."""
    if row.verdict == "right":
        return "right"
    if row.status in ("failed", "timeout") or row.missed is None:
        return "failed"
    return "ended_early" if row.status in EARLY else "wrong"


def merged(fresh: Sequence[LibraryRow], earlier: Sequence[LibraryRow]) -> list[LibraryRow]:
    """Fresh rows, and earlier rows of cases and libraries without fresh ones, sorted by case and library."""

    def key(row: SuiteRow | OptionRow) -> tuple[str, str]:
        return getattr(row, "case", ""), row.solver  # the row of an option is for all cases

    present = set(map(key, fresh))
    rows = [*fresh, *(row for row in earlier if key(row) not in present)]
    libraries = libraries_of(rows)
    return sorted(rows, key=lambda row: (key(row)[0], libraries.index(row.solver)))


def libraries_of(rows: Iterable[SuiteRow | OptionRow]) -> list[str]:
    """Libraries of the rows, in the registry's order."""
    return registry.in_order(row.solver for row in rows)


def merits(rows: Sequence[SuiteRow], library: str) -> dict[str, Merit]:
    """Result of each restart of a library over the rows of the suite, the default first."""
    found = {}
    for restart in sorted(registry.RESTARTS, key=lambda restart: restart != registry.restart_of(library)):
        own = [row for row in rows if (row.solver, row.restart) == (library, restart)]
        if own:
            digits, wall = sum(row.digits for row in own), sum(row.wall_s for row in own)
            found[restart] = Merit(sum(row.right for row in own), digits, wall)
    return found


def best_restart(found: dict[str, Merit]) -> str:
    """First restart that no other restart beats."""
    return next(restart for restart, own in found.items() if not any(one.beats(own) for one in found.values()))


def wrong_defaults(rows: Sequence[SuiteRow]) -> list[str]:
    """One sentence for each library whose default is beaten over the suite by another restart."""
    found = []
    for library in libraries_of(rows):
        own, default = merits(rows, library), registry.restart_of(library)
        if (best := best_restart(own)) != default:
            words = f"{library}: its default is {default} ({own.get(default, 'not run')}), "
            found.append(f"{words}better is {best} ({own[best]})")
    return found


def summary_table(suite: Sequence[SuiteRow]) -> Table:
    """Table of each library and restart: runs by their kind of end, and missed and spurious transitions.

    The last column counts the runs that are not right although another restart of the library is.
    """
    lines = []
    for library in libraries_of(suite):
        for restart in registry.RESTARTS:
            own = [row for row in suite if (row.solver, row.restart) == (library, restart)]
            label = f"**{code(restart)}**" if restart == registry.restart_of(library) else code(restart)
            counts = (sum(getattr(row, name) for row in own) for name in COUNTED)
            lines.append((code(library), label, *(f"{n or ''}" for n in counts)))
    ends = (end.replace("_", " ") for end in ENDINGS)
    headings = ("library", "restart", *ends, "transitions missed", "spurious", "right by another restart")
    return Table(headings, "llr", lines)


def default_table(suite: Sequence[SuiteRow]) -> Table:
    """Table of each library's default and best other restart, with right runs, digits and time."""
    lines = []
    for library in libraries_of(suite):
        found, own = merits(suite, library), registry.restart_of(library)
        others = {restart: merit for restart, merit in found.items() if restart != own}
        if own in found and others:
            cells = [f"{len({row.case for row in suite if row.solver == library})}"]
            for restart in (own, best_restart(others)):
                merit = found[restart]
                cells += [code(restart), f"{merit.right}", f"{merit.digits:.0f}", duration(merit.wall_s)]
            lines.append((code(library), *cells))
    side = ("right", "digits", "time")
    return Table(("library", "cases", "default", *side, "best other", *side), "lrlrrrlrrr", lines)


def beaten_table(rows: Sequence[SuiteRow]) -> Table:
    """Table of the cases in which another restart is right more often than a library's default."""
    lines = []
    for case, own in grouped(rows, lambda row: row.case).items():
        groups: dict[tuple[str, ...], list[str]] = {}
        for library in libraries_of(own):
            if cells := _beaten(own, library):
                groups.setdefault(cells, []).append(library)
        own_link = report_link(case)
        lines += [(own_link, ", ".join(map(code, libraries)), *cells) for cells, libraries in groups.items()]
    headings = ("case", "library", "default", "right", "best", "right", "what goes wrong by default")
    return Table(headings, "lllrlrl", lines)


def _beaten(rows: Sequence[SuiteRow], library: str) -> tuple[str, ...] | None:
    """Cells on a library's default and best restart in one case; None if the default has as many right runs."""
    found, default = merits(rows, library), registry.restart_of(library)
    most = max(merit.right for merit in found.values())
    if default not in found or found[default].right == most:
        return None
    best = ", ".join(code(restart) for restart, merit in found.items() if merit.right == most)
    mine = next(row for row in rows if (row.solver, row.restart) == (library, default))
    names = (name for name in COUNTED[1:-1] if getattr(mine, name))
    wrong = ", ".join(f"{getattr(mine, name)} {name.replace('_', ' ')}" for name in names)
    return code(default), f"{mine.right} of {mine.runs}", best, f"{most} of {mine.runs}", wrong


def options_of(libraries: Sequence[str]) -> list[tuple[str, str, Adapter]]:
    """Options of the libraries' event location: name of the library, description, solver with the option.

    SUNDIALS has no such option except the direction, in which two of the restarts differ.
    """
    cooldown = replace(HEYOKA, name="heyoka (cooldown)", cooldown="automatic")
    found: list[tuple[str, str, Adapter]] = [("heyoka", "`cooldown`: heyoka's own", cooldown)]
    for own in (RK45, DOP853, RADAU, BDF, LSODA):
        # An absolute tolerance so small that only the relative one, 4 eps, has an effect.
        again = replace(own, name=f"{own.name} (root)", root_tolerance=1e-300)
        found.append((own.name, "the root located again, `xtol` 1e-300", again))
    return [option for option in found if option[0] in libraries]


def option_rows(options: Sequence[tuple[str, str, Adapter]], runs: Sequence[RunRow]) -> list[OptionRow]:
    """Compare the runs of each library with its default restart, without and with an option."""
    found = []
    for library, words, solver in options:
        default = registry.with_restart(library, registry.restart_of(library))
        without, with_it = (
            {(row.case, row.reading, row.rtol): row for row in runs if row.solver == name and row.status not in NOT_RUN}
            for name in (default, solver.name)
        )
        pairs = [(row, with_it[problem]) for problem, row in without.items() if problem in with_it]
        right = Counter((a.verdict == "right", b.verdict == "right") for a, b in pairs)
        both = [pair for pair in pairs if pair[0].verdict == pair[1].verdict == "right" and pair[0].digits is not None]
        found.append(
            OptionRow(
                solver=library,
                option=words,
                runs=len(pairs),
                right_without=right[True, True] + right[True, False],
                right_with=right[True, True] + right[False, True],
                without_alone=right[True, False],
                with_alone=right[False, True],
                digits_without=round(sum(min(a.digits or 0.0, MAX_DIGITS) for a, _ in both), 1),
                digits_with=round(sum(min(b.digits or 0.0, MAX_DIGITS) for _, b in both), 1),
            )
        )
    return found


def option_table(rows: Sequence[OptionRow]) -> Table:
    """Table of the options."""
    headings = (
        "library", "option", "runs", "right without", "right with", "right without alone", "right with alone",
        "digits where both are right, without", "with",
    )  # fmt: skip
    numbers = OptionRow.columns()[2:]
    lines = [(code(row.solver), row.option, *(f"{value:g}" for value in row.values(numbers))) for row in rows]
    return Table(headings, "llr", lines)
