"""The index of all reports in a folder: which solver to take, who is right where, and what else there is to read."""

from __future__ import annotations

import sys
from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path

from henon_ref.atomic_write import replace_file
from henon_ref.errors import CaseError
from henon_ref.harness.report.files.links import without_dead_links
from henon_ref.harness.report.files.svg import svg
from henon_ref.harness.report.files.write import INDEX, MANIFEST, MATRIX, MATRIX_PAGE, REPORT, RUNS, check_index
from henon_ref.harness.report.text.choice import case_table, choice_table
from henon_ref.harness.report.text.formats import count
from henon_ref.harness.report.text.kinds_figure import draw_kinds
from henon_ref.harness.report.text.markdown import environment
from henon_ref.harness.report.text.matrix import KEY, coverage_table, reading_table, solver_table, solvers_of, titles
from henon_ref.harness.report.text.matrix_rows import MatrixRow, case_readings, read_matrix, rows_of_report
from henon_ref.harness.report.text.paired_times import PRICE_PAIRS, cheapest, own_words, read_ratios
from henon_ref.harness.report.text.restarts import WHY, beaten_table, read_suite
from henon_ref.harness.rows import NOT_RUN, rows_text
from henon_ref.harness.score.kinds import CLOSE
from henon_ref.text import code, message

PAGES = {
    "price": "[Price list](price/README.md): what accuracy costs in time, from one transition to a million seconds",
    "rivals": "[Times in turn](rivals/README.md): `henon` against heyoka and whichever other solver is the cheapest",
    "atlas": "[Atlas](atlas/README.md): tolerance against distance from a graze, or between two roots of one step",
    "restarts": "[How libraries are restarted](restarts/README.md) after an event: each way over all cases",
    "causes": "[Causes](causes/README.md): what the libraries do by themselves, each shown by the library alone",
    "paper": "[The paper](paper/README.md): every number and equation of the paper, computed again",
}
"""Folders of the further pages, and how the index leads to them."""
FIGURE = "kinds.svg"
RIGHT_OF_JUDGED = (
    "*Right of judged*: solvers right in every reading that they are judged in, at one setting at least, of all "
    "solvers judged. *Best digits*: the most that one of them gets in all readings. *Cheapest*: least time for all "
    "readings, digits aside."
)
"""What the table of cases shows."""
FEWEST_DRAWN = 4
"""Cases from which on the index has a figure: of fewer the tables say it all."""


def write_index(folder: Path) -> Path:
    """Write the index of all reports in a folder, its matrix (CSV and page) and its figure.

    The matrix keeps its rows of solvers and cases that no report there has (:func:`.matrix_merge.merged`).

    Raises
    ------
    CaseError
        Where it would replace a file of somebody else's.
    """
    check_index(folder)
    rows = merged(folder)
    replace_file(folder / MATRIX, rows_text(MatrixRow, rows).encode())
    replace_file(folder / MATRIX_PAGE, matrix_text(rows, folder).encode())
    if is_drawn(rows):
        replace_file(folder / FIGURE, svg(draw_kinds(rows)))
    replace_file(folder / INDEX, index_text(rows, folder).encode())
    return folder / INDEX


def is_drawn(rows: Sequence[MatrixRow]) -> bool:
    """Whether there are enough cases for a figure, and some run in one."""
    return len({row.case for row in rows}) >= FEWEST_DRAWN and any(row.judged for row in rows)


def index_text(rows: Sequence[MatrixRow], folder: Path) -> str:
    """The index as markdown.

    Parameters
    ----------
    rows : sequence of MatrixRow
        Of the matrix.
    folder : Path
        Where it lies: links lead only to what is there.
    """
    suite = read_suite(folder)
    beaten, coverage = beaten_table(suite), coverage_table(rows)
    text = (
        environment()
        .get_template("index.md.j2")
        .render(
            restarts=beaten.markdown if beaten.rows else "",
            why={
                restart: words for restart, words in WHY.items() if any(f"`{restart}`" in row[2] for row in beaten.rows)
            },
            choice=choice_table(rows).markdown,
            coverage=coverage.markdown if coverage.rows else "",
            own=own_words(read_ratios(folder)) or own_words(read_ratios(folder, PRICE_PAIRS)),
            figure=FIGURE if is_drawn(rows) else "",
            cases=case_table([row for row in rows if (folder / row.case / REPORT).exists()]).markdown,
            right_of_judged=RIGHT_OF_JUDGED,
            counted=counted(rows),
            commits=commits(rows),
            mean_parts=round(1 / CLOSE),
            pages=[words for page, words in PAGES.items() if (folder / page / INDEX).exists()],
        )
    )
    return without_dead_links(text, folder)


