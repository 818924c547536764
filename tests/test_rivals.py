"""Rivals in turn: who is timed against whom, and what the page and the index say of it."""

from __future__ import annotations

import json
import os
import time
from dataclasses import dataclass, replace
from pathlib import Path

import pytest
from fakes import Fake, case, trajectory

from henon_ref import registry
from henon_ref.columns import RUN_COLUMNS
from henon_ref.report import index
from henon_ref.report.csvfiles import csv_text
from henon_ref.report.manifest import provenance
from henon_ref.report.write import RUNS
from henon_ref.rivals.duel import duel
from henon_ref.rivals.experiment import run_rivals
from henon_ref.rivals.page import OTHERS, against, read_ratios, slower_table, spread_table
from henon_ref.score.options import Options, Silent
from henon_ref.score.settings import Setting

CASE = case()
READING = CASE.readings[0]


def row(solver: str, rtol: float, error: float, wall: float, **changes: object) -> dict[str, object]:
    plain = dict.fromkeys(RUN_COLUMNS)
    return plain | {
        "case": CASE.name, "reading": READING.name, "solver": solver, "rtol": rtol, "atol": 2 * rtol, "wall_s": wall,
        "max_time_error_s": error, "verdict": "right", "digits": 7.0, "reference_transitions": 5,
    } | changes  # fmt: skip


ROWS = [
    row("henon", 1e-6, 1e-7, 1e-5),
    row("henon", 1e-9, 1e-10, 2e-5),
    row("henon", 1e-12, 1e-10, 1.5e-5, verdict="wrong"),
    row("heyoka", 1e-6, 1e-6, 4e-5),
    row("heyoka", 1e-9, 1e-10, 3e-5),  # the tighter one is the cheaper one
    row("scipy-dop853", 1e-9, 1e-9, 1e-3),
    row("henon-rk4", 0.0, 1e-8, 2.5e-5) | {"rtol": None, "atol": None, "step_s": 1e-3},
]


def chosen(rows: list[dict[str, object]]) -> list[tuple[float | None, str, float | None, str, float | None]]:
    made = duel(rows, READING.name, READING.problem, 10.0)
    return [(error, a, own.rtol, b, rival.rtol) for error, (a, own), (b, rival) in made.pairs] if made else []


def test_each_is_at_its_cheapest_setting_within_the_bound() -> None:
    assert chosen(ROWS) == [
        (1e-6, "henon", 1e-6, "heyoka", 1e-9),
        (1e-6, "henon", 1e-6, "henon-rk4", None),
        (1e-9, "henon", 1e-9, "heyoka", 1e-9),
    ]
    made = duel(ROWS, READING.name, READING.problem, 10.0)
    assert made is not None
    assert made.pairs[1][2] == ("henon-rk4", Setting(None, None, 1e-3))
    assert made.wall_s == pytest.approx(1e-5 + 2e-5 + 3e-5 + 2.5e-5)


def test_where_there_is_no_transition_the_cheapest_right_setting_counts() -> None:
    idle = [entry | {"reference_transitions": 0, "max_time_error_s": None, "digits": None} for entry in ROWS]
    assert chosen(idle) == [(None, "henon", 1e-6, "heyoka", 1e-9), (None, "henon", 1e-6, "henon-rk4", None)]


def test_without_a_rival_or_without_the_reference_nothing_is_timed() -> None:
    assert chosen(ROWS[:3]) == chosen(ROWS[3:]) == []


@dataclass(frozen=True)
class Sleeper(Fake):
    """Takes a while, and notes who ran."""

    seconds: float = 0.0

    def prepare(self, problem, **given):
        if self.what == "dies":
            os.abort()

        def run():
            time.sleep(self.seconds)
            with Path(self.log).open("a") as file:
                file.write(f"{self.name}\n")
            return trajectory(())

        return run


def reported(folder: Path, rows: list[dict[str, object]]) -> None:
    (folder / CASE.name).mkdir(parents=True)
    (folder / CASE.name / RUNS).write_text(csv_text(RUN_COLUMNS, rows))
    manifest = {"title": CASE.title, "files": []}
    (folder / CASE.name / "manifest.json").write_text(json.dumps(manifest))


