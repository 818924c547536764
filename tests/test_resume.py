"""Rows that an interrupted comparison has kept: which of them another one uses, and which not."""

from __future__ import annotations

import json
import sys
from dataclasses import replace

import pytest
from fakes import CASE, TIMES, Fake, case, statement

from henon_ref.comparison import Comparison, compare, compare_all
from henon_ref.score import truthjob
from henon_ref.score.journal import FILE, read
from henon_ref.score.options import Options

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="made-up truths reach workers by fork")


@pytest.fixture(autouse=True)
def _made_up_truth(monkeypatch):
    monkeypatch.setattr(truthjob, "statement_of", statement)


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
    assert not (tmp_path / "made_up" / FILE).exists()


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
    options = Options(solvers=(Fake(),), repeats=1, folder=tmp_path, resume=True, keep_journals=True)
    found: list[Comparison] = []
    for _ in range(2):
        compare_all([case(text=TWO_READINGS)], options, found.append)
    first, resumed = found
    assert list(resumed.runs["reading"]) == ["a", "a", "b", "b"]
    assert resumed.run_rows == first.run_rows
    assert resumed.stick_rows == first.stick_rows
    assert {(row["reading"], row["published_s"]) for row in resumed.stick_rows} == {("a", 1.0), ("b", 2.0)}


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
    options = Options(solvers=(Fake(log=str(log)),), folder=tmp_path, resume=True, keep_journals=True, timed=False)
    for text in (CASE, CASE.replace(*change)):
        compare_all([case(text=text)], options, lambda comparison: None)
    assert len(log.read_text().splitlines()) == 4


def _raise(comparison: Comparison) -> None:
    raise RuntimeError("the disk is full")


def test_a_line_that_was_cut_short_is_ignored(tmp_path):
    path = tmp_path / FILE
    path.write_text(json.dumps({"key": "a", "run": {}}) + "\n" + '{"key": "b", "ru')
    assert list(read(path)) == ["a"]
