"""Results of a gate as text: in a report, on a terminal, and for CI (JUnit XML, summary of a GitHub step)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from xml.etree import ElementTree

from henon_ref.grouping import grouped
from henon_ref.harness.result_files import csv_field
from henon_ref.harness.rows import RunRow, number
from henon_ref.harness.score.gate import Demand, Gate, RowKind
from henon_ref.harness.score.ranking import right
from henon_ref.harness.table import Table, digits, listing, setting
from henon_ref.text import code, markdown, short_line


def gate_table(gate: Gate) -> Table | None:
    """Make the table of a gate: state, number of checked bounds, violated bounds, and bounds not checked."""
    if not gate.total:
        return None
    state = "not met" if gate.unmet else "met" if gate.checked else "not checked"
    not_met = "; ".join(markdown(words) for _, words in gate.unmet)
    left_out = ", ".join(_name(code(solver), rtol) for solver, rtol in gate.left_out)
    row = (state, f"{gate.checked} of {gate.total}", not_met, left_out)
    return Table(("gate", "bounds checked", "not met", "bounds left out: did not run"), "lrll", [row])


def why_unchecked(gate: Gate) -> str:
    if not gate.total:
        return "there is no bound"
    bounds = "the only bound is" if gate.total == 1 else f"all {gate.total} bounds are"
    return f"{bounds} for {_not_run(gate)}"


def _not_run(gate: Gate) -> str:
    """Describe the runs for which the unchecked bounds are."""
    solvers_only = all(rtol is None for _, rtol in gate.left_out)
    return f"{'solvers' if solvers_only else 'solvers or tolerances'} that were not run"


def bounds_left_out(gate: Gate) -> str:
    """Return a message with the solvers and tolerances whose bounds were not checked."""
    return f"bounds are skipped for runs that did not take place: {listing([_name(*entry) for entry in gate.left_out])}"


def _name(solver: str, rtol: float | None) -> str:
    return solver if rtol is None else f"{solver} at {setting(rtol, None)}"


def gate_state(gate: Gate, failed: bool, *, wanted: bool) -> str:
    """Describe the result of a gate after the name of the report; ``wanted``: whether it decides the exit status."""
    if not gate.total and not wanted:
        return ""
    if failed and gate.checked:
        return "; gate not met"
    if not gate.checked:
        return f"; gate not checked: {why_unchecked(gate)}"
    if gate.checked == gate.total:
        return "; gate met"
    others = gate.total - gate.checked
    are = f"{others} {'is' if others == 1 else 'are'} for {_not_run(gate)}"
    return f"; gate met: {gate.checked} of {gate.total} bounds checked, {are}"


def demands_state(demands: Mapping[str, Demand]) -> str:
    """Describe in how many readings each required solver is right, after the name of the report."""
    return "".join(f"; {solver} right in {own.right} of {own.judged} judged" for solver, own in demands.items())


_ELEMENTS: dict[RowKind, str] = {"failure": "failure", "error": "error", "skipped": "skipped", "known": "skipped"}
MOST_ROWS = 50
"""Largest number of rows in the summary of a GitHub step, which is limited to 1 MiB."""
Results = Sequence[tuple[RunRow, RowKind, str]]
"""Rows, each with its result and the reason why it has not passed."""


def junit_xml(results: Results) -> bytes:
    """Format rows as JUnit XML for Jenkins (schema of its xUnit plugin), GitLab and similar, one suite per case.

    ``classname`` is the case and the reading, ``name`` the solver and its setting, and ``time`` the wall time of a run
    [s] with the three decimals of the schema; ``system-out`` has all digits. An expected failure is ``skipped``, with a
    reason.
    """
    root = ElementTree.Element("testsuites", {"name": "henon_ref", **_counts(results)})
    for case, own in grouped(results, lambda entry: entry[0].case).items():
        skipped = sum(_ELEMENTS.get(kind) == "skipped" for _, kind, _ in own)
        names = {"name": short_line(case), "skipped": str(skipped)}
        suite = ElementTree.SubElement(root, "testsuite", names | _counts(own))
        for row, kind, reason in own:
            _test_case(suite, row, kind, short_line(reason))
    ElementTree.indent(root)
    written: bytes = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    return written + b"\n"


def _counts(results: Results) -> dict[str, str]:
    kinds = Counter(_ELEMENTS.get(kind) for _, kind, _ in results)
    return {
        "tests": str(len(results)),
        "failures": str(kinds["failure"]),
        "errors": str(kinds["error"]),
        "time": f"{sum(row.wall_s or 0.0 for row, _, _ in results):.3f}",
    }


def _test_case(suite: ElementTree.Element, row: RunRow, kind: RowKind, reason: str) -> None:
    names = {
        "classname": short_line(f"{row.case}.{row.reading}"),
        "name": short_line(row.label),
        "time": f"{row.wall_s or 0.0:.3f}",
    }
    case = ElementTree.SubElement(suite, "testcase", names)
    if kind != "passed":
        element = _ELEMENTS[kind]
        what = {"message": reason} if element == "skipped" else {"message": reason, "type": row.status}
        ElementTree.SubElement(case, element, what).text = reason
    shown = (
        "status", "verdict", "verdict_basis", "cause", "digits", "max_time_error_s", "wall_s", "matched", "missed",
        "spurious",
    )  # fmt: skip
    known = zip(shown, row.values(shown), strict=True)
    output = [f"{column}: {short_line(csv_field(value))}" for column, value in known if value is not None]
    ElementTree.SubElement(case, "system-out").text = "\n".join(output)


def step_summary(rows: Results, lines: Sequence[str]) -> str:
    """Format a table of the solvers, a table of the failing rows, and the messages of the command as markdown."""
    failing = [(row, kind, reason) for row, kind, reason in rows if kind in ("failure", "error")]
    parts = ["## henon_ref", _solvers(rows).markdown]
    if failing:
        cells = [
            (code(row.case), code(row.reading), code(row.solver), row.setting, markdown(reason))
            for row, _, reason in failing[:MOST_ROWS]
        ]
        parts += ["### Failures", Table(("case", "reading", "solver", "setting", "reason"), "lllrl", cells).markdown]
    if len(failing) > MOST_ROWS:
        parts.append(f"{len(failing) - MOST_ROWS} more are in `runs.csv`.")
    items = [f"- {markdown(line)}" for line in lines[:MOST_ROWS]]
    items += [f"- and {len(lines) - MOST_ROWS} more"] if len(lines) > MOST_ROWS else []
    return "\n\n".join([*parts, *(["\n".join(items)] if items else [])]) + "\n"


def _solvers(rows: Results) -> Table:
    table = []
    for solver, own in grouped(rows, lambda entry: entry[0].solver).items():
        kinds = Counter(kind for _, kind, _ in own)
        best = max((row.digits for row in right([row for row, _, _ in own])), default=None, key=number)
        counts = (kinds["passed"], kinds["failure"] + kinds["error"], kinds["known"], kinds["skipped"])
        table.append((code(solver), *map(str, counts), digits(best)))
    headings = ("solver", "right", "fail", "fail as expected", "not run or not decidable", "most digits")
    return Table(headings, "lr", table)