def test_the_runs_of_a_reading_are_timed_in_turn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log = tmp_path / "log"
    speeds = {"henon": 0.004, "heyoka": 0.002, "henon-rk4": 0.008}
    made = {name: Sleeper(name, log=str(log), seconds=seconds) for name, seconds in speeds.items()}
    monkeypatch.setattr(registry, "solver", made.__getitem__)
    reported(tmp_path, ROWS)
    page = run_rivals([CASE], Options(), provenance("again"), tmp_path, Silent())
    rows = read_ratios(tmp_path)
    assert against(rows, "heyoka", 1e-6)[CASE.name, READING.name] == pytest.approx(2.0, rel=0.5)
    assert against(rows, "henon-rk4", 1e-6)[CASE.name, READING.name] == pytest.approx(0.5, rel=0.5)
    assert against(rows, OTHERS, 1e-6) == against(rows, "heyoka", 1e-6)
    order = log.read_text().split()
    turn = order[: len(order) // 61]
    assert sorted(turn) == ["henon", "henon", "henon-rk4", "heyoka"]  # two settings of henon
    assert order == turn * 61
    assert page is not None
    text = page.read_text()
    assert "again" in text
    assert f"| [{CASE.name}](../{CASE.name}/report.md) | 1e-06 s | `heyoka` |" in text
    listed = index.write_index(tmp_path).read_text()
    assert "`henon` against its rivals" in listed
    assert f"| [{CASE.name}]({CASE.name}/report.md) | 1e-06 s | `heyoka` |" in listed
    assert "[Rivals in turn](rivals/README.md)" in listed


def test_a_reading_that_cannot_be_timed_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = {name: Sleeper(name, log=str(tmp_path / "log")) for name in ("henon", "henon-rk4")}
    monkeypatch.setattr(registry, "solver", (made | {"heyoka": Sleeper("heyoka", "dies")}).__getitem__)
    reported(tmp_path, ROWS)
    page = run_rivals([CASE], Options(), provenance("again"), tmp_path, Silent())
    assert page is not None
    assert f"- {CASE.name}, {READING.name}: the library was ended by signal SIGABRT" in page.read_text()
    assert read_ratios(tmp_path) == []
    assert "`henon` against heyoka" in index.write_index(tmp_path).read_text()


def test_no_rival_no_page(tmp_path: Path) -> None:
    reported(tmp_path, ROWS[:3])
    assert run_rivals([CASE], Options(), provenance("again"), tmp_path, Silent()) is None
    assert not (tmp_path / "rivals").exists()


def test_ratios_are_told_by_rival_and_bound() -> None:
    ratio = dict.fromkeys(("rtol", "rival_rtol", "rival_step_s", "rounds")) | {"wall_s": 2e-6, "rival_wall_s": 1e-6}
    rows = [
        ratio | {"case": "a", "reading": "default", "worst_error_s": 1e-6, "rival": "heyoka", "ratio": 0.25},
        ratio | {"case": "a", "reading": "default", "worst_error_s": 1e-6, "rival": "henon-rk4", "ratio": 0.5},
        ratio | {"case": "b", "reading": "late", "worst_error_s": 1e-6, "rival": "heyoka", "ratio": 0.75},
        ratio | {"case": "b", "reading": "idle", "worst_error_s": None, "rival": "heyoka", "ratio": 2.0},
    ]
    assert [line[:4] + line[-2:] for line in spread_table(rows).rows] == [
        ("`heyoka`", "1e-06 s", "2", "0.25", "0.75", "0"),
        ("`heyoka`", "no transition", "1", "2", "2", "1"),
        (OTHERS, "1e-06 s", "2", "0.5", "0.75", "0"),
        (OTHERS, "no transition", "1", "2", "2", "1"),
    ]
    assert slower_table(rows).rows == [
        ("[b, idle](../b/report.md#idle)", "no transition", "`heyoka`", "2 us", "1 us", "2")
    ]


@pytest.mark.parametrize("text", ["", "case,reading\na,b\n", "case,reading\na,b,c\n"])
def test_what_is_no_list_of_ratios_is_none(text: str, tmp_path: Path) -> None:
    (tmp_path / "rivals").mkdir()
    (tmp_path / "rivals" / "ratios.csv").write_text(text)
    assert read_ratios(tmp_path) == []


def test_a_case_keeps_its_readings_apart() -> None:
    other = [entry | {"reading": "other"} for entry in ROWS]
    assert replace(duel(other, "other", READING.problem, 10.0), reading=READING.name) == duel(
        ROWS, READING.name, READING.problem, 10.0
    )
