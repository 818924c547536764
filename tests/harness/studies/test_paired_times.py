"""Paired times: selection of the solvers, and the text of page and index."""

from __future__ import annotations

import json
import os
import re
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace

import pytest
from fakes import Fake, case, trajectory
from made_reports import ORIGIN, study_request

from henon_ref.harness import registry
from henon_ref.harness.campaign import timing
from henon_ref.harness.campaign.options import Options
from henon_ref.harness.report.folder import RUNS
from henon_ref.harness.report.folder_report import write_folder_report
from henon_ref.harness.result_files import read_rows, rows_text
from henon_ref.harness.rows import RunRow
from henon_ref.harness.studies import paired_times
from henon_ref.harness.studies.paired_times import (
    FROM_C,
    OTHERS,
    RATIOS,
    run_paired_times,
    slower_table,
    spread_table,
    timings_of,
)
from henon_ref.harness.studies.pairs import TURN, PairedTiming, PairRow

CASE = case()
READING = CASE.readings[0]
CLOCK = SimpleNamespace(now=0)
"""Nanoseconds; a copy in every worker."""


def row(solver: str, rtol: float, digits: float, wall: float, **changes: object) -> RunRow:
    own = {
        "case": CASE.name, "reading": READING.name, "solver": solver, "rtol": rtol, "atol": 2 * rtol, "wall_s": wall,
        "verdict": "right", "digits": digits, "reference_transitions": 5,
    }  # fmt: skip
    return RunRow(**own | changes)


ROWS = [
    row("henon", 1e-6, 7.0, 1e-5),
    row("henon", 1e-9, 10.0, 2e-5),
    row("henon", 1e-12, 10.0, 1.5e-5, verdict="wrong"),
    row("heyoka", 1e-6, 6.0, 4e-5),
    row("heyoka", 1e-9, 10.0, 3e-5),  # the tighter one is the cheaper one
    row("scipy-dop853", 1e-9, 9.0, 1e-3),
    replace(row("henon-rk4", 0.0, 8.0, 2.5e-5), rtol=None, atol=None, step_s=1e-3),
]


def made(rows: list[RunRow]) -> PairedTiming | None:
    return next(timings_of(CASE, rows, 10.0), None)


def chosen(rows: list[RunRow]) -> list[tuple[int | None, str, list[object], list[object]]]:
    """Digits, what is against whom, settings of the reference, solvers and settings of the rival."""
    timing = made(rows)
    return [] if timing is None else [
        (
            pair.digits,
            pair.against,
            [own.rtol for own in pair.own],
            [(rival.solver, rival.rtol) for rival in pair.rival],
        )
        for pair in timing.pairs
    ]  # fmt: skip


HEYOKA = [("heyoka", 1e-9), ("heyoka", 1e-6)]


def test_the_cheapest_settings_for_the_same_digits_are_timed() -> None:
    assert chosen(ROWS) == [
        (3, "heyoka", [1e-6, 1e-9], HEYOKA),
        (3, OTHERS, [1e-6, 1e-9], [("henon-rk4", None), *HEYOKA]),
        (6, "heyoka", [1e-6, 1e-9], HEYOKA),
        (6, OTHERS, [1e-6, 1e-9], [("henon-rk4", None), *HEYOKA]),
        (9, "heyoka", [1e-9], HEYOKA[:1]),
        (9, OTHERS, [1e-9], [*HEYOKA[:1], ("scipy-dop853", 1e-9)]),
    ]
    timing = made(ROWS)
    assert timing is not None
    assert [entry.wall_s for entry in timing.candidates.values()] == [1e-5, 2e-5, 3e-5, 4e-5, 2.5e-5, 1e-3]
    assert timing.round_s == pytest.approx(6 * TURN)
    assert timing.rounds == 166


def test_where_there_is_no_transition_the_cheapest_right_settings_count() -> None:
    idle = [replace(entry, reference_transitions=0, digits=None) for entry in ROWS]
    assert chosen(idle) == [
        (None, "heyoka", [1e-6, 1e-9], HEYOKA),
        (None, OTHERS, [1e-6, 1e-9], [("henon-rk4", None), *HEYOKA]),
    ]


def test_without_a_rival_or_without_the_reference_nothing_is_timed() -> None:
    assert chosen(ROWS[:3]) == chosen(ROWS[3:]) == []


