"""Which solver to take, in numbers, from the matrix of the committed reports (``reports/matrix.csv``)."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path

from henon_ref.harness import registry
from henon_ref.harness.report.choice import ANY, Reach, by_kind, commits, reaches, readings_for
from henon_ref.harness.report.folder import MANIFEST
from henon_ref.harness.report.matrix import MatrixRow, read_matrix
from henon_ref.harness.score.ranking import LEVELS, by_solver
from henon_ref.harness.table import Table, significant
from henon_ref.text import code

NUMBERS = "which_solver_in_numbers.md"
"""The page that has everything."""
REPORTS = Path(__file__).resolve().parents[2] / "reports"
IN_SHORT = 9
"""Digits of the short table."""
WITHOUT_TIMES = ("no transition",)
"""Kinds in which there is no transition to time: right or not is all that is told of them."""
MEANINGS: Mapping[str, str] = {
    "stick-slip": "One surface, which the motion enters or leaves by sliding: a block with dry friction.",
    "crossings": "One surface, which is only crossed: a relay, an elastic stop, a field that jumps.",
    "jumps": "The state jumps: an impact, a reset.",
    "several surfaces": "More than one surface: several contacts, friction and a stop, a chain of blocks.",
    "graze or close roots": "A surface is touched, or nearly so, or crossed twice within a short time.",
    "no transition": "The exact run has no transition, and none may be reported.",
    "ends early": "The exact run stops before its horizon: the solution is not unique, the model is no longer valid, "
    "or the state diverges.",
}


@cache
def _rows() -> list[MatrixRow]:
    return read_matrix(REPORTS)


def in_short() -> str:
    """A row a kind of case, a column a package: its best solver for nine digits of the worst transition time."""
    packages = list(dict.fromkeys(_package(row) for row in _rows()))
    lines = []
    for kind, rows in by_kind(_rows()).items():
        level = ANY if kind in WITHOUT_TIMES else IN_SHORT
        best = _fastest(rows, level)
        own = [_cell(reaches([row for row in rows if _package(row) == package], level), best) for package in packages]
        lines.append((f"[{kind}](#{_place(kind)})", f"{len(readings_for(rows, level))}", *own))
    headings = ("kind of case", "readings", *(f"best of {package}" for package in packages))
    return Table(headings, "lr" + "l" * len(packages), lines).markdown


def at_a_glance() -> str:
    """A row a kind with transitions to time: what it is, the solver for nine digits, and the best one elsewhere."""
    lines = []
    for kind, rows in by_kind(_rows()).items():
        best = _fastest(rows, IN_SHORT)
        if best is None or kind in WITHOUT_TIMES:
            continue
        own = next(_package(row) for row in rows if row.solver == best.solver)
        other = _fastest([row for row in rows if _package(row) != own], IN_SHORT)
        counted = len(readings_for(rows, IN_SHORT))
        name = f"**[{kind.capitalize()}]({NUMBERS}#{_place(kind)})**"
        reach = f"{len(best.walls)} of {counted}"
        elsewhere = "none" if other is None else f"{code(other.solver)} {_cell([other], best, named=False)}"
        lines.append((f"{name}: {_began(MEANINGS.get(kind, ''))}", f"{code(best.solver)} {reach}", elsewhere))
    headings = ("kind of case", "best solver, readings", "best of another package, readings (×time)")
    return Table(headings, "lll", lines).markdown


def _began(sentence: str) -> str:
    return sentence[:1].lower() + sentence[1:].rstrip(".")


def _place(kind: str) -> str:
    """Where the page has a kind's section."""
    return kind.replace(" ", "-")


def by_kind_of_case() -> str:
    """A section a kind: every solver, and in how many readings it gets how many digits at what cost."""
    return "\n\n".join(part for kind, rows in by_kind(_rows()).items() for part in _section(kind, rows))


def _section(kind: str, rows: Sequence[MatrixRow]) -> Iterator[str]:
    levels: dict[str, int | None] = {"right": ANY}
    if kind not in WITHOUT_TIMES:
        levels |= {f"{level} digits": level for level in LEVELS}
    yield f"### {kind.capitalize()}"
    timed = len(readings_for(rows, levels.get(f"{LEVELS[0]} digits", ANY)))
    words = "" if kind in WITHOUT_TIMES else f", {timed} of them with a timed transition"
    yield f"{MEANINGS.get(kind, '')} {len(readings_for(rows, ANY))} readings{words}.".strip()
    fastest = {level: _fastest(rows, level) for level in levels.values()}
    lines = [
        (
            code(solver),
            *(_cell(reaches(own, level), fastest[level], named=False) for level in levels.values()),
            f"{len(readings_for(own, ANY))}",
        )
        for solver, own in by_solver(rows).items()
    ]
    yield Table(("solver", *levels, "run on"), "l" + "r" * len(levels) + "r", lines).markdown


def _fastest(rows: Sequence[MatrixRow], level: int | None) -> Reach | None:
    """The solver to take: the fastest of those that get there in about the most readings."""
    return next(iter(reaches(rows, level)), None)


def _cell(found: Sequence[Reach], best: Reach | None, *, named: bool = True) -> str:
    """The solver, in how many readings it gets there, and how many times as long as the best one it takes."""
    if not found or best is None:
        return "none" if named else "0"
    first = found[0]
    words = f"{code(first.solver)} {len(first.walls)}" if named else f"{len(first.walls)}"
    times = first.against(best.walls)
    return words if times is None else f"{words} (×{significant(times, 2)})"


def origin() -> str:
    """A sentence: how many readings of how many cases, of which commits, on which machine."""
    rows = _rows()
    machines = {_machine(path) for path in REPORTS.glob(f"*/{MANIFEST}")}
    return (
        f"{len(readings_for(rows, ANY))} readings of {len({row.case for row in rows})} cases, by {commits(rows)}, "
        f"on {' and '.join(sorted(machines))}."
    )


def _package(row: MatrixRow) -> str:
    return registry.distribution(row.solver) or row.solver


def _machine(manifest: Path) -> str:
    own = json.loads(manifest.read_text(encoding="utf-8"))["machine"]
    return f"{own['processor']} ({own['cores']} cores), {own['python']}"
