"""The page of a folder of reports, as text: one small file with the numbers of the rows, all text escaped."""

from __future__ import annotations

import json
import re
import shutil
from collections import Counter
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from fakes import CASE, case
from html_pages import MOST_BYTES, RUNS, comparison, made_folder, two_readings
from made_reports import ORIGIN, changed

import henon_ref
from henon_ref.errors import CaseError
from henon_ref.figures.motion import Motion
from henon_ref.harness import registry
from henon_ref.harness.campaign.options import MOST_DRAWN
from henon_ref.harness.cli.stored import page_differences
from henon_ref.harness.report.case_report import write_report
from henon_ref.harness.report.choice import choice_rows, choice_table
from henon_ref.harness.report.folder_report import (
    CELL,
    FIELDS,
    PROJECTS,
    few_readings,
    page_text,
    run_values,
    write_folder_report,
)
from henon_ref.harness.report.matrix import MatrixRow, read_matrix
from henon_ref.harness.report.rendering import (
    CELLS,
    MIN_CONTRAST,
    MOST_POINTS,
    NIGHT,
    PAPER,
    contrast,
    embedded,
    read_embedded,
    solver_lines,
)
from henon_ref.harness.report.rendering import packed as packed_portrait
from henon_ref.harness.result_files import read_rows
from henon_ref.harness.rows import RunRow

ROOT = Path(__file__).parents[3]
EVIL = (
    "</script><script>alert(1)</script><!-- <img src=//evil.example/x.png onerror=alert(2)> \u2028 \u202e {{ 7*7 }} ]]>"
)
SHOWN = " ".join(EVIL.replace("\u2028", " ").replace("\u202e", " ").split())
"""The same without what does not print."""


def data_of(page: Path) -> dict:
    return read_embedded(page.read_text(encoding="utf-8"))