def test_cvode_from_c_stands_beside_whoever_is_the_cheapest() -> None:
    rows = [
        ROWS[0],
        row("heyoka", 1e-9, 9.5, 1e-5),
        row("cvode-c-bdf", 1e-6, 6.5, 2e-4),
        row("cvode-c-adams", 1e-9, 6.5, 1e-4),
    ]
    assert [(against, rivals) for digits, against, _, rivals in chosen(rows) if digits == 6] == [
        ("heyoka", [("heyoka", 1e-9)]),
        (FROM_C, [("cvode-c-adams", 1e-9), ("cvode-c-bdf", 1e-6)]),
        (OTHERS, [("heyoka", 1e-9), ("cvode-c-adams", 1e-9), ("cvode-c-bdf", 1e-6)]),
    ]


@dataclass(frozen=True)
class Mover(Fake):
    """Moves a clock that nothing else moves, however busy the machine is, and notes who ran."""

    seconds: float = 0.0

    def prepare(self, problem, **given):
        if self.what == "dies":
            os.abort()

        def run():
            CLOCK.now += round(1e9 * self.seconds)
            with Path(self.log).open("a") as file:
                file.write(f"{self.name}\n")
            return trajectory(())

        return run


def reported(folder: Path, rows: list[RunRow]) -> None:
    (folder / CASE.name).mkdir(parents=True)
    (folder / CASE.name / RUNS).write_text(rows_text(RunRow, rows))
    manifest = {"title": CASE.title, "files": []}
    (folder / CASE.name / "manifest.json").write_text(json.dumps(manifest))


