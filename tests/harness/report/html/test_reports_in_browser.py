"""The page of a folder of reports in headless Chromium: links, filters and figures, at two widths, light and dark."""

from __future__ import annotations

import json
import os
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from fakes import CASE, case
from html_pages import RUNS, SCHEMES, SIZES, comparison, opened, serious, sideways, two_readings
from made_reports import ORIGIN, changed
from test_reports_page import SHOWN

from henon_ref.harness.report.case_report import write_report
from henon_ref.harness.report.folder_report import write_folder_report
from henon_ref.harness.report.text.choice import choice_rows
from henon_ref.harness.report.text.matrix import read_matrix
from henon_ref.harness.report.text.ranking import LEVELS


def set_value(page: Any, name: str, value: object, event: str = "change") -> None:
    """Give a control a value, as a reader's hand does."""
    page.locator(f"#{name}").evaluate(
        "(node, [value, event]) => { node.value = value; node.dispatchEvent(new Event(event, {bubbles: true})); }",
        [str(value), event],
    )


def texts(page: Any, selector: str) -> list[str]:
    return [text.strip() for text in page.locator(selector).all_inner_texts()]


def rows_of(page: Any) -> list[str]:
    """Readings that the matrix shows."""
    return texts(page, "#matrix tbody tr:not([hidden]) th")


def choice(page: Any) -> list[list[str]]:
    return [row.split("\t") for row in texts(page, "#choice-table tbody tr")]


@pytest.mark.parametrize(("size", "scheme"), list(zip(SIZES, SCHEMES, strict=True)), ids=str)
def test_it_is_as_wide_as_its_window_and_has_no_serious_finding(
    chromium: Any, reports: Path, size: tuple[int, int], scheme: str
) -> None:
    with opened(chromium, reports, size=size, scheme=scheme) as seen:
        seen.page.locator("#work svg").wait_for()
        assert serious(seen.page) == []
        assert sideways(seen.page) <= 0
        seen.page.locator("details summary").click()
        assert serious(seen.page) == []
        assert sideways(seen.page) <= 0


def test_it_works_copied_alone_into_an_empty_folder(chromium: Any, reports: Path, tmp_path: Path) -> None:
    shutil.copy(reports, tmp_path)
    with opened(chromium, tmp_path / "index.html") as seen:
        assert seen.page.title() == "henon_ref: which solver, for how many digits"
        assert rows_of(seen.page) == list(RUNS)
        assert seen.page.locator("#portrait svg path.piece").count() > 0
        assert seen.page.locator("#work svg path").count() > 0


def test_the_digits_wanted_lead_to_the_choice_that_the_index_makes(chromium: Any, reports: Path) -> None:
    rows = read_matrix(reports.parent)
    with opened(chromium, reports) as seen:
        for level in (0, *LEVELS):
            set_value(seen.page, "digits", level)
            wanted = [list(row) for row in choice_rows(rows, level or None)]
            assert choice(seen.page) == wanted
        assert seen.page.locator("#answer").inner_text().startswith("For 12 digits, all kinds of case: take ")


def test_the_digits_wanted_colour_the_cells(chromium: Any, tmp_path: Path) -> None:
    whole = comparison("second")
    whole.records = [own for own in whole.records if (own.run.solver, own.run.rtol) != ("scipy-rk45", 1e-12)]
    write_report(whole, ORIGIN, tmp_path)
    write_folder_report(tmp_path)
    with opened(chromium, tmp_path / "index.html") as seen:
        for digits, wanted in ((6, "reached"), (9, "fewer")):
            set_value(seen.page, "digits", digits)
            for solver, standing in (("scipy-rk45", wanted), ("heyoka", "wrong")):
                cell = seen.page.locator(f"#run-second-default-{solver}").locator("..")
                assert standing in str(cell.get_attribute("class"))


