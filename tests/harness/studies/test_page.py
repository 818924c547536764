"""Pages of studies: the function that writes them, and the runs that they report."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from fakes import Fake, case, truth

from henon_ref.figures import style
from henon_ref.harness.campaign.options import Options
from henon_ref.harness.campaign.progress import ProgressLine
from henon_ref.harness.report.manifest import provenance
from henon_ref.harness.studies import page
from henon_ref.harness.truth import compute

CONTEXT = {"sections": [], "runs": 3, "loosest": "1e-3", "tightest": "1e-9", "origin": provenance("make it again")}


def test_files_and_figures_are_written_before_the_page_that_links_to_them(tmp_path: Path) -> None:
    with style.figure(1.0) as figure:
        figure.add_axes((0.1, 0.1, 0.8, 0.8))
    written = page.write(tmp_path / "atlas", "atlas", CONTEXT, {"runs.csv": "a\n1\n"}, {"one.svg": figure})
    text = written.read_text(encoding="utf-8")
    assert written == tmp_path / "atlas" / "README.md"
    assert text.startswith("# Atlas of grazes\n")
    assert "\n\nMade by\n\n    make it again\n\non " in text
    assert (tmp_path / "atlas" / "runs.csv").read_text() == "a\n1\n"
    assert "<svg" in (tmp_path / "atlas" / "one.svg").read_text(encoding="utf-8")


def test_a_page_stays_as_it_is_where_its_new_files_cannot_be_made(tmp_path: Path) -> None:
    page.write(tmp_path, "atlas", CONTEXT)
    with pytest.raises(AttributeError):
        page.write(tmp_path, "atlas", CONTEXT | {"runs": 4}, figures={"one.svg": None})  # type: ignore[dict-item]
    assert "1e-9: 3 runs" in (tmp_path / "README.md").read_text()
    assert {path.name for path in tmp_path.iterdir()} == {"README.md"}


@pytest.mark.skipif(sys.platform != "linux", reason="made-up truths reach workers by fork")
def test_rows_are_given_by_case_in_the_order_of_the_cases(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compute, "truth_for", truth)
    cases = [case("b"), case("a")]
    options = Options(solvers=(Fake("one"), Fake("two")), processes=1, timed=False)
    found = page.rows_of(cases, options, ProgressLine(None))
    assert list(dict.fromkeys((row.case, row.solver) for row in found)) == [
        ("b", "one"), ("b", "two"), ("a", "one"), ("a", "two"),
    ]  # fmt: skip
