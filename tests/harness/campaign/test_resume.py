"""Rows kept by an interrupted comparison, and which of them the next one uses."""

from __future__ import annotations

import os
import sys
from dataclasses import replace
from importlib.metadata import EntryPoint
from types import SimpleNamespace

import pytest
from fakes import CASE, TIMES, Fake, case, truth

from henon_ref.harness import registry
from henon_ref.harness.campaign import journal
from henon_ref.harness.campaign.campaign import compare, compare_all
from henon_ref.harness.campaign.comparison import Comparison
from henon_ref.harness.campaign.journal import FILE, SET_ASIDE, Journal, line_of, read
from henon_ref.harness.campaign.options import Options
from henon_ref.harness.campaign.rows import Record
from henon_ref.harness.rows import RunRow
from henon_ref.harness.truth import compute

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="made-up truths reach workers by fork")


@pytest.fixture(autouse=True)
def _made_up_truth(monkeypatch):
    monkeypatch.setattr(compute, "truth_for", truth)


def run(*solvers: Fake, **options: object) -> Comparison:
    return compare(case(), solvers=solvers, **options)


def test_finished_rows_survive_an_interrupt_and_are_used_again(tmp_path):
    class Interrupting:
        def __getattr__(self, name):
            return lambda *arguments: None

        def row(self, finished):
            raise KeyboardInterrupt

    log = tmp_path / "log"
    options = Options(solvers=(Fake(log=str(log)),), repeats=1, folder=tmp_path, resume=True)
    with pytest.raises(KeyboardInterrupt):
        compare_all([case()], options, pytest.fail, observer=Interrupting())
    assert len(read(tmp_path / "made_up" / FILE)) == 1
    assert log.read_text().splitlines() == ["fake 0.001"] * 2
    found: list[Comparison] = []
    compare_all([case()], options, found.append)
    assert log.read_text().splitlines() == ["fake 0.001"] * 2 + ["fake 1e-06"] * 2
    assert list(found[0].runs["rtol"]) == [1e-3, 1e-6]
    assert list(found[0].runs["matched"]) == [5, 5]
    assert len(found[0].transitions) == 2 * len(TIMES)
    assert len(read(tmp_path / "made_up" / FILE)) == 2  # who asked for the journal removes it


@pytest.mark.parametrize(
    "change", [{"repeats": 2}, {"timeout": 3.0}, {"solvers": (Fake(version="1.0", name="other"),)}, {"resume": False}]
)
def test_rows_of_other_settings_are_not_used(tmp_path, change):
    class Keeping:
        def __getattr__(self, name):
            return lambda *arguments: None

    log = tmp_path / "log"
    options = Options(solvers=(Fake(log=str(log)),), repeats=1, folder=tmp_path, resume=True)
    with pytest.raises(RuntimeError, match="the disk is full"):
        compare_all([case()], options, _raise, observer=Keeping())
    assert len(read(tmp_path / "made_up" / FILE)) == 2
    before = len(log.read_text().splitlines())
    solvers = change.get("solvers", options.solvers)
    again = replace(options, **{**change, "solvers": tuple(replace(s, log=str(log)) for s in solvers)})
    compare_all([case()], again, lambda comparison: None)
    assert len(log.read_text().splitlines()) > before


TWO_READINGS = (
    CASE.replace("published: {{stick_durations: [0.75]}}", "published: {{}}")
    + """
readings:
  a: {{published: {{stick_durations: [1]}}}}
  b: {{published: {{stick_durations: [2]}}}}
"""
)


def test_readings_that_share_their_mathematics_keep_their_own_rows(tmp_path):
    options = Options(solvers=(Fake(),), repeats=1, folder=tmp_path, resume=True)
    found: list[Comparison] = []
    for _ in range(2):
        compare_all([case(text=TWO_READINGS)], options, found.append)
    first, resumed = found
    assert list(resumed.runs["reading"]) == ["a", "a", "b", "b"]
    assert resumed.run_rows == first.run_rows
    assert resumed.stick_rows == first.stick_rows
    assert {(row.reading, row.published_s) for row in resumed.stick_rows} == {("a", 1.0), ("b", 2.0)}