def test_filters_leave_the_rows_that_they_name(chromium: Any, reports: Path) -> None:
    with opened(chromium, reports) as seen:
        page = seen.page
        for name, value, event, shown in (
            ("search", "SEC", "input", ["second"]),
            ("search", "made-up system", "input", ["first", "second"]),
            ("search", "nothing of the kind", "input", []),
            ("search", "", "input", ["first", "second"]),
            ("tag", "first", "change", ["first"]),
            ("tag", "made-up", "change", ["first", "second"]),
            ("tag", "", "change", ["first", "second"]),
            ("which", "every", "change", ["first"]),
            ("which", "missed", "change", ["second"]),
            ("which", "none", "change", []),
            ("which", "all", "change", ["first", "second"]),
            ("kind", "0", "change", ["first", "second"]),
        ):
            set_value(page, name, value, event)
            assert rows_of(page) == shown, (name, value)
            assert page.locator("#shown-rows").inner_text() == f"{len(shown)} of 2 readings"
            assert page.get_by_text("No reading matches these filters").is_visible() == (not shown)
            assert page.locator("#matrix").is_visible() == bool(shown)
        set_value(page, "which", "every")


def test_solvers_are_switched_on_and_off_in_the_matrix(chromium: Any, reports: Path) -> None:
    with opened(chromium, reports) as seen:
        page = seen.page
        page.locator("details summary").click()
        box = page.get_by_role("checkbox", name="heyoka").first
        assert page.locator("#run-second-default-heyoka").is_visible()
        box.uncheck()
        assert not page.locator("#run-second-default-heyoka").is_visible()
        assert page.locator("#solvers-text").inner_text() == "Solvers shown (3 of 4)"
        set_value(page, "which", "every")
        assert rows_of(page) == ["first", "second"]  # the one that misses is hidden
        page.get_by_role("button", name="all", exact=True).first.click()
        assert page.locator("#run-first-default-heyoka").is_visible()
        assert rows_of(page) == ["first"]


def test_a_heading_sorts_by_its_column(chromium: Any, reports: Path) -> None:
    with opened(chromium, reports) as seen:
        page = seen.page
        heading = page.locator("#matrix thead th", has_text="heyoka")
        for order, direction in ((["first", "second"], "descending"), (["second", "first"], "ascending")):
            heading.get_by_role("button").click()
            assert rows_of(page) == order
            assert heading.get_attribute("aria-sort") == direction
        page.locator("#matrix thead th", has_text="case").get_by_role("button").click()
        assert rows_of(page) == ["first", "second"]
        assert heading.get_attribute("aria-sort") is None


def titled(page: Any, words: str) -> None:
    """Wait until a run is shown."""
    page.wait_for_function("words => document.getElementById('run-title').innerText === words", arg=words)


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


def test_a_phone_sees_headings_beside_the_cells(chromium: Any, reports: Path) -> None:
    with opened(chromium, reports, size=(400, 800)) as seen:
        page = seen.page
        first = page.locator("#choice-table td").first
        assert "readings" in first.evaluate("node => getComputedStyle(node, '::before').content")
        assert page.locator("#choice-table").evaluate("node => node.scrollWidth <= node.clientWidth")
        box = page.locator("#matrix thead .solver").nth(3).bounding_box()
        assert box["x"] + box["width"] <= 400  # four solvers' columns beside the names


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


def test_arrow_keys_move_between_cells_which_have_one_tab_stop(chromium: Any, reports: Path) -> None:
    with opened(chromium, reports) as seen:
        page = seen.page
        stops = page.locator("#matrix tbody a[tabindex='0']")
        assert stops.count() == 1
        stops.focus()
        for key, place in (("ArrowRight", "first-default-heyoka"), ("ArrowDown", "second-default-heyoka")):
            page.keyboard.press(key)
            assert page.evaluate("document.activeElement.id") == f"run-{place}"
        assert stops.count() == 1
        page.keyboard.press("Enter")
        titled(page, "heyoka on second")


@pytest.mark.parametrize("scheme", SCHEMES)
def test_the_button_turns_the_page_dark_or_light(chromium: Any, reports: Path, scheme: str) -> None:
    def background() -> str:
        return str(seen.page.evaluate("getComputedStyle(document.body).backgroundColor"))

    with opened(chromium, reports, scheme=scheme) as seen:
        before = background()
        button = seen.page.locator("#theme")
        assert button.inner_text() == ("Dark page" if scheme == "light" else "Light page")
        button.click()
        assert background() != before
        button.click()
        assert background() == before


def test_it_prints_light_without_controls_and_with_every_row(chromium: Any, reports: Path) -> None:
    with opened(chromium, reports, scheme="dark") as seen:
        seen.page.emulate_media(media="print", color_scheme="dark")
        assert not seen.page.locator("#digits").is_visible()
        assert seen.page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
        assert seen.page.evaluate("getComputedStyle(document.getElementById('matrix')).maxHeight") == "none"
        assert seen.page.locator("#matrix tbody tr").last.is_visible()


