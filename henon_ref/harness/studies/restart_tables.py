"""How often each library is right in each restart over the suite, as its page shows it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

from henon_ref.harness import registry
from henon_ref.harness.report.folder import REPORT
from henon_ref.harness.report.text.ranking import LEVELS
from henon_ref.harness.rows import NOT_RUN, Row, RunRow, earlier_rows
from henon_ref.harness.score.errors import EARLY
from henon_ref.harness.table import Table
from henon_ref.text import code, markdown

FOLDER = "restarts"
"""Where the page on restarts lies in a folder of reports."""
SUITE = "suite.csv"
MOST = LEVELS[-1]
"""Digits that are counted: more are rounding."""
QUICKER = 0.8
"""Of as many right runs with as many digits those are better that take less than this part of the time: what the
machine does meanwhile changes times by less."""
Ending = Literal["right", "wrong", "ended_early", "failed"]
ENDINGS = get_args(Ending)
"""How a run may end: with the exact run's transitions, with others, before its time, or not at all."""
WHY = {
    "event-free-step": "what happens within the event-free step is seen at its end, and a guard that stays at zero "
    "behind it is watched with its rounding",
    "offset": "the next root comes late by the lift over the guard's rate, and one that the lift covers does not come",
    "direction": "a guard that starts one rounding below zero hides the first root of the first step",
    "none": "the root at the start is an event again",
}
"""What a restart gets wrong where another one does not."""


@dataclass(frozen=True)
class SuiteRow(Row):
    """A library and restart on a case, over its readings and tolerances."""

    case: str
    solver: str
    restart: str
    runs: int
    """Those that were made; then how many ended in each way (:data:`ENDINGS`)."""
    right: int
    wrong: int
    ended_early: int
    failed: int
    missed: int
    """Transitions, in all runs."""
    spurious: int
    elsewhere: int
    """Runs that are not right though another restart of the library is, on the same reading and tolerance."""
    digits: float
    """Of the right runs, each counted up to MOST, in all."""
    wall_s: float
    """Of the right runs, in all [s]."""


@dataclass(frozen=True)
class Merit:
    """What the runs of one restart come to; a greater one is better."""

    right: int
    digits: float
    wall_s: float

    def beats(self, other: Merit) -> bool:
        """Whether it is right more often; else, as often, to more digits; else to as many in clearly less time."""
        if self.right != other.right:
            return self.right > other.right
        if round(self.digits) != round(other.digits):
            return self.digits > other.digits
        return self.wall_s < QUICKER * other.wall_s


def suite_rows(runs: Iterable[RunRow]) -> list[SuiteRow]:
    """Rows of the suite from rows of runs, whose solvers are named with their restarts."""
    own: dict[tuple[str, str, str], list[RunRow]] = {}
    solved: dict[tuple[object, ...], set[str]] = {}
    for row in runs:
        if row.status not in NOT_RUN:
            key = row.case, registry.base_name(row.solver), registry.restart_of(row.solver)
            own.setdefault(key, []).append(row)
            if row.verdict == "right":
                solved.setdefault(_problem(row), set()).add(row.solver)
    found = []
    for (case, library, restart), rows in own.items():
        right = [row for row in rows if row.verdict == "right"]
        ends = Counter(map(ending, rows))
        elsewhere = [bool(solved.get(_problem(row), set()) - {row.solver}) for row in rows if row.verdict != "right"]
        found.append(
            SuiteRow(
                case,
                library,
                restart,
                len(rows),
                right=ends["right"],
                wrong=ends["wrong"],
                ended_early=ends["ended_early"],
                failed=ends["failed"],
                missed=sum(row.missed or 0 for row in rows),
                spurious=sum(row.spurious or 0 for row in rows),
                elsewhere=sum(elsewhere),
                digits=round(sum(min(row.digits, MOST) for row in right if row.digits is not None), 2),
                wall_s=float(f"{sum(row.wall_s or 0.0 for row in right):.4g}"),
            )
        )
    return found


def _problem(row: RunRow) -> tuple[object, ...]:
    """What a library is to solve: reading and tolerance."""
    return row.case, row.reading, row.rtol, registry.base_name(row.solver)


def ending(row: RunRow) -> Ending:
    """How a run that was made ended."""
    if row.verdict == "right":
        return "right"
    if row.status in ("failed", "timeout") or row.missed is None:
        return "failed"
    return "ended_early" if row.status in EARLY else "wrong"


