"""The part of the page on one run, in headless Chromium: text, portrait, figures and address."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from html_pages import RUNS, opened, set_value, texts, titled, two_readings
from made_reports import ORIGIN

from henon_ref.harness.report.case_report import write_report
from henon_ref.harness.report.folder_report import write_folder_report


def test_every_cell_leads_to_its_run(chromium: Any, reports: Path) -> None:
    with opened(chromium, reports) as seen:
        page = seen.page
        cells = page.locator("#matrix td.cell a")
        assert cells.count() == 8
        for k in range(cells.count()):
            link = cells.nth(k)
            assert link.get_attribute("href") == f"#{link.get_attribute('id')}"
            link.click()
            case_name, solver = str(link.get_attribute("id")).removeprefix("run-").split("-default-")
            titled(page, f"{solver} on {case_name}")
            page.wait_for_function("document.activeElement.id === 'run-title'")
            rows = page.locator("#run-tables table").first.locator("tbody tr")
            assert rows.count() == 2
        text = page.locator("#run-tables").inner_text()
        assert "1e-12" in text
        assert "A made-up story, 1 < 2." in page.locator("#run-words").inner_text()


def test_the_details_begin_with_the_best_solver_and_its_project(chromium: Any, reports: Path) -> None:
    with opened(chromium, reports) as seen:
        page = seen.page
        titled(page, "henon on first")
        assert "this project" in page.locator("#run-words").inner_text()
        set_value(page, "run-solver", page.locator("#run-solver option", has_text="heyoka").get_attribute("value"))
        link = page.locator("#run-words").get_by_role("link", name="heyoka")
        assert str(link.get_attribute("href")).startswith("https://")
        assert texts(page, "#projects a") == ["heyoka", "scikit-sundae", "scipy"]


def test_a_run_says_what_went_wrong(chromium: Any, reports: Path) -> None:
    with opened(chromium, reports, at="#run-second-default-heyoka") as seen:
        page = seen.page
        page.get_by_text("heyoka on second").wait_for()
        page.wait_for_function("document.activeElement.id === 'run-title'")
        assert page.evaluate("document.getElementById('run').getBoundingClientRect().top < window.innerHeight / 2")
        assert "wrong: 1 missed, 0 spurious" in page.locator("#run-tables").inner_text()
    with opened(chromium, reports, at="#run-first-default-ida") as seen:
        seen.page.get_by_text("ida on first").wait_for()
        assert "it is not installed" in seen.page.locator("#run-tables").inner_text()


def test_links_to_files_lead_to_files(chromium: Any, reports: Path) -> None:
    with opened(chromium, reports) as seen:
        page = seen.page
        for own in RUNS:
            page.locator(f"#run-{own}-default-henon").click()
            hrefs = [str(link.get_attribute("href")) for link in page.locator("a[href]").all()]
            assert f"{own}/report.md" in hrefs
            for href in hrefs:
                if href.startswith("https://"):
                    continue  # a project's page
                if href.startswith("#"):
                    assert page.evaluate("id => document.getElementById(id) !== null", href[1:]), href
                else:
                    assert (reports.parent / href).is_file(), href


def test_work_precision_tells_of_the_point_and_drops_a_solver(chromium: Any, reports: Path) -> None:
    with opened(chromium, reports) as seen:
        page = seen.page
        points = page.locator("#work svg [role=img]")
        assert points.count() == 6  # three solvers that ran, two settings each
        points.first.hover()
        assert "error" in page.locator(".tooltip").inner_text()
        page.get_by_role("checkbox", name="heyoka").last.uncheck()
        assert points.count() == 4
        page.locator("#run-solvers-none").click()
        assert "No solver is selected." in page.locator("#work").inner_text()
        page.locator("#run-solvers-all").click()
        points.first.focus()
        page.keyboard.press("ArrowRight")
        focused = page.evaluate("document.activeElement.getAttribute('aria-label')")
        assert focused == points.nth(1).get_attribute("aria-label")
        assert page.locator(".tooltip").inner_text().replace("\n", ", ") == focused
        page.keyboard.press("Escape")
        assert not page.locator(".tooltip").is_visible()


def test_a_reading_shows_its_own_portrait_and_figures(chromium: Any, tmp_path: Path) -> None:
    write_report(two_readings(), ORIGIN, tmp_path)
    write_folder_report(tmp_path)
    for reading, until in (("belt", 5), ("belt_limit", 4)):
        with opened(chromium, tmp_path / "index.html", at=f"#run-pair-{reading}-henon") as seen:
            titled(seen.page, f"henon on pair / {reading}")
            assert seen.page.locator("#portrait-note").inner_text() == f"The motion from 0 s to {until} s"
            drawings = [name for name in texts(seen.page, "#run-file-list li") if name.endswith(".svg")]
            assert drawings == [f"{reading}_cost.svg"]


def test_a_reading_without_a_portrait_shows_no_other(chromium: Any, tmp_path: Path) -> None:
    bare = two_readings()
    bare.readings[0].samples = None
    write_report(bare, ORIGIN, tmp_path)
    write_folder_report(tmp_path)
    with opened(chromium, tmp_path / "index.html", at="#run-pair-belt-henon") as seen:
        titled(seen.page, "henon on pair / belt")
        portrait = seen.page.locator("#portrait")
        assert portrait.inner_text() == "No portrait of this reading is kept; there is one of belt_limit."
        assert portrait.locator("svg").count() == 0
        portrait.locator("a").click()
        titled(seen.page, "henon on pair / belt_limit")


def test_the_address_names_the_run_that_is_shown(chromium: Any, reports: Path) -> None:
    """Chosen by hand, too: a link to the run that the address named before leads there again."""
    with opened(chromium, reports, at="#run-first-default-henon") as seen:
        titled(seen.page, "henon on first")
        set_value(
            seen.page, "run-solver", seen.page.locator("#run-solver option", has_text="heyoka").get_attribute("value")
        )
        titled(seen.page, "heyoka on first")
        assert seen.page.url.endswith("#run-first-default-heyoka")
        seen.page.locator("#run-first-default-henon").click()
        titled(seen.page, "henon on first")