def test_without_a_script_it_still_says_which_solver_to_take(chromium: Any, reports: Path) -> None:
    context = chromium.new_context(java_script_enabled=False)
    page = context.new_page()
    page.goto(f"file://{os.path.abspath(reports)}")
    assert choice(page) == [list(row) for row in choice_rows(read_matrix(reports.parent), 9)]
    context.close()


def test_what_a_stranger_writes_is_shown_as_it_is(chromium: Any, tmp_path: Path) -> None:
    told = f"tags: [{json.dumps(SHOWN)}]\nstory: {json.dumps(SHOWN)}\n".replace("{", "{{").replace("}", "}}")
    evil = replace(case("evil", CASE + told), title=SHOWN, source=SHOWN)
    made = comparison("evil", evil, {f"a{SHOWN}": ("misses", 1e-3), "henon": ("right", 1e-3)})
    record = made.records[0]
    object.__setattr__(record, "run", replace(record.run, status_reason=SHOWN, verdict_basis=SHOWN))
    write_report(made, ORIGIN, tmp_path)
    write_folder_report(tmp_path)
    with opened(chromium, tmp_path / "index.html", size=SIZES[0]) as seen:
        page = seen.page
        page.on("dialog", lambda dialog: pytest.fail(dialog.message))
        set_value(page, "tag", SHOWN)
        assert rows_of(page) == ["evil"]
        page.locator("#matrix td.cell a").last.click()
        assert SHOWN in page.locator("#run-title").inner_text()
        assert SHOWN in page.locator("#run-words").inner_text()
        assert SHOWN in page.locator("#run-tables").inner_text()
        assert sideways(page) <= 0
        assert page.locator("img").count() == 0
        assert page.locator("script").count() == 2


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


def test_a_solver_that_ran_on_a_part_stands_below_those_that_get_there_more_often(
    chromium: Any, tmp_path: Path
) -> None:
    """Bars are of all readings, so that one of 1 is shorter than one of 2."""
    write_report(comparison("first", solvers={**RUNS["first"], "octave-ode45": ("right", 1e-5)}), ORIGIN, tmp_path)
    write_report(comparison("second"), ORIGIN, tmp_path)
    write_folder_report(tmp_path)
    with opened(chromium, tmp_path / "index.html") as seen:
        bars = seen.page.locator("#reaches g")
        shown = [bars.nth(k).locator("text").all_text_contents() for k in range(bars.count())]
        assert shown == [["henon", "2 of 2"], ["scipy-rk45", "2 of 2"], ["octave-ode45", "1 of 1"],
                         ["heyoka", "1 of 2"], ["ida", "1 of 1"]]  # fmt: skip
        widths = [float(own) for own in seen.page.locator("#reaches .bar-in").evaluate_all(
            "bars => bars.map((bar) => bar.getAttribute('width'))")]  # fmt: skip
        assert widths == pytest.approx([widths[0], widths[0], *[widths[0] / 2] * 3])
        assert "all 2 readings with a transition to time" in seen.page.locator("#reaches-note").inner_text()


def test_every_standing_has_a_colour_and_stands_in_the_key(chromium: Any, tmp_path: Path) -> None:
    made = comparison("first", solvers={"henon": ("right", 1e-3), "heyoka": ("misses", 1e-3),
                                        "ida": ("untried", 0.0), "scipy-rk45": ("misses", 1e-3)})  # fmt: skip
    made.records[-2:] = [changed(record, verdict="ill-conditioned") for record in made.records[-2:]]
    write_report(made, ORIGIN, tmp_path)
    write_folder_report(tmp_path)

    def colour(locator: Any) -> str:
        return str(locator.evaluate("node => getComputedStyle(node).backgroundColor"))

    with opened(chromium, tmp_path / "index.html") as seen:
        cells = {text: colour(seen.page.locator(f"#matrix td:has-text('{text}')").last)
                 for text in ("12", "wrong", "timeout", "ill-cond.")}  # fmt: skip
        assert len({*cells.values(), colour(seen.page.locator("body"))}) == 5
        key = seen.page.locator("#standings span")
        chips = {own.inner_text(): colour(own.locator("i")) for own in key.all()}
        assert set(cells.values()) <= set(chips.values())
        assert chips["out of time"] == cells["timeout"]


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