def merged(fresh: Sequence[SuiteRow], earlier: Sequence[SuiteRow]) -> list[SuiteRow]:
    """Fresh rows and, of cases and libraries that have none, earlier ones, by case and library.

    So that the study of a library that takes long can be made case by case.
    """
    present = {(row.case, row.solver) for row in fresh}
    rows = [*fresh, *(row for row in earlier if (row.case, row.solver) not in present)]
    order = {solver: place for place, solver in enumerate(registry.names())}
    return sorted(rows, key=lambda row: (row.case, order.get(row.solver, len(order))))


def read_suite(folder: Path) -> list[SuiteRow]:
    """The suite's rows in a folder of reports; none where they are not there, or are no such rows."""
    return earlier_rows(SuiteRow, folder / FOLDER / SUITE)


def libraries_of(rows: Sequence[SuiteRow]) -> list[str]:
    """Libraries of some rows, with or without their restarts, in the registry's order."""
    present = {registry.base_name(row.solver) for row in rows}
    return [library for library in registry.names() if library in present]


def merits(rows: Sequence[SuiteRow], library: str) -> dict[str, Merit]:
    """What each restart of a library comes to over some rows of the suite, the default first."""
    found = {}
    for restart in sorted(registry.RESTARTS, key=lambda restart: restart != registry.restart_of(library)):
        own = [row for row in rows if (row.solver, row.restart) == (library, restart)]
        if own:
            digits, wall = sum(row.digits for row in own), sum(row.wall_s for row in own)
            found[restart] = Merit(sum(row.right for row in own), digits, wall)
    return found


def best_restart(found: dict[str, Merit]) -> str:
    """The first restart that no other one beats."""
    return next(restart for restart, own in found.items() if not any(one.beats(own) for one in found.values()))


def wrong_defaults(rows: Sequence[SuiteRow]) -> list[str]:
    """A sentence for each library whose default is beaten over the suite by another of its restarts."""
    found = []
    for library in libraries_of(rows):
        own, default = merits(rows, library), registry.restart_of(library)
        better = [restart for restart, merit in own.items() if default not in own or merit.beats(own[default])]
        if better:
            best = best_restart(own)
            found.append(
                f"{library}: its default is {default or 'none at all'} ({_said(own.get(default))}), "
                f"better is {best} ({_said(own[best])})"
            )
    return found


def _said(merit: Merit | None) -> str:
    return "not run" if merit is None else f"right in {merit.right}, {merit.digits:.1f} digits, {merit.wall_s:.3g} s"


def beaten_table(rows: Sequence[SuiteRow], reports: str = "") -> Table:
    """Cases in which another restart is right more often than a library's default: both side by side.

    Parameters
    ----------
    rows : sequence of SuiteRow
        Of the suite.
    reports : str
        The folder of the reports, as links have it.
    """
    cases: dict[str, list[SuiteRow]] = {}
    for row in rows:
        cases.setdefault(row.case, []).append(row)
    lines = []
    for case, own in cases.items():
        groups: dict[tuple[str, ...], list[str]] = {}
        for library in libraries_of(own):
            if cells := _beaten(own, library):
                groups.setdefault(cells, []).append(library)
        link = f"[{markdown(case)}]({reports}{case}/{REPORT})"
        lines += [(link, ", ".join(map(code, libraries)), *cells) for cells, libraries in groups.items()]
    headings = ("case", "library", "default", "right", "best", "right", "what goes wrong by default")
    return Table(headings, "lllrlrl", lines)


def _beaten(rows: Sequence[SuiteRow], library: str) -> tuple[str, ...] | None:
    """Default and best in one case, where they differ in how many runs they get right."""
    found, default = merits(rows, library), registry.restart_of(library)
    if default not in found:
        return None
    most = max(merit.right for merit in found.values())
    if found[default].right == most:
        return None
    best = [restart for restart, merit in found.items() if merit.right == most]
    mine = next(row for row in rows if (row.solver, row.restart) == (library, default))
    runs = f" of {mine.runs}"
    right = f"{found[default].right}{runs}", f"{most}{runs}"
    return code(default), right[0], ", ".join(map(code, best)), right[1], _wrong(mine)


def _wrong(row: SuiteRow) -> str:
    """What goes wrong in the runs of a row of the suite."""
    what = (*ENDINGS[1:], "missed", "spurious")
    counts = zip(what, row.values(what), strict=True)
    return ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in counts if count)
