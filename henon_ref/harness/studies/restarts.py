"""Study of restarts: each library with each restart over the suite, and with options of its event location."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, TypeVar, get_args

from henon_ref.casefile.case import Case
from henon_ref.harness import registry
from henon_ref.harness.campaign.jobs import stored_statement
from henon_ref.harness.report.folder import RUNS
from henon_ref.harness.result_files import earlier_rows, rows_text
from henon_ref.harness.rows import NOT_RUN, Row, RunRow
from henon_ref.harness.score.errors import EARLY
from henon_ref.harness.score.ranking import LEVELS
from henon_ref.harness.studies.location_options import OptionRow, option_rows, option_table, options_of
from henon_ref.harness.studies.page import report_link, rows_of, write
from henon_ref.harness.studies.study import StudyRequest, StudyResult
from henon_ref.harness.table import Table, duration
from henon_ref.text import code

SUITE, OPTIONS = "suite.csv", "options.csv"
MOST = LEVELS[-1]
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
    """Sum of the digits of the right runs, each at most MOST."""
    wall_s: float
    """Sum of the times of the right runs [s]."""


LibraryRow = TypeVar("LibraryRow", SuiteRow, OptionRow)


@dataclass(frozen=True)
class Merit:
    """Result of all runs of one restart, for comparison."""

    right: int
    digits: float
    wall_s: float

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
    every = [row for own in rows_of(cases, changed, request.observer).values() for row in own]
    rows = [row for row in every if row.solver in ways]
    suite = merged(suite_rows(rows), earlier_rows(SuiteRow, request.folder / SUITE))
    tried = option_rows(options, every)
    ran = {row.solver for row in tried}
    tried += [row for row in earlier_rows(OptionRow, request.folder / OPTIONS) if row.solver not in ran]
    tried = by_library(tried)
    context = {
        "runs": f"{sum(row.runs for row in suite)}",
        "cases": len({row.case for row in suite}),
        "limit": f"{changed.timeout:g}",
        "summary": summary_table(suite).markdown,
        "most": MOST,
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
        and (truth := stored_statement(case, reading)) is not None
        and truth.expected is not None
    ]
    return replace(case, readings=tuple(readings))


def suite_rows(runs: Iterable[RunRow]) -> list[SuiteRow]:
    """Sum rows of runs, whose solver names include their restarts, to rows of the suite."""
    own: dict[tuple[str, str, str], list[RunRow]] = {}
    solved: set[tuple[object, ...]] = set()
    for row in runs:
        if row.status not in NOT_RUN:
            key = row.case, registry.base_name(row.solver), registry.restart_of(row.solver)
            own.setdefault(key, []).append(row)
            if row.verdict == "right":
                solved.add(_problem(row))
    found = []
    for key, rows in own.items():
        right = [row for row in rows if row.verdict == "right"]
        ends = Counter(map(ending, rows))
        found.append(
            SuiteRow(
                *key,
                runs=len(rows),
                right=ends["right"],
                wrong=ends["wrong"],
                ended_early=ends["ended_early"],
                failed=ends["failed"],
                missed=sum(row.missed or 0 for row in rows),
                spurious=sum(row.spurious or 0 for row in rows),
                elsewhere=sum(row.verdict != "right" and _problem(row) in solved for row in rows),
                digits=round(sum(min(row.digits, MOST) for row in right if row.digits is not None), 2),
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


def merged(fresh: Sequence[SuiteRow], earlier: Sequence[SuiteRow]) -> list[SuiteRow]:
    """Fresh rows, and earlier rows of cases and libraries without fresh ones, sorted by case and library."""
    present = {(row.case, row.solver) for row in fresh}
    rows = [*fresh, *(row for row in earlier if (row.case, row.solver) not in present)]
    return sorted(by_library(rows), key=lambda row: row.case)


def libraries_of(rows: Iterable[SuiteRow | OptionRow]) -> list[str]:
    """Libraries of the rows, in the registry's order."""
    return registry.in_order(row.solver for row in rows)


def by_library(rows: Sequence[LibraryRow]) -> list[LibraryRow]:
    """Rows in the registry's order of their libraries."""
    libraries = libraries_of(rows)
    return sorted(rows, key=lambda row: libraries.index(row.solver))


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
            words = f"{library}: its default is {default} ({_described(own.get(default))}), "
            found.append(f"{words}better is {best} ({_described(own[best])})")
    return found


def _described(merit: Merit | None) -> str:
    return "not run" if merit is None else f"right in {merit.right}, {merit.digits:.1f} digits, {merit.wall_s:.3g} s"


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
    return Table(headings, "ll" + "r" * len(COUNTED), lines)


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
    cases: dict[str, list[SuiteRow]] = {}
    for row in rows:
        cases.setdefault(row.case, []).append(row)
    lines = []
    for case, own in cases.items():
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
