"""JUnit XML: valid by its schema, with all text escaped."""

from __future__ import annotations

import re
import unicodedata
from xml.etree import ElementTree

from henon_ref.harness.report.gate import MOST_ROWS, junit_xml, step_summary
from henon_ref.harness.rows import RunRow
from henon_ref.harness.score.gate import row_result

EVIL = "]]><testcase/>&amp;\x00\x1b[31m\x9b\ud800\uffff\u202e\r\n\"' | `x` <img src=//evil.example/x.png>"


def row(solver: str, **values: object) -> RunRow:
    own = {"case": "c", "reading": "default", "rtol": 1e-6, "status": "ok", "verdict": "right", "found_transitions": 1}
    return RunRow(**own | {"solver": solver, "wall_s": 1.25e-4} | values)


ROWS = [
    row("henon"),
    row("ida", status="wrong", verdict="solver defect", status_reason="1 missed", wall_s=None),
    row("lsoda", status="failed", verdict="solver defect", found_transitions=None),
    row("cvode", status="unavailable", verdict="not run", case="d"),
    row("henon-rk4", rtol=None, step_s=1e-4, wall_s=12.5, case="d"),
]


def parsed(rows) -> ElementTree.Element:
    return ElementTree.fromstring(junit_xml([(own, *row_result(own)) for own in rows]))


def test_the_document_is_as_the_schema_of_jenkins_xunit_plugin_has_it():
    """Elements, required attributes, counts that add up, and times of at most three decimals (its SUREFIRE_TIME)."""
    root = parsed(ROWS)
    assert root.tag == "testsuites"
    assert [suite.get("name") for suite in root] == ["c", "d"]
    for suite in root:
        assert suite.tag == "testsuite"
        assert {"name", "tests", "failures", "errors"} <= set(suite.attrib)
        assert suite.get("tests") == str(len(suite.findall("testcase")))
        for counted, element in (("failures", "failure"), ("errors", "error"), ("skipped", "skipped")):
            assert suite.get(counted) == str(len(suite.findall(f"testcase/{element}")))
        for case in suite:
            assert set(case.attrib) == {"classname", "name", "time"}
            assert {child.tag for child in case} <= {"failure", "error", "skipped", "system-out"}
    assert [root.get(name) for name in ("tests", "failures", "errors")] == ["5", "1", "1"]
    times = [element.get("time") for element in root.iter() if element.get("time") is not None]
    assert all(re.fullmatch(r"(([0-9]{0,3},)*[0-9]{3}|[0-9]{0,3})*(\.[0-9]{0,3})?", time) for time in times)


def test_a_test_case_is_named_by_case_reading_solver_and_setting():
    cases = list(parsed(ROWS).iter("testcase"))
    assert [(case.get("classname"), case.get("name"), case.get("time")) for case in cases[::4]] == [
        ("c.default", "henon (rtol 1e-06)", "0.000"),
        ("d.default", "henon-rk4 (step 0.0001 s)", "12.500"),
    ]
    assert "wall_s: 0.000125" in cases[0].findtext("system-out").splitlines()
    failure = cases[1].find("failure")
    assert failure.attrib == {"message": "wrong (1 missed); verdict: solver defect", "type": "wrong"}
    assert failure.text == failure.get("message")
    assert cases[3].find("skipped").get("message") == "unavailable"


def test_a_strangers_text_is_text():
    rows = [row(EVIL, reading=EVIL, status="wrong", verdict="solver defect", status_reason=EVIL, verdict_basis=EVIL)]
    written = junit_xml([(own, *row_result(own)) for own in rows]).decode()
    assert not {c for c in written if unicodedata.category(c) in ("Cc", "Cf", "Cs", "Cn")} - {"\n"}
    (case,) = ElementTree.fromstring(written).iter("testcase")
    assert "]]><testcase/>&amp;" in case.get("name")
    assert "]]><testcase/>&amp;" in case.find("failure").text
    summary = step_summary([(own, *row_result(own)) for own in rows], [EVIL])
    assert "<img" not in summary
    assert not {c for c in summary if unicodedata.category(c) in ("Cc", "Cf", "Cs", "Cn")} - {"\n"}


def test_a_summary_counts_what_it_does_not_show():
    rows = [row("ida", status="wrong", verdict="solver defect", rtol=1 / n) for n in range(2, MOST_ROWS + 5)]
    lines = step_summary(
        [(own, *row_result(own)) for own in [*rows, row("henon", digits=9.27)]], ["a"] * 60
    ).splitlines()
    assert lines[0] == "## henon_ref"
    assert f"| `ida` | 0 | {MOST_ROWS + 3} | 0 | 0 |  |" in lines
    assert "| `henon` | 1 | 0 | 0 | 0 | 9.2 |" in lines
    assert sum(line.startswith("| `c` |") for line in lines) == MOST_ROWS
    assert "3 more are in `runs.csv`." in lines
    assert lines[-1] == "- and 10 more"