@pytest.mark.parametrize(
    "change",
    [
        ("[0.75]", "[0.76]"),
        ("after: 1", "after: 0.9"),
        ("name: {name}", "name: {name}\nexpect: {{status: failed}}"),
        ("name: {name}", "name: {name}\nreadings: {{other: {{}}}}"),
    ],
)
def test_rows_scored_against_something_else_are_not_used(tmp_path, change):
    log = tmp_path / "log"
    options = Options(solvers=(Fake(log=str(log)),), folder=tmp_path, resume=True, timed=False)
    for text in (CASE, CASE.replace(*change)):
        compare_all([case(text=text)], options, lambda comparison: None)
    assert len(log.read_text().splitlines()) == 4


def _raise(comparison: Comparison) -> None:
    raise RuntimeError("the disk is full")


ROW = Record(RunRow("made_up", "default", "henon", status="ok"))
OTHER = Record(replace(ROW.run, case="another"))
DAMAGED = {
    "cut short": line_of("b", ROW)[:-20],
    "without its end": line_of("b", ROW)[:-1],
    "no JSON": b"ok\n",
    "no row": b'{"key":"b"}\n',
    "no text": b"\xff\xfe\n",
    "another status": line_of("b", ROW).replace(b'"ok"', b'"no"'),
    "a number for a table": line_of("b", replace(ROW, samples=3)),
    "columns of another version": line_of("b", replace(ROW, run=SimpleNamespace(case="made_up"))),
    "a row of another case": line_of("b", OTHER),
}


@pytest.mark.parametrize("line", DAMAGED.values(), ids=DAMAGED)
def test_a_damaged_line_is_told_and_set_aside_and_the_others_are_used(tmp_path, caplog, line):
    path = tmp_path / "made_up" / FILE
    path.parent.mkdir()
    path.write_bytes(line_of("a", ROW) + line)
    assert read(path) == {"a": ROW}
    journal = Journal(path.parent, resume=True)
    (told,) = caplog.messages
    assert f"{path}: line 2 is damaged" in told
    assert (path.parent / SET_ASIDE).read_bytes().rstrip() == line.rstrip()
    journal.add("c", ROW)
    caplog.clear()
    assert Journal(path.parent, resume=True).rows["c"] == ROW
    assert not caplog.messages
    assert read(path) == {"a": ROW, "c": ROW}


def test_rows_of_other_code_are_not_used(tmp_path, monkeypatch):
    log = tmp_path / "log"
    options = Options(solvers=(Fake(log=str(log)),), folder=tmp_path, resume=True, timed=False)
    for version in ("before", "before", "after"):
        monkeypatch.setattr(journal, "code_version", lambda version=version: version)
        compare_all([case()], options, lambda comparison: None)
    assert len(log.read_text().splitlines()) == 4


def test_the_code_s_version_is_that_of_its_text(tmp_path, monkeypatch):
    package = tmp_path / "some_solvers"
    (package / "inner").mkdir(parents=True)
    (package / "__init__.py").write_text("")
    module = package / "inner" / "module.py"
    module.write_text("A = 1\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(journal, "PACKAGES", ("some_solvers",))
    before = journal.code_version.__wrapped__()
    os.utime(module, (0, 0))
    (package / ".#module.py").symlink_to("user@machine.1")  # the lock of an editor
    assert journal.code_version.__wrapped__() == before
    module.write_text("A = 2\n")
    assert journal.code_version.__wrapped__() != before


@pytest.mark.parametrize("file", ["some_solver.py", "some_solver/baselines/inner.py", "some_solver/fast.abi3.so"])
def test_rows_of_a_third_party_s_earlier_code_are_not_used(tmp_path, monkeypatch, file):
    """Its version is the same after every change in an editable installation."""
    code, log = tmp_path / "site" / file, tmp_path / "log"
    code.parent.mkdir(parents=True)
    if "/" in file:
        (tmp_path / "site/some_solver/__init__.py").write_text("")
    monkeypatch.syspath_prepend(tmp_path / "site")
    points = {"own": EntryPoint("own", "some_solver:SOLVER", registry.GROUP)}
    monkeypatch.setattr(registry, "_third_party", lambda: points)
    options = Options(solvers=(Fake("own", log=str(log)),), folder=tmp_path, resume=True, timed=False)
    for text in ("before", "before", "after"):
        code.write_text(text)
        journal.package_code.cache_clear()
        compare_all([case()], options, lambda comparison: None)
    assert len(log.read_text().splitlines()) == 4