def matrix_text(rows: Sequence[MatrixRow], folder: Path) -> str:
    """The matrix's page as markdown; parameters as for :func:`index_text`."""
    text = (
        environment()
        .get_template("matrix.md.j2")
        .render(
            key=KEY,
            matrix=reading_table(rows).markdown,
            solvers=solver_table(rows, cheapest(read_ratios(folder))).markdown,
            cases=case_table(rows).markdown,
            right_of_judged=RIGHT_OF_JUDGED,
            titles=titles(rows),
        )
    )
    return without_dead_links(text, folder)


def counted(rows: Sequence[MatrixRow]) -> str:
    """In how many readings the solver that is right most often is so, and why it is not judged in the others."""
    readings = {row.problem for row in rows}
    right: dict[str, set[tuple[str, str]]] = {}
    for row in rows:
        if row.right:
            right.setdefault(row.solver, set()).add(row.problem)
    if not right:
        return f"No solver is right in any of {count(len(readings), 'reading')}."
    first = max(right, key=lambda solver: len(right[solver]))
    own = {row.problem: row for row in rows if row.solver == first}
    judged = {key for key, row in own.items() if row.judged}
    left = {
        "run only by other solvers": readings - set(own),
        "that it cannot do": {key for key, row in own.items() if row.status in NOT_RUN},
    }
    left["without a verdict"] = set(own) - judged - left["that it cannot do"]
    why = ", ".join(f"{len(keys)} {words}" for words, keys in left.items() if keys)
    tail = f"; of all {len(readings)} that leaves {why}" if why else ""
    return f"{code(first)} is right in {len(right[first])} of the {len(judged)} readings that it is judged in{tail}."


def commits(rows: Sequence[MatrixRow]) -> str:
    """How many commits of the program the rows mix."""
    made = {row.commit or "" for row in rows}
    known = len(made - {""})
    return f"{count(known, 'commit')} of the program" if known else "a program of no known commit"


def merged(folder: Path) -> list[MatrixRow]:
    """The matrix's rows by case, reading and solver: of the reports in a folder, and earlier ones of its matrix.

    An earlier row stays where the case has no report there, and where the report's comparison did not run the solver.
    A report that cannot be read is named, and left out.

    Raises
    ------
    CaseError
        Where the matrix is not what this package writes.
    """
    cases: dict[str, list[MatrixRow]] = {}
    for row in read_matrix(folder):
        cases.setdefault(row.case, []).append(row)
    for manifest in sorted(folder.glob(f"*/{MANIFEST}")):
        if manifest.with_name(RUNS).exists():
            try:
                fresh, readings = rows_of_report(manifest), case_readings(manifest)
            except CaseError as error:
                print(message(f"left out of the index: {error}"), file=sys.stderr)
                continue
            case = manifest.parent.name
            cases[case] = updated(cases.get(case, []), fresh, readings)
    return [row for case in sorted(cases) for row in cases[case]]


def updated(earlier: Sequence[MatrixRow], fresh: Sequence[MatrixRow], readings: Collection[str]) -> list[MatrixRow]:
    """The rows of one case after a comparison of some of its solvers.

    Parameters
    ----------
    earlier, fresh : sequence of MatrixRow
        Of the matrix; title and kind of the fresh ones hold for all.
    readings : collection of str
        Those that the case has now; earlier rows of others go.
    """
    ran = {(row.reading, row.solver) for row in fresh}
    rows = [*fresh, *(row for row in earlier if (row.reading, row.solver) not in ran and row.reading in readings)]
    kinds = {row.problem: row.kind for row in (*earlier, *fresh) if row.kind}
    titles = [row.title for row in fresh][:1]
    rows = [replace(row, kind=kinds.get(row.problem), title=titles[0] if titles else row.title) for row in rows]
    places, solvers = {reading: k for k, reading in enumerate(readings)}, solvers_of(rows)
    return sorted(rows, key=lambda row: (places.get(row.reading, len(places)), solvers.index(row.solver)))
