"""Defaults against the suite: the merit of a restart, and where another one than the default does better."""

from __future__ import annotations

from pathlib import Path
from typing import get_args

import pytest

from henon_ref.harness import registry
from henon_ref.harness.rows import NOT_RUN, RunRow
from henon_ref.harness.studies.restart_tables import (
    ENDINGS,
    FOLDER,
    SUITE,
    Merit,
    SuiteRow,
    beaten_table,
    best_restart,
    ending,
    merged,
    merits,
    read_suite,
    suite_rows,
    wrong_defaults,
)
from henon_ref.trajectory import Status

REPORTS = Path(__file__).parents[3] / "reports"
LIBRARIES = (
    "heyoka", "cvode-adams", "cvode-bdf", "ida",
    "scipy-rk45", "scipy-dop853", "scipy-radau", "scipy-bdf", "scipy-lsoda",
)  # fmt: skip
"""Those that the study must have; of further ones that it has the defaults are held against it, too."""


def of(
    restart: str, right: int, *, case: str = "a", solver: str = "heyoka", digits: float = 9.0, wall: float = 1.0
) -> SuiteRow:
    """A row of the suite: of six runs so many right."""
    names = {"case": case, "solver": solver, "restart": restart, "runs": 6, "right": right}
    ends = {"wrong": 0, "ended_early": 0, "failed": 6 - right, "missed": 6 - right, "spurious": 0, "elsewhere": 0}
    return SuiteRow(**names | ends, digits=digits, wall_s=wall)


def test_no_restart_beats_its_library_s_default_over_the_suite() -> None:
    """The defaults are what the last run over the whole suite says: ``henon-ref restarts cases --out reports``."""
    suite = read_suite(REPORTS)
    assert {row.solver for row in suite} >= set(LIBRARIES)
    assert {row.restart for row in suite} == set(registry.RESTARTS)
    assert wrong_defaults(suite) == []


def test_a_library_with_compiled_callbacks_has_the_default_of_its_plain_one() -> None:
    for name in registry.names():
        base, compiled, _ = name.partition("+")
        if compiled:
            assert registry.restart_of(name) == registry.restart_of(base)


@pytest.mark.parametrize("library", LIBRARIES)
def test_a_wrong_default_is_found(library: str) -> None:
    default = registry.restart_of(library)
    rows = [of(restart, 5 + (restart != default), solver=library) for restart in registry.RESTARTS]
    (words,) = wrong_defaults(rows)
    assert words.startswith(f"{library}: its default is {default} (right in 5, ")
    assert "better is " in words
    assert wrong_defaults([of(restart, 5, solver=library) for restart in registry.RESTARTS]) == []
    (words,) = wrong_defaults([row for row in rows if row.restart != default])
    assert "(not run)" in words


@pytest.mark.parametrize(
    ("better", "worse"),
    [
        (Merit(6, 1.0, 9.0), Merit(5, 70.0, 1.0)),
        (Merit(5, 61.0, 9.0), Merit(5, 60.0, 1.0)),
        (Merit(5, 60.0, 0.7), Merit(5, 60.0, 1.0)),
    ],
)
def test_right_runs_count_before_digits_and_digits_before_time(better: Merit, worse: Merit) -> None:
    assert better.beats(worse)
    assert not worse.beats(better)


def test_what_the_machine_may_do_to_a_time_makes_no_restart_better() -> None:
    first, second = Merit(5, 60.0, 0.9), Merit(5, 60.2, 1.0)
    assert not first.beats(second)
    assert not second.beats(first)
    assert best_restart({"offset": second, "none": first}) == "offset"


def run(solver: str, status: str = "ok", verdict: str = "right", **own: object) -> RunRow:
    names = {"case": "a", "reading": "default", "solver": solver, "rtol": 1e-6, "status": status, "verdict": verdict}
    return RunRow(**names | {"missed": 0, "spurious": 0} | own)


def test_the_suite_sums_up_a_case_s_runs() -> None:
    """Digits beyond 12 are rounding; a run that was not made is none; what another restart gets right is told."""
    rows = [
        run("heyoka@none", digits=15.0, wall_s=2.0),
        run("heyoka@none", digits=7.5, wall_s=1.0, rtol=1e-9),
        run("heyoka@none", digits=None, wall_s=1.0, rtol=1e-12),
        run("heyoka@none", "failed", "solver defect", missed=2, reading="b"),
        run("heyoka@none", "wrong", "solver defect", missed=1, spurious=3, reading="c"),
        run("heyoka@offset", "wrong", "solver defect"),
        run("heyoka@offset", reading="c", digits=9.0, wall_s=1.0),
        run("ida@none", "unavailable", "not run"),
        run("ida@offset", reading="b", digits=9.0, wall_s=1.0),
    ]
    none, offset, ida = suite_rows(rows)
    assert tuple(vars(none).values()) == ("a", "heyoka", "none", 5, 3, 1, 0, 1, 3, 3, 1, 19.5, 4.0)
    assert tuple(vars(offset).values())[3:] == (2, 1, 1, 0, 0, 0, 0, 1, 9.0, 1.0)
    assert ida.elsewhere == 0


def test_every_status_of_the_contract_ends_a_run_in_one_way() -> None:
    """A run that ends by a status of its own has missed what comes after; it is neither wrong nor failed."""
    found = {
        status: ending(run("heyoka@none", status, "right" if status == "ok" else "solver defect", missed=1))
        for status in get_args(Status)
        if status not in NOT_RUN
    }
    assert set(found.values()) == set(ENDINGS)
    assert {status for status, end in found.items() if end == "ended_early"} == {"nonunique", "invalid", "diverged"}
    assert {status for status, end in found.items() if end == "failed"} == {"failed", "timeout"}


def test_rows_of_libraries_and_cases_that_did_not_run_are_kept() -> None:
    earlier = [of("none", 1, solver="scipy-rk45"), of("none", 1), of("offset", 1, case="b")]
    fresh = [of("none", 2)]
    assert merged(fresh, earlier) == [fresh[0], earlier[0], earlier[2]]
    assert merged([], earlier) == [earlier[1], earlier[0], earlier[2]]


def test_default_and_best_stand_side_by_side_where_another_one_is_right_more_often() -> None:
    default = registry.restart_of("heyoka")
    first, second, third = (restart for restart in registry.RESTARTS if restart != default)
    rows = [
        of(default, 4), of(first, 6), of(second, 6), of(third, 3),
        of(default, 6, case="b"), of(first, 6, case="b", digits=60.0),
    ]  # fmt: skip
    (line,) = beaten_table(rows).rows
    best = ", ".join(f"`{restart}`" for restart in registry.RESTARTS if restart in (first, second))
    assert line == ("[a](a/report.md)", "`heyoka`", f"`{default}`", "4 of 6", best, "6 of 6", "2 failed, 2 missed")
    assert set(merits(rows, "heyoka")) == set(registry.RESTARTS)


@pytest.mark.parametrize("content", ["", "case,solver\na,b\n", "case\n1,2,3\n"])
def test_another_file_of_that_name_is_no_suite(tmp_path: Path, content: str) -> None:
    assert read_suite(tmp_path) == []
    (tmp_path / FOLDER).mkdir()
    (tmp_path / FOLDER / SUITE).write_text(content, encoding="utf-8")
    assert read_suite(tmp_path) == []