class Tags(HTMLParser):
    """The elements of a page: name and attributes."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None]]] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs)))


def test_every_built_in_solver_is_of_a_project_with_an_address_and_a_line() -> None:
    for package, (address, line) in PROJECTS.items():
        assert address.startswith("https://") or package == "henon-ref"
        assert 10 < len(line) < 90
    assert {file.distribution for file in registry.FILES} == set(PROJECTS)


def test_solvers_that_were_run_on_few_readings_stand_apart() -> None:
    every = [("a", "1"), ("a", "2"), ("b", "1")]
    ran = {"often": every, "half": every[:2], "seldom": every[:1]}
    rows = [MatrixRow(case, reading, None, solver) for solver, own in ran.items() for case, reading in own]
    assert few_readings(rows) == {"seldom"}


def test_the_page_has_the_numbers_of_the_rows(reports: Path) -> None:
    data = data_of(reports)
    solvers = [own["name"] for own in data["solvers"]]
    assert [own["name"] for own in data["cases"]] == ["first", "second"]
    for own in data["cases"]:
        (reading,) = own["readings"]
        rows = [row for row in read_matrix(reports.parent) if row.case == own["name"]]
        for row, (solver, *cell) in zip(rows, reading["cells"], strict=True):
            assert row.solver == solvers[solver]
            for value, known in zip(cell, row.values(CELL), strict=True):
                assert value == (pytest.approx(known, rel=1e-5) if isinstance(known, float) else known)
        runs = [row for row in read_rows(RunRow, reports.parent / own["name"] / "runs.csv") if row.solver == "henon"]
        for row, run in zip(runs, reading["runs"][str(solvers.index("henon"))], strict=True):
            shown = dict(zip(FIELDS, run, strict=True))
            assert shown["max_time_error_s"] == pytest.approx(row.max_time_error_s, rel=0.05)
            assert shown["wall_s"] == pytest.approx(row.wall_s, rel=1e-3)
            assert shown["verdict"] == "right"
        assert own["tags"] == ["made-up", own["name"]]
        assert reading["portrait"]["names"] == ["t", "x"]
        assert {"report.md", "runs.csv"} <= set(own["files"])


def test_a_run_has_what_is_shown_of_it_and_no_more_digits() -> None:
    row = RunRow(
        "made_up", "default", "henon", rtol=1e-9, status="wrong", verdict="solver defect", digits=3.14159, missed=2,
        spurious=0, max_time_error_s=7.2468e-4, status_reason="it\nfailed \u202e", steps=123456,
    )  # fmt: skip
    back = dict(zip(FIELDS, run_values(row), strict=True))
    assert {name: value for name, value in back.items() if value is not None} == {
        "setting": "1e-9", "status": "wrong", "verdict": "solver defect", "digits": 3.141, "missed": 2,
        "max_time_error_s": 7.2e-4, "status_reason": "it failed", "steps": 123456,
    }  # fmt: skip


def test_a_portrait_has_few_points_none_of_which_lies_beside_the_curve() -> None:
    angle = np.linspace(0, 40 * np.pi, 20_000)
    points = np.column_stack([np.cos(angle), 3 * np.sin(angle)]) * np.exp(-angle / 100)[:, None]
    system = henon_ref.System(state=["x", "v"], field=["v", "-x - s"], surfaces={"s": "v - 9"}).model
    made = packed_portrait(system, Motion(angle, points, ((1,),) * len(angle)))
    assert made["names"] == ["x", "v"]
    (piece,) = made["pieces"]
    low, high = np.array(made["limits"]).T
    size = high - low
    steps = np.array(piece[1].split(), dtype=int).reshape(-1, 2)
    kept = steps.cumsum(axis=0) / CELLS * size + low
    assert 40 < len(kept) <= MOST_POINTS
    for point in kept[:: len(kept) // 40]:
        assert np.min(np.hypot(*((points - point) / size).T)) < 0.02
    ends = np.abs((kept[[0, -1]] - points[[0, -1]]) / size)
    assert ends.max() < 1 / CELLS


def test_the_page_is_one_file_without_an_address_but_those_of_projects(reports: Path) -> None:
    text = reports.read_text()
    for address, _ in PROJECTS.values():
        text = text.replace(f'"{address}"', '""')
    tags = Tags(text).found
    assert not {name for name, _ in tags} & {"iframe", "object", "embed", "img", "audio", "video", "base"}
    assert {own["href"] for name, own in tags if name == "link"} == {"data:,"}
    assert not [own for name, own in tags if name == "script" and "src" in own]
    assert not re.search(r"url\(\s*[^#)]|@import|\bfetch\(|XMLHttpRequest|https?://(?!www\.w3\.org)", text)
    assert {name for name, _ in tags} >= {"title", "table", "input", "select", "main", "h1"}
    assert reports.stat().st_size < MOST_BYTES


def test_links_lead_to_files_that_are_there(reports: Path) -> None:
    links = [
        own["href"] for name, own in Tags(reports.read_text()).found if name == "a" and not own["href"].startswith("#")
    ]
    assert links == ["README.md", "matrix.csv"]
    for own in data_of(reports)["cases"]:
        assert all((reports.parent / own["name"] / file).is_file() for file in own["files"])


def test_what_a_stranger_writes_is_text_and_no_part_of_the_page(tmp_path: Path) -> None:
    told = f"tags: [{json.dumps(SHOWN)}]\nstory: {json.dumps(SHOWN)}\n".replace("{", "{{").replace("}", "}}")
    evil = case("evil", CASE + told)
    evil = replace(evil, title=EVIL, source=EVIL)
    made = comparison("evil", evil, {"henon": ("right", 1e-3), f"a{EVIL}": ("misses", 1e-3)})
    made.records[-1] = changed(made.records[-1], status_reason=EVIL, verdict_basis=EVIL)
    write_report(made, ORIGIN, tmp_path)
    write_folder_report(tmp_path)
    text = (tmp_path / "index.html").read_text()
    tags = Tags(text).found
    assert len([name for name, _ in tags if name == "script"]) == 2
    assert not [name for name, _ in tags if name == "img"]
    assert "alert(1)</script>" not in text
    data = read_embedded(text)
    for reading in data["cases"][0]["readings"]:
        del reading["portrait"]  # numbers
    assert "7*7" in str(data)
    assert " 49 " not in text + str(data)
    assert data["cases"][0]["title"] == SHOWN
    assert data["solvers"][1]["name"].startswith("a</script>")


def test_data_within_a_page_end_nothing_and_come_back() -> None:
    data = {"<!--": ["</script", "\u2028&amp;", 1e-7, None, {"b": True}]}
    text = embedded(data)
    assert re.fullmatch("[A-Za-z0-9+/=]+", text)
    assert read_embedded(f'<script type="application/zlib" id="data">{text}</script>') == data
    assert read_embedded("<p>nothing</p>") is None


@pytest.mark.parametrize("kept", ["first", "second"])
def test_the_page_keeps_the_runs_of_cases_whose_folders_are_gone(tmp_path: Path, kept: str) -> None:
    page = made_folder(tmp_path)
    before = data_of(page)
    for own in before["cases"]:
        if own["name"] != kept:
            shutil.rmtree(tmp_path / own["name"])
    write_folder_report(tmp_path)
    after = data_of(page)
    for own in before["cases"]:
        if own["name"] != kept:
            del own["files"]
    assert after["cases"] == before["cases"]
    write_folder_report(tmp_path)
    assert data_of(page) == after


def test_each_reading_has_its_own_portrait_and_no_other(tmp_path: Path) -> None:
    write_report(two_readings(), ORIGIN, tmp_path)
    write_folder_report(tmp_path)
    page = tmp_path / "index.html"
    (own,) = data_of(page)["cases"]
    belt, belt_limit = own["readings"]
    assert belt["portrait"]["window"] == [0.0, 5.0]
    assert belt_limit["portrait"]["window"] == [0.0, 4.0]
    assert belt["portrait"]["pieces"] != belt_limit["portrait"]["pieces"]


def test_a_comparison_of_another_solver_adds_its_runs_to_a_case(tmp_path: Path) -> None:
    page = made_folder(tmp_path)
    before = data_of(page)
    assert "the solvers were run on" not in page.read_text()
    shutil.rmtree(tmp_path / "first")
    bare = comparison("first", solvers={"octave-ode45": ("right", 1e-2)})
    bare.readings[0].samples = None  # as without figures
    write_report(bare, replace(ORIGIN, commit="f" * 40), tmp_path)
    write_folder_report(tmp_path)
    data, (old, _) = data_of(page), before["cases"]
    first, second = data["cases"]
    names = [own["name"] for own in data["solvers"]]
    (reading,), (known,) = first["readings"], old["readings"]
    assert [names[cell[0]] for cell in reading["cells"]] == ["henon", "heyoka", "ida", "scipy-rk45", "octave-ode45"]
    assert set(reading["runs"]) == {str(names.index(own)) for own in (*RUNS["first"], "octave-ode45")}
    assert len(reading["runs"][str(names.index("henon"))]) == len(known["runs"]["0"])
    assert reading["portrait"] == known["portrait"]
    assert reading["commit"] == "0123456789ab, ffffffffffff"
    assert second["readings"][0]["runs"].keys() == before["cases"][1]["readings"][0]["runs"].keys()
    told = "Of 2 readings the solvers were run on 2: henon, heyoka, ida, scipy-rk45; 1: octave-ode45."
    assert told in page.read_text()
    write_folder_report(tmp_path)
    assert data_of(page) == data
    assert page_differences(tmp_path) == []


def test_a_case_that_only_the_matrix_knows_has_its_cells(tmp_path: Path) -> None:
    page = made_folder(tmp_path)
    for name in ("first", "second"):
        shutil.rmtree(tmp_path / name)
    page.unlink()
    write_folder_report(tmp_path)
    readings = [own["readings"][0] for own in data_of(page)["cases"]]
    assert [reading["runs"] for reading in readings] == [{}, {}]
    assert [len(reading["cells"]) for reading in readings] == [4, 4]


@pytest.mark.parametrize(
    "damage", ["not JSON", "[]", '{"title": "t", "readings": []}', '{"title": "t", "readings": {"default": 3}}']
)
def test_a_manifest_that_somebody_has_changed_costs_its_own_words_only(tmp_path: Path, damage: str) -> None:
    page = made_folder(tmp_path)
    (tmp_path / "first" / "manifest.json").write_text(damage)
    write_folder_report(tmp_path)
    assert [own["name"] for own in data_of(page)["cases"]] == ["first", "second"]


@pytest.mark.parametrize("damage", ["", "<p>", "{", "eNqLjgUAARUAuQ=="])
def test_a_page_whose_data_somebody_has_changed_is_kept(tmp_path: Path, damage: str) -> None:
    """It may be the only place with the runs of a case."""
    page, matrix = made_folder(tmp_path), tmp_path / "matrix.csv"
    whole = page.read_text()
    page.write_text(
        re.sub(r'(id="data">).*?(</script>)', lambda found: found[1] + damage + found[2], whole, flags=re.DOTALL)
    )
    before = page.read_text(), matrix.read_text()
    shutil.rmtree(tmp_path / "first")
    with pytest.raises(CaseError, match=r"index\.html: its data, which cases without a folder need, cannot be read"):
        write_folder_report(tmp_path)
    assert (page.read_text(), matrix.read_text()) == before


def test_a_page_of_somebody_else_is_not_replaced(tmp_path: Path) -> None:
    (tmp_path / "index.html").write_text("<!doctype html><title>mine</title>")
    with pytest.raises(CaseError, match="was not written by henon_ref"):
        made_folder(tmp_path)
    assert (tmp_path / "index.html").read_text() == "<!doctype html><title>mine</title>"


def test_the_check_tells_of_a_page_that_is_older_than_its_rows(tmp_path: Path) -> None:
    assert page_differences(tmp_path) == []  # no page, nothing to compare
    page = made_folder(tmp_path)
    assert page_differences(tmp_path) == []
    runs = tmp_path / "first" / "runs.csv"
    runs.write_text(runs.read_text().replace("it is not installed", "it is gone"))
    (told,) = page_differences(tmp_path)
    assert told.startswith(f"{page} does not agree with ")


def test_the_table_of_the_page_is_that_of_the_index(reports: Path) -> None:
    (row,) = choice_rows(read_matrix(reports.parent), 6)
    assert row == ("stick-slip", "2", "henon", "2", "0.25 ms", "scipy-rk45", "2", "×580")
    index = (reports.parent / "README.md").read_text()
    assert "| stick-slip | 2 | `henon` 2; `scipy-rk45` 2 (×580)" in index


def test_a_row_says_of_how_many_readings_its_digits_are(tmp_path: Path) -> None:
    """Where some readings of a kind have no transition to time, there are fewer for digits than in the index."""
    write_folder_report(tmp_path)
    rows = [MatrixRow("one", f"r{k}", "graze or close roots", "henon", 1, 1, 1, wall_s=1.0) for k in range(3)]
    rows[0] = replace(rows[0], digits=9.5, wall_9_s=1.0)
    assert [choice_rows(rows, level)[0][:4] for level in (None, 9, 12)] == [
        ("graze or close roots", "3", "henon", "3"),
        ("graze or close roots", "1 of 3", "henon", "1"),
        ("graze or close roots", "1 of 3", "none", ""),
    ]  # fmt: skip
    (line,) = choice_table(rows).rows
    assert line[:2] == ("graze or close roots", "3, 1 timed")


def test_a_folder_without_reports_has_a_page(tmp_path: Path) -> None:
    write_folder_report(tmp_path)
    assert data_of(tmp_path / "index.html")["cases"] == []


def test_the_page_of_the_whole_suite_is_small(tmp_path: Path) -> None:
    """Every row of the committed matrix, each with the three runs that its solver may have had."""
    rows = read_matrix(ROOT / "reports")
    assert len({row.case for row in rows}) > 60
    bare = len(page_text(rows, tmp_path))
    run = {"status": "failed", "verdict": "solver defect", "digits": 11.123456789}
    run |= dict.fromkeys(set(FIELDS) - set(run) - {"setting"}, 1.2345678e-12)
    own = (
        len(embedded([run_values(RunRow("made_up", "default", "henon", rtol=1e-9 * k, **run)) for k in range(99)])) / 99
    )
    readings = Counter(case for case, _ in {(row.case, row.reading) for row in rows})
    portraits = sum(min(count, MOST_DRAWN) for count in readings.values()) * 4000  # the committed ones have up to 3,200
    assert bare + 3 * len(rows) * own + portraits < MOST_BYTES


def test_lines_are_seen_on_light_and_dark_pages() -> None:
    for own in solver_lines(["henon", "heyoka", "scipy-lsoda", "cvode-bdf", "scipy-sign", "a-solver-of-mine"]).values():
        assert contrast(str(own["light"]), PAPER) >= MIN_CONTRAST
        assert contrast(str(own["dark"]), NIGHT) >= MIN_CONTRAST
