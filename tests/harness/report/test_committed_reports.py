"""The committed ``reports/``: small, without dead links, and an index that equals the one made from the matrix."""

from __future__ import annotations

from pathlib import Path

import pytest
from html_pages import MOST_BYTES as MOST_BYTES_OF_A_PAGE

from henon_ref.harness.cli.stored import page_differences
from henon_ref.harness.report.folder import INDEX, MANIFEST, PAGE, RUNS, dead_links
from henon_ref.harness.report.folder_report import index_text
from henon_ref.harness.report.matrix import read_matrix, rows_of_report
from henon_ref.harness.rows import RunRow

ROOT = Path(__file__).parents[3]
REPORTS = ROOT / "reports"
GATE = ("fig8", "leaving_slide", "free_coulomb", "stribeck_belt", "static_belt", "two_blocks")
PAGES = [ROOT / "README.md", *(page for place in ("reports", "docs", "cases") for page in (ROOT / place).rglob("*.md"))]
MOST_BYTES, MOST_WORDS, MOST_LINES = 5_000_000, 1500, 300


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_every_relative_link_leads_to_a_file(page):
    assert list(dead_links(page.read_text(encoding="utf-8"), page.parent)) == []


def test_what_is_kept_is_what_people_read():
    files = [path for path in REPORTS.rglob("*") if path.is_file()]
    assert sum(path.stat().st_size for path in files) <= MOST_BYTES
    assert {path.parent.name for path in files if path.name == MANIFEST} == set(GATE)
    for case in GATE:
        assert (REPORTS / case / RUNS).read_text().partition("\n")[0] == ",".join(RunRow.columns())
        assert len((REPORTS / case / MANIFEST).read_text().splitlines()) <= MOST_LINES


def test_the_index_is_short_and_made_of_the_stored_rows():
    rows = read_matrix(REPORTS)
    index = (REPORTS / INDEX).read_text()
    assert index == index_text(rows, REPORTS)
    assert len(index.split()) < MOST_WORDS
    assert len({row.case for row in rows}) > 60
    assert {row.kind for row in rows if row.kind} > {"crossings", "stick-slip", "graze or close roots"}


def test_the_page_shows_the_stored_rows_and_is_small():
    assert page_differences(REPORTS) == []
    assert sum(path.stat().st_size for path in REPORTS.glob(PAGE)) <= MOST_BYTES_OF_A_PAGE


@pytest.mark.parametrize("case", GATE)
def test_the_stored_rows_are_those_of_the_reports_that_are_there(case):
    stored = [row for row in read_matrix(REPORTS) if row.case == case]
    assert stored == rows_of_report(REPORTS / case)[0]
