"""Rows as JUnit XML, as Jenkins (the schema of its xUnit plugin), GitLab and others read it: a test case a row."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

from henon_ref.errors import CaseError
from henon_ref.report.files.write import replace_file
from henon_ref.rows import RunRow, csv_field
from henon_ref.score.row_result import Kind, RowResult
from henon_ref.text import short_line

OUTPUT = (
    "status", "verdict", "verdict_basis", "cause", "digits", "max_time_error_s", "wall_s", "matched", "missed",
    "spurious",
)  # fmt: skip
"""Columns that a test case's output tells."""
_ELEMENTS: dict[Kind, str] = {"failure": "failure", "error": "error", "skipped": "skipped", "known": "skipped"}


def junit_xml(rows: Sequence[tuple[RunRow, RowResult]]) -> bytes:
    """Rows as JUnit XML: a test suite a case, a test case a row.

    ``classname`` is the case and the reading, ``name`` the solver and its setting, ``time`` the wall time of a run in
    seconds with three decimals, as the schema has it; in full it stands in ``system-out``. A failure that is expected
    is ``skipped``, and says so.
    """
    root = ElementTree.Element("testsuites", {"name": "henon_ref", **_counts(rows)})
    suites: dict[str, list[tuple[RunRow, RowResult]]] = {}
    for row, result in rows:
        suites.setdefault(row.case, []).append((row, result))
    for case, own in suites.items():
        skipped = sum(_ELEMENTS.get(result.kind) == "skipped" for _, result in own)
        names = {"name": short_line(case), "skipped": str(skipped)}
        suite = ElementTree.SubElement(root, "testsuite", names | _counts(own))
        for row, result in own:
            _test_case(suite, row, result)
    ElementTree.indent(root)
    written: bytes = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    return written + b"\n"


def _counts(rows: Sequence[tuple[RunRow, RowResult]]) -> dict[str, str]:
    kinds = Counter(_ELEMENTS.get(result.kind) for _, result in rows)
    return {
        "tests": str(len(rows)),
        "failures": str(kinds["failure"]),
        "errors": str(kinds["error"]),
        "time": f"{sum(_seconds(row) for row, _ in rows):.3f}",
    }


def _seconds(row: RunRow) -> float:
    return row.wall_s or 0.0


def _test_case(suite: ElementTree.Element, row: RunRow, result: RowResult) -> None:
    names = {
        "classname": short_line(f"{row.case}.{row.reading}"),
        "name": short_line(row.label),
        "time": f"{_seconds(row):.3f}",
    }
    case = ElementTree.SubElement(suite, "testcase", names)
    if result.kind != "passed":
        element, reason = _ELEMENTS[result.kind], short_line(result.reason)
        what = {"message": reason} if element == "skipped" else {"message": reason, "type": row.status}
        ElementTree.SubElement(case, element, what).text = reason
    known = zip(OUTPUT, row.values(OUTPUT), strict=True)
    told = [f"{column}: {short_line(csv_field(value))}" for column, value in known if value is not None]
    ElementTree.SubElement(case, "system-out").text = "\n".join(told)


def check_junit(path: Path, inputs: Sequence[Path]) -> None:
    """See that a file can be put there, without leaving anything; its folder is made where it is missing.

    Parameters
    ----------
    path : Path
    inputs : sequence of Path
        Files that are read; it is none of them.

    Raises
    ------
    CaseError
        Where it cannot.
    """
    if path.exists() and not path.is_file():
        raise CaseError(f"{path} is no regular file; --junit needs the name of a file to write")
    if path.resolve() in [other.resolve() for other in inputs]:
        raise CaseError(f"{path} is read; --junit needs the name of a file to write")
    waiting = path.resolve().with_name(f".{path.name}.try")
    made = [folder for folder in path.resolve().parents if not folder.exists()]
    try:
        path.resolve().parent.mkdir(parents=True, exist_ok=True)
        waiting.touch()
        waiting.unlink()
        for folder in made:
            folder.rmdir()
    except OSError as error:
        raise _unwritable(path, error) from error


def write_junit(path: Path, rows: Sequence[tuple[RunRow, RowResult]]) -> None:
    """Write the file, whole or not at all.

    Raises
    ------
    CaseError
        Where it cannot be written.
    """
    try:
        path.resolve().parent.mkdir(parents=True, exist_ok=True)
        replace_file(path.resolve(), junit_xml(rows))
    except OSError as error:
        raise _unwritable(path, error) from error


def _unwritable(path: Path, error: OSError) -> CaseError:
    return CaseError(f"cannot write {path}: {error.strerror or error}; --junit needs a file that can be written")
