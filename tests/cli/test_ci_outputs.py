"""The command in somebody's CI: JUnit, a step's summary, a baseline, failures that are known."""

from __future__ import annotations

import csv
import re
import signal
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest
from fakes import Fake

from henon_ref import registry
from henon_ref.cli.compare import command
from henon_ref.solver import Solver

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="made-up solvers reach workers by fork")

CASE = str(Path(__file__).parents[2] / "cases" / "leaving_slide.yaml")
FAILS = "scipy-sign"
"""Would step on and on in the slide, until its budget of right-hand sides is spent; here that is spent at once."""
REAL = registry.solver


def solver(name: str) -> Solver:
    return Fake(FAILS, "gives up") if name == FAILS else REAL(name)


@pytest.fixture(autouse=True)
def folder(monkeypatch, tmp_path):
    """A folder of its own, in which nobody else's CI is set up."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(registry, "solver", solver)
    monkeypatch.delenv("GITHUB_STEP_SUMMARY", raising=False)
    handler = signal.getsignal(signal.SIGTERM)
    yield
    signal.signal(signal.SIGTERM, handler)


@pytest.fixture(scope="module")
def earlier(tmp_path_factory) -> Path:
    """The reports of a comparison of a solver that is right and one that fails."""
    out = tmp_path_factory.mktemp("earlier")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(registry, "solver", solver)
        assert compare("--out", out) == 0
    return out


def compare(*arguments: object, solvers: str = f"henon,{FAILS}") -> int:
    given = ["--solvers", solvers, "--tolerances", "1e-6,1e-9", "--repeats", "1", "--no-figures"]
    return command([CASE, *given, *map(str, arguments)])


def changed(earlier: Path, solver: str, **values: str) -> Path:
    """A baseline in which the rows of a solver were otherwise."""
    with (earlier / "leaving_slide/runs.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        if row["solver"] == solver:
            row.update(values)
    with Path("baseline.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    return Path("baseline.csv")


def known(*lines: str) -> Path:
    Path("known.csv").write_text("\n".join(["case,reading,solver,rtol,status", *lines, ""]))
    return Path("known.csv")


def lines_of(capsys, what: str) -> list[str]:
    return [line for line in capsys.readouterr().err.splitlines() if line.startswith(what)]


def test_junit_has_a_test_case_a_row(capsys):
    assert compare("--junit", "results/junit.xml") == 0
    root = ElementTree.parse("results/junit.xml").getroot()
    assert {name: root.get(name) for name in ("tests", "failures", "errors")} == {
        "tests": "4", "failures": "2", "errors": "0",
    }  # fmt: skip
    with Path("out/leaving_slide/runs.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    cases = list(root.iter("testcase"))
    for row, case in zip(rows, cases, strict=True):
        assert case.get("classname") == "leaving_slide.default"
        assert case.get("name") == f"{row['solver']} (rtol {float(row['rtol']):g})"
        failure = case.find("failure")
        assert (failure is None) == (row["verdict"] == "right")
        if failure is not None:
            assert row["status_reason"] in failure.get("message")
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("what", "element"), [("crashes", "error"), ("unsupported", "skipped"), ("misses", "failure"), ("raises", "error")]
)
def test_what_has_no_result_is_an_error_and_what_did_not_run_is_skipped(
    made_up_solvers, made_up, monkeypatch, what, element
):
    solvers = {"henon": Fake("henon"), "heyoka": Fake("heyoka", what)}
    monkeypatch.setattr(registry, "solver", solvers.__getitem__)
    assert command([str(made_up), "--tolerances", "1e-3", "--junit", "junit.xml"]) == 0
    right, other = ElementTree.parse("junit.xml").getroot().iter("testcase")
    assert [child.tag for child in right] == ["system-out"]
    assert [child.tag for child in other] == [element, "system-out"]


@pytest.mark.parametrize("name", [".", "leaving_slide.yaml/x.xml", "/proc/none/junit.xml", "known.csv"])
def test_a_junit_file_that_cannot_be_written_is_reported_before_anything_runs(capsys, name):
    Path("leaving_slide.yaml").write_text("")
    options = ["--known", known("leaving_slide,,,,"), "--junit", name]
    before = sorted(Path().rglob("*"))
    assert compare(*options) == 2
    captured = capsys.readouterr()
    assert captured.err.startswith("error: ")
    assert "--junit needs" in captured.err
    assert captured.err.count("\n") == 1
    assert sorted(Path().rglob("*")) == before


def test_a_step_of_a_workflow_gets_a_summary(monkeypatch, capsys):
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", "summary.md")
    Path("summary.md").write_text("# Mine\n")
    assert compare("--require", FAILS) == 1
    text = Path("summary.md").read_text()
    assert text.startswith("# Mine\n\n## henon_ref\n\n| solver |")
    assert re.search(r"^\| `henon` \| 2 \| 0 \| 0 \| 0 \| 15.9 \|$", text, re.MULTILINE)
    assert f"| `leaving_slide` | `default` | `{FAILS}` | 1e-6 | failed (" in text
    assert f"- required: leaving_slide: default: {FAILS} (rtol 1e-09): failed (" in text
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", "none/summary.md")
    capsys.readouterr()
    assert compare(solvers="henon") == 0
    assert capsys.readouterr().err == (
        "the step's summary cannot be written: none/summary.md: No such file or directory\n"
    )


def test_the_same_again_is_no_worse(earlier, capsys):
    assert compare("--baseline", earlier) == 0
    assert lines_of(capsys, "baseline") == ["baseline: 4 rows compared, none worse"]


def test_a_row_whose_status_got_worse_decides_the_exit_status(earlier, capsys):
    before = changed(earlier, FAILS, status="ok", verdict="right", status_reason="")
    assert compare("--baseline", before, "--junit", "junit.xml") == 1
    first, *worse = lines_of(capsys, "baseline")
    assert first == "baseline: 4 rows compared, 2 worse"
    assert [line.split(": was ")[0] for line in worse] == [
        f"baseline: leaving_slide: default: {FAILS} (rtol {rtol})" for rtol in ("1e-06", "1e-09")
    ]
    assert all(": was ok, is failed (the budget" in line for line in worse)
    assert "worse than the baseline: was ok, is failed" in Path("junit.xml").read_text()


def test_a_row_that_lost_digits_decides_the_exit_status(made_up_solvers, made_up, capsys):
    """A solver whose error is its tolerance, held against one that had half as many digits more, and a tenth more."""
    given = [str(made_up), "--solvers", "henon", "--tolerances", "1e-6", "--no-figures"]
    assert command([*given, "--out", "now"]) == 0
    text = Path("now/made_up/runs.csv").read_text()
    error = re.search(r",ok,fake,5,5,5,0,0,([^,]+),", text)[1]
    for factor, status in ((1.25, 0), (10.0, 1), (0.01, 0)):
        Path("runs.csv").write_text(text.replace(f",{error},", f",{float(error) / factor!r},"))
        capsys.readouterr()
        assert command([*given, "--baseline", "runs.csv"]) == status
        found = [line for line in lines_of(capsys, "baseline: made_up") if "1.00 digits fewer" in line]
        assert len(found) == status


def test_rows_that_did_not_run_are_named_and_decide_nothing(earlier, capsys):
    before = changed(earlier, "henon", rtol="1e-4")
    before.write_text(before.read_text() + before.read_text().splitlines()[1].replace("leaving_slide", "gone") + "\n")
    assert compare("--baseline", before) == 0
    row = "leaving_slide: default: henon (rtol 0.0001)"
    assert lines_of(capsys, "baseline") == [
        "baseline: 2 rows compared, none worse, 2 rows of now not in it",
        f"baseline: 2 rows did not run now: case gone; row {row}",
    ]
    assert compare("--baseline", earlier, solvers="henon") == 0
    assert lines_of(capsys, "baseline") == [
        "baseline: 2 rows compared, none worse",
        f"baseline: 2 rows did not run now: solver {FAILS}",
    ]


def test_a_baseline_with_which_nothing_could_be_compared_does_not_pass(earlier, capsys):
    before = changed(earlier, FAILS, case="another")
    assert compare("--baseline", before, solvers=FAILS) == 1
    assert lines_of(capsys, "baseline")[-1] == "baseline: none of its rows is among those that ran"


def test_a_known_failure_is_reported_and_not_counted(earlier, capsys):
    before = changed(earlier, FAILS, status="ok", verdict="right")
    options = ["--require", FAILS, "--baseline", before, "--junit", "junit.xml"]
    assert compare(*options, "--known", known(f"leaving_slide,,{FAILS},,failed")) == 0
    (line,) = lines_of(capsys, "known")
    assert line.startswith(f"known: known.csv:2: fails as expected: leaving_slide: default: {FAILS} (rtol 1e-06)")
    root = ElementTree.parse("junit.xml").getroot()
    assert (root.get("failures"), root[0].get("skipped")) == ("0", "2")
    assert compare(*options, "--known", known(f"leaving_slide,,{FAILS},1e-6,")) == 1
    assert lines_of(capsys, "baseline: leaving")[0].startswith(
        f"baseline: leaving_slide: default: {FAILS} (rtol 1e-09): was ok"
    )
    assert compare(*options, "--known", known(f"leaving_slide,,{FAILS},,wrong")) == 1


def test_a_failure_that_is_mended_is_reported(capsys):
    lines = ["leaving_slide,default,henon,1e-6,wrong", f",,{FAILS},,", "another,,,,"]
    assert compare("--known", known(*lines)) == 0
    mended, failing, nowhere = lines_of(capsys, "known")
    assert mended == "known: known.csv:2: mended: nothing of it fails any more; take the line out"
    assert failing.startswith("known: known.csv:3: fails as expected: ")
    assert nowhere == "known: no row of this run is meant by known.csv:4"


def test_a_known_failure_does_not_count_for_the_gate(made_up_solvers, made_up, monkeypatch, capsys):
    monkeypatch.setattr(registry, "solver", {"henon": Fake("henon", "misses"), "heyoka": Fake("heyoka")}.__getitem__)
    assert command([str(made_up), "--gate"]) == 1
    assert command([str(made_up), "--gate", "--known", str(known("made_up,,henon,1e-6,"))]) == 0
    captured = capsys.readouterr()
    assert captured.out.splitlines()[-1] == "out/made_up/report.md; gate met"
    assert "known: known.csv:2: fails as expected: made_up: default: henon (rtol 1e-06): wrong" in captured.err


def test_a_bound_that_is_not_met_is_a_failure_in_junit_where_the_gate_decides(made_up_solvers, made_up, capsys):
    made_up.write_text(made_up.read_text().replace("max_time_error: 1e-5", "max_time_error: 1e-9"))
    for gate, status, failures in ((["--gate"], 1, "1"), ([], 0, "0")):
        assert command([str(made_up), "--solvers", "henon", *gate, "--junit", "junit.xml"]) == status
        assert ElementTree.parse("junit.xml").getroot().get("failures") == failures
    lines = known("made_up,,henon,1e-6,")
    capsys.readouterr()
    assert command([str(made_up), "--solvers", "henon", "--gate", "--known", str(lines), "--junit", "junit.xml"]) == 0
    (line,) = lines_of(capsys, "known")
    assert line.startswith("known: known.csv:2: fails as expected: made_up: default: henon (rtol 1e-06): ok")
    assert "gate: default: henon (rtol 1e-06): worst time error" in Path("junit.xml").read_text()
