"""What a CI is told of rows: JUnit XML, a test case a row, and a section of the page that GitHub shows for a step."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from xml.etree import ElementTree

from henon_ref.harness.report.text.formats import digits, setting
from henon_ref.harness.report.text.ranking import by_solver, right
from henon_ref.harness.rows import RunRow, csv_field
from henon_ref.harness.score.row_result import Kind, RowResult
from henon_ref.harness.table import Table
from henon_ref.text import code, markdown, short_line

OUTPUT = (
    "status", "verdict", "verdict_basis", "cause", "digits", "max_time_error_s", "wall_s", "matched", "missed",
    "spurious",
)  # fmt: skip
"""Columns that a test case's output tells."""
_ELEMENTS: dict[Kind, str] = {"failure": "failure", "error": "error", "skipped": "skipped", "known": "skipped"}
MOST_ROWS = 50
"""Rows that are shown one by one on GitHub's page, which may not be longer than a mebibyte."""
Results = Sequence[tuple[RunRow, RowResult]]


def junit_xml(results: Results) -> bytes:
    """Rows as JUnit XML, as Jenkins (the schema of its xUnit plugin), GitLab and others read it: a suite a case.

    ``classname`` is the case and the reading, ``name`` the solver and its setting, ``time`` the wall time of a run in
    seconds with three decimals, as the schema has it; in full it stands in ``system-out``. A failure that is expected
    is ``skipped``, and says so.
    """
    root = ElementTree.Element("testsuites", {"name": "henon_ref", **_counts(results)})
    for case in dict.fromkeys(row.case for row, _ in results):
        own = [(row, result) for row, result in results if row.case == case]
        skipped = sum(_ELEMENTS.get(result.kind) == "skipped" for _, result in own)
        suite = ElementTree.SubElement(
            root, "testsuite", {"name": short_line(case), "skipped": str(skipped)} | _counts(own)
        )
        for row, result in own:
            _test_case(suite, row, result)
    ElementTree.indent(root)
    written: bytes = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    return written + b"\n"


def _counts(results: Results) -> dict[str, str]:
    kinds = Counter(_ELEMENTS.get(result.kind) for _, result in results)
    return {
        "tests": str(len(results)),
        "failures": str(kinds["failure"]),
        "errors": str(kinds["error"]),
        "time": f"{sum(row.wall_s or 0.0 for row, _ in results):.3f}",
    }


def _test_case(suite: ElementTree.Element, row: RunRow, result: RowResult) -> None:
    names = {
        "classname": short_line(f"{row.case}.{row.reading}"),
        "name": short_line(row.label),
        "time": f"{row.wall_s or 0.0:.3f}",
    }
    case = ElementTree.SubElement(suite, "testcase", names)
    if result.kind != "passed":
        element, reason = _ELEMENTS[result.kind], short_line(result.reason)
        what = {"message": reason} if element == "skipped" else {"message": reason, "type": row.status}
        ElementTree.SubElement(case, element, what).text = reason
    known = zip(OUTPUT, row.values(OUTPUT), strict=True)
    told = [f"{column}: {short_line(csv_field(value))}" for column, value in known if value is not None]
    ElementTree.SubElement(case, "system-out").text = "\n".join(told)


def step_summary(rows: Results, lines: Sequence[str]) -> str:
    """A table of the solvers, one of the rows that fail, and what else was told, as markdown.

    Parameters
    ----------
    rows : sequence of (RunRow, RowResult)
    lines : sequence of str
        Messages of the command: what is not met, what got worse, what is expected or mended.
    """
    failing = [(row, result) for row, result in rows if result.kind in ("failure", "error")]
    parts = ["## henon_ref", _solvers(rows).markdown]
    if failing:
        parts += ["### Failures", _failures(failing[:MOST_ROWS]).markdown]
    if len(failing) > MOST_ROWS:
        parts.append(f"{len(failing) - MOST_ROWS} more are in `runs.csv`.")
    if lines:
        told = [f"- {markdown(line)}" for line in lines[:MOST_ROWS]]
        parts.append("\n".join([*told, *([f"- and {len(lines) - MOST_ROWS} more"] if len(lines) > MOST_ROWS else [])]))
    return "\n\n".join(parts) + "\n"


def _solvers(rows: Results) -> Table:
    results = {row.key: result.kind for row, result in rows}
    table = []
    for solver, own in by_solver([row for row, _ in rows]).items():
        kinds = Counter(results[row.key] for row in own)
        best = max((row.digits for row in right(own) if row.digits is not None), default=None)
        counts = (kinds["passed"], kinds["failure"] + kinds["error"], kinds["known"], kinds["skipped"])
        table.append((code(solver), *map(str, counts), "" if best is None else digits(best)))
    headings = ("solver", "right", "fail", "fail as expected", "not run or not decidable", "most digits")
    return Table(headings, "lrrrrr", table)


def _failures(rows: Results) -> Table:
    cells = [
        (
            code(row.case),
            code(row.reading),
            code(row.solver),
            setting(row.rtol, row.step_s),
            markdown(result.reason),
        )
        for row, result in rows
    ]
    return Table(("case", "reading", "solver", "setting", "reason"), "lllrl", cells)
