"""The page of a sweep: diagram or map, and the run of a point, which is also shown as a case file."""

from __future__ import annotations

import re
import shutil
from base64 import b64decode
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from html_pages import MOST_BYTES, SCHEMES, SIZES, opened, serious, sideways
from sweep_systems import SWEEP, belt, sliding_block

import henon_ref
from henon_ref.errors import CaseError
from henon_ref.harness.cli.main import sweep_program as program
from henon_ref.harness.report import sweep_page
from henon_ref.harness.report.folder import check_index
from henon_ref.harness.report.rendering import read_embedded
from henon_ref.harness.report.sweep_page import (
    MAX_PORTRAITS,
    frame_content,
    kept_points,
    read_table,
    rows_of,
    write_sweep_page,
)
from henon_ref.sweeps.plan import planned

EVIL = "</script><img src=//evil.example/x.png>{{ 7*7 }}"
LINE = SWEEP.replace("    x: [-1, 0, 1.5]\n", "").replace("name: belts", "name: line")
"""The same over the belt's speed alone."""


def swept(folder: Path, text: str) -> Path:
    """The folder of a sweep that the command has run."""
    file = folder / "sweep_file.yaml"
    file.write_text(text)
    assert program([str(file), "--jobs", "1", "--quiet", "--out", str(folder / "out")]) == 0
    (made,) = (folder / "out").iterdir()
    return made