def test_the_runs_of_a_reading_are_timed_in_turn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log = tmp_path / "log"
    speeds = {"henon": 0.004, "heyoka": 0.002, "henon-rk4": 0.008}
    movers = {name: Mover(name, log=str(log), seconds=seconds) for name, seconds in speeds.items()}
    monkeypatch.setattr(paired_times, "SECONDS", 0.4)
    monkeypatch.setattr(registry, "solver", movers.__getitem__)
    monkeypatch.setattr(timing, "time", SimpleNamespace(perf_counter_ns=lambda: CLOCK.now))
    rows = [entry for entry in ROWS if entry.solver != "scipy-dop853"]
    reported(tmp_path, rows)
    page = run_paired_times(study_request([CASE], Options(), tmp_path / "rivals", tmp_path)).page
    rows = read_rows(PairRow, tmp_path / "rivals" / RATIOS)
    assert [(row.digits, row.against, row.rival) for row in rows] == [
        (digits, against, "heyoka") for digits in (3, 6, 9) for against in ("heyoka", OTHERS)
    ]
    assert [row.ratio for row in rows] == pytest.approx([2.0] * 6)
    order = log.read_text().split()
    turn = order[: len(order) // (80 + 1)]
    assert sorted(turn) == ["henon", "henon", "henon-rk4", "heyoka", "heyoka"]
    assert order == turn * (80 + 1)
    assert page is not None
    text = page.read_text()
    assert ORIGIN.rerun in text
    assert len(re.findall(rf"\n\| \[{CASE.name}\]\(\.\./{CASE.name}/report\.md\) \| [369] \| 1e-", text)) == 1
    assert "](rivals/README.md)" in write_folder_report(tmp_path).read_text()


def test_a_reading_that_cannot_be_timed_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    movers = {name: Mover(name, log=str(tmp_path / "log")) for name in ("henon", "henon-rk4")}
    monkeypatch.setattr(registry, "solver", (movers | {"heyoka": Mover("heyoka", "dies")}).__getitem__)
    reported(tmp_path, ROWS)
    page = run_paired_times(study_request([CASE], Options(), tmp_path / "rivals", tmp_path)).page
    assert page is not None
    assert (
        f"- {CASE.name}, {READING.name}, against heyoka, {OTHERS}: the library was ended by signal SIGABRT"
        in page.read_text()
    )
    assert read_rows(PairRow, tmp_path / "rivals" / RATIOS) == []
    assert "rivals/README.md" in write_folder_report(tmp_path).read_text()


def test_readings_with_nobody_to_time_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One that nobody else gets to 3 digits, one that the reference does not, one that is idle and timed."""
    idle = [replace(entry, reference_transitions=0, digits=None) for entry in ROWS]
    kinds = {"alone": [*ROWS[:3], row("heyoka", 1e-6, 2.0, 1e-5)], "lost": ROWS[3:], "idle": idle}
    others = [replace(entry, reading=reading) for reading, entries in kinds.items() for entry in entries]
    movers = {name: Mover(name, log=str(tmp_path / "log")) for name in ("henon", "heyoka", "henon-rk4")}
    monkeypatch.setattr(registry, "solver", movers.__getitem__)
    monkeypatch.setattr(paired_times, "SECONDS", 0.01)
    reported(tmp_path, [*ROWS[:5], *others])
    page = run_paired_times(study_request([CASE], Options(), tmp_path / "rivals", tmp_path)).page
    assert page is not None
    text = page.read_text()
    left = text.partition("## Left out")[2].partition("##")[0]
    assert f"- of any other solver: [{CASE.name}, alone](../{CASE.name}/report.md#alone)\n" in left
    assert f"- of `henon`: [{CASE.name}, lost](../{CASE.name}/report.md#lost)\n" in left
    assert "idle" not in left
    assert "on 1 of 4 readings" in text


def test_no_rival_no_page(tmp_path: Path) -> None:
    reported(tmp_path, ROWS[:3])
    assert run_paired_times(study_request([CASE], Options(), tmp_path / "rivals", tmp_path)).page is None
    assert not (tmp_path / "rivals").exists()


def test_ratios_are_told_by_rival_and_digits() -> None:
    def ratio(case: str, reading: str, digits: int | None, rival: str, against: str, value: float) -> PairRow:
        settings = {"rtol": 1e-6, "rival": rival, "rival_rtol": 1e-9, "rival_step_s": None, "rounds": 9}
        times = {"wall_s": 1.2e-4, "rival_wall_s": 6e-5, "ratio": value, "ratio_low": value, "ratio_high": value}
        return PairRow(case, reading, digits, against, **settings, **times)

    rows = [
        ratio("a", "default", 6, "heyoka", "heyoka", 0.25),
        ratio("a", "default", 6, "henon-rk4", OTHERS, 0.5),
        ratio("b", "late", 6, "heyoka", "heyoka", 0.75),
        ratio("b", "late", 6, "heyoka", OTHERS, 0.75),
        ratio("b", "idle", None, "heyoka", "heyoka", 2.0),
        ratio("b", "idle", None, "heyoka", OTHERS, 2.0),
        ratio("c", "default", 12, "scipy-rk45", OTHERS, 1.5),
        ratio("c", "default", 3, "scipy-rk45", OTHERS, 1.25),
        ratio("c", "default", 9, "cvode-c-bdf", FROM_C, 0.5),
    ]
    assert [line[:4] + line[-2:] for line in spread_table(rows).rows] == [
        ("`heyoka`", "6", "2", "1.33", "4", "0"),
        ("`heyoka`", "no transition", "1", "0.5", "0.5", "1"),
        (FROM_C, "9", "1", "2", "2", "0"),
        (OTHERS, "3", "1", "0.8", "0.8", "1"),
        (OTHERS, "6", "2", "1.33", "2", "0"),
        (OTHERS, "12", "1", "0.667", "0.667", "1"),
        (OTHERS, "no transition", "1", "0.5", "0.5", "1"),
    ]
    runs = [
        row("henon", 1e-6, 12.5, 1.0, case="c", reading="default", steps=1074),
        row("henon", 1e-9, 14.5, 1.0, case="c", reading="default", steps=9),
        replace(row("henon", 1e-6, 0.0, 1.0, case="b", reading="idle", steps=3), digits=None),
        row("scipy-rk45", 1e-9, 12.0, 1.0, case="c", reading="default", steps=112),
    ]
    own, rival = ("1e-6", "12.5", "1074", "0.12 ms"), ("1e-9", "12", "112", "60 µs")
    assert slower_table(rows, runs).rows == [
        ("[b, idle](../b/report.md#idle)", "no transition", "1e-6", "", "3", "0.12 ms",
         "`heyoka`", "1e-9", "", "", "60 µs", "2"),
        ("[c](../c/report.md)", "12", *own, "`scipy-rk45`", *rival, "1.5"),
    ]  # fmt: skip


def test_a_reading_is_set_against_rows_of_its_own() -> None:
    assert chosen([replace(entry, reading="other") for entry in ROWS]) == []