@pytest.fixture(scope="module")
def belts(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A grid of two names, whose page no test changes."""
    return swept(tmp_path_factory.mktemp("belts"), SWEEP)


@pytest.fixture(scope="module")
def line(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One name, with section points."""
    return swept(tmp_path_factory.mktemp("line"), LINE)


def data_of(folder: Path) -> dict[str, Any]:
    return dict(read_embedded((folder / "index.html").read_text(encoding="utf-8")))


def test_the_page_holds_the_points_and_a_run_of_each_of_a_few(belts: Path) -> None:
    data = data_of(belts)
    assert (data["count"], data["swept"], data["coloured"]) == (15, ["vb", "x"], "final_mode")
    assert [own["point"] for own in data["runs"]] == list(range(15))
    assert {own["status"] for own in data["runs"]} == {"ok"}
    assert data["runs"][0]["values"] == [0.05, -1.0]
    assert [own["name"] for own in data["frames"]] == ["section"]
    assert (belts / "index.html").stat().st_size < MOST_BYTES


def test_the_page_is_made_from_the_folder_alone_and_stays_the_same(belts: Path, tmp_path: Path) -> None:
    shutil.copytree(belts, tmp_path / "copy")
    before = (belts / "index.html").read_bytes()
    (tmp_path / "copy" / "index.html").unlink()
    assert write_sweep_page(tmp_path / "copy") == tmp_path / "copy" / "index.html"
    assert (tmp_path / "copy" / "index.html").read_bytes() == before
    with pytest.raises(CaseError, match=r"index\.html: is the page of a sweep; choose another folder"):
        check_index(tmp_path / "copy")


def test_a_sweep_from_python_with_a_folder_has_a_page(tmp_path: Path) -> None:
    how = {"until": 20, "grid": {"vb": [0.2, 0.5]}, "observe": [henon_ref.observe.final_state()], "jobs": 1}
    table = henon_ref.sweep(belt(), {"x": 1.5, "v": 0}, out=tmp_path / "belts", **how)
    assert len(data_of(tmp_path / "belts")["runs"]) == len(table) == 2
    alone = henon_ref.sweep(belt(), {"x": 1.5, "v": 0}, **how)
    assert alone.equals(table)


def test_the_points_of_a_chain_are_no_runs_by_themselves(tmp_path: Path) -> None:
    points = henon_ref.points.continuation({"F": [1, 2, 3]})
    last = [henon_ref.observe.final_state()]
    henon_ref.sweep(sliding_block(), {"x": 0, "v": 1}, until=9, grid=points, observe=last, out=tmp_path / "a", jobs=1)
    data = data_of(tmp_path / "a")
    assert (data["runs"], data["case"]) == ([], None)
    assert "neighbour" in data["no_runs"]


def test_a_page_of_an_earlier_sweep_does_not_outlive_its_results(tmp_path: Path, monkeypatch) -> None:
    made = swept(tmp_path, SWEEP)

    def interrupted(*arguments: object, **options: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("henon_ref.sweeps.sweep.done", interrupted)
    assert program([str(tmp_path / "sweep_file.yaml"), "--jobs", "1", "--quiet", "--out", str(tmp_path / "out")]) == 130
    assert not (made / "index.html").exists()


def test_what_a_stranger_writes_is_text(tmp_path: Path) -> None:
    evil = SWEEP.replace("title: Sticks", f'title: "{EVIL}" #').replace("source: my", f'source: "{EVIL}" #')
    made = swept(tmp_path, evil)
    text = (made / "index.html").read_text()
    assert text.count("</script>") == 2
    assert "<img" not in text
    assert "{{ 7*7 }}" in text


def test_of_many_points_so_many_are_kept_as_there_is_room_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sweep_page, "POINT_BYTES", 1000)
    axes = {"vb": {"from": 0.1, "to": 1, "count": 40}, "x": {"from": -1, "to": 1, "count": 30}}
    plan = planned(belt(), {"x": 0, "v": 0}, until=1, grid=axes, observe=[])
    kept = kept_points(plan, 10)
    values = plan.points.values[kept]
    assert len(kept) <= 100
    assert len(kept) == len(np.unique(values[:, 0])) * len(np.unique(values[:, 1])) > 50
    drawn = henon_ref.points.random({"x": {"uniform": [-1, 1]}}, count=999, seed=1)
    kept = kept_points(planned(belt(), {"x": 0, "v": 0}, until=1, grid=drawn, observe=[]), 10)
    assert 50 < len(kept) <= 100
    assert kept.max() > 900


def test_rows_of_a_table_are_thinned_and_keep_their_points(monkeypatch: pytest.MonkeyPatch) -> None:
    frame = pd.DataFrame({"point": np.repeat(np.arange(100), 10), "x": np.linspace(-1, 1, 1000)})
    monkeypatch.setattr(sweep_page, "ROW_BYTES", 1600)
    made = frame_content("section", frame, 5000, np.arange(0, 100, 2), tables=1)
    place = np.frombuffer(b64decode(made["point"]), "<u4")
    (column,) = made["columns"]
    values = np.frombuffer(b64decode(column["data"]), "<f4")
    assert made["rows"] == 5000
    assert 100 < len(place) <= 200
    assert np.array_equal(np.round((values + 1) / 2 * 999).astype(int) // 10, 2 * place)


@pytest.mark.parametrize(("size", "scheme"), list(zip(SIZES, SCHEMES, strict=True)), ids=str)
def test_it_is_as_wide_as_its_window_and_has_no_serious_finding(
    chromium: Any, belts: Path, line: Path, size: tuple[int, int], scheme: str
) -> None:
    for folder in (belts, line):
        with opened(chromium, folder / "index.html", size=size, scheme=scheme) as seen:
            seen.page.locator("#portrait svg").wait_for()
            assert serious(seen.page) == []
            assert sideways(seen.page) <= 0


def test_a_map_shows_its_cells_and_a_click_chooses_a_point(chromium: Any, belts: Path, tmp_path: Path) -> None:
    shutil.copy(belts / "index.html", tmp_path)
    with opened(chromium, tmp_path / "index.html") as seen:
        page = seen.page
        assert page.title() == "Sticks over the belt's speed and the start (henon_ref sweep)"
        shares = page.locator("#colour-key").inner_text()
        assert shares.startswith("Of 15 points:")
        assert sum(float(share) for share in re.findall(r"([0-9.]+) %", shares)) == pytest.approx(100, abs=0.2)
        box = page.locator("#drawing svg").bounding_box()
        page.mouse.click(box["x"] + 70, box["y"] + 380)  # lower left
        assert page.locator("#point-text").inner_text() == "point 0"
        page.mouse.move(box["x"] + box["width"] - 20, box["y"] + 15)
        assert "point 14" in page.locator(".tooltip").inner_text()
        assert page.locator("#portrait path.piece").count() > 1
        page.locator("#colour").select_option("stick_count")
        assert page.locator("#colour-key .ramp").count() == 1


def test_a_bifurcation_diagram_leads_to_the_run_of_each_point(chromium: Any, line: Path) -> None:
    points = pd.read_parquet(line / "points")
    with opened(chromium, line / "index.html") as seen:
        page = seen.page
        assert page.locator("#what").input_value() == "section"
        assert page.locator("#drawing svg").get_attribute("aria-label").endswith("x at section over vb")
        page.locator("#point").focus()
        page.keyboard.press("End")
        assert page.locator("#point-text").inner_text() == "point 4"
        values = dict(row.split("\t") for row in page.locator("#values tbody tr").all_inner_texts())
        assert float(values["vb"]) == points["vb"][4]
        assert float(values["final_x"]) == pytest.approx(points["final_x"][4], rel=1e-6)
        assert page.locator("#portrait-note").inner_text().startswith("This point's run; ")


def test_the_case_file_of_a_point_is_its_run(chromium: Any, belts: Path, tmp_path: Path) -> None:
    points = pd.read_parquet(belts / "points")
    with opened(chromium, belts / "index.html") as seen:
        page = seen.page
        for k in (0, 7, 13):
            page.locator("#point").evaluate(
                "(node, k) => { node.value = k; node.dispatchEvent(new Event('input')); }", str(k)
            )
            text = page.locator("#case-text").inner_text()
            assert page.locator("#case-command").inner_text() == f"henon-ref simulate belts_point_{k}.yaml --rtol 1e-9"
            with page.expect_download() as download:
                page.locator("#case-link").click()
            assert Path(download.value.path()).read_text().strip() == text.strip()
            (tmp_path / "point.yaml").write_text(text)
            system = henon_ref.System.from_case(tmp_path / "point.yaml")
            run = henon_ref.simulate(system, system.initial, until=system.until, rtol=1e-9)
            assert dict(zip(system.state, run.trajectory.end_state, strict=True)) == pytest.approx(
                {"x": points["final_x"][k], "v": points["final_v"][k]}, rel=1e-6, abs=1e-8
            )


def test_no_more_runs_are_kept_than_a_page_has_room_for(tmp_path: Path) -> None:
    axes = {"vb": {"from": 0.1, "to": 1, "count": 12}, "x": {"from": -1, "to": 1, "count": 12}}
    henon_ref.sweep(belt(), {"x": 1.5, "v": 0}, until=5, grid=axes, observe=[], out=tmp_path / "many", jobs=1)
    runs = data_of(tmp_path / "many")["runs"]
    assert len(runs) == MAX_PORTRAITS
    assert runs[0]["values"] == [0.1, -1.0]
    assert runs[-1]["values"] == [1.0, 1.0]


def test_of_many_rows_some_are_read_and_of_too_many_points_no_page_is_made(
    line: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    whole = read_table(line, "section")
    assert len(whole) == rows_of(line, "section") > 11
    for most in (10, 11, len(whole)):
        stride = -(-len(whole) // most)
        pd.testing.assert_frame_equal(read_table(line, "section", most=most), whole[::stride].reset_index(drop=True))
    shutil.copytree(line, tmp_path / "line")
    (tmp_path / "line" / "index.html").unlink()
    monkeypatch.setattr(sweep_page, "MOST_READ", 4)
    assert write_sweep_page(tmp_path / "line") is None
    assert "has no page: it has more than 4 points" in caplog.text
    assert not (tmp_path / "line" / "index.html").exists()
