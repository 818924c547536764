"""The page of a folder of reports in headless Chromium: links, filters and figures, at two widths, light and dark."""

from __future__ import annotations

import json
import os
import re
import shutil
from base64 import b64encode
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fakes import CASE, case
from html_pages import RUNS, SCHEMES, SIZES, comparison, opened, serious, set_value, sideways, texts, titled
from made_reports import ORIGIN, changed
from test_reports_page import SHOWN

from henon_ref.harness.report.case_report import write_report
from henon_ref.harness.report.choice import choice_rows
from henon_ref.harness.report.folder_report import write_folder_report
from henon_ref.harness.report.matrix import read_matrix
from henon_ref.harness.report.rendering import CELLS
from henon_ref.harness.score.ranking import LEVELS


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
        assert seen.page.title() == "henon_ref: recommended solvers by required digits"
        assert rows_of(seen.page) == list(RUNS)
        assert seen.page.locator("#portrait svg path.piece").count() > 0
        assert seen.page.locator("#work svg path").count() > 0


@pytest.mark.parametrize("earlier", [False, True], ids=["steps", "base64"])
def test_a_portrait_is_drawn_through_its_points(chromium: Any, tmp_path: Path, earlier: bool) -> None:
    write_report(comparison("second"), ORIGIN, tmp_path)
    file = tmp_path / "second" / "page.json"
    words = json.loads(file.read_text(encoding="utf-8"))
    portrait = words["portraits"]["default"]
    steps = [np.array(text.split(), dtype=int).reshape(-1, 2) for _, text in portrait["pieces"]]
    points = np.concatenate([own.cumsum(axis=0) for own in steps])
    texts_of_pieces = [text for _, text in portrait["pieces"]]
    if earlier:
        places = [own.cumsum(axis=0) * 4096 // CELLS for own in steps]
        texts_of_pieces = [b64encode(own.astype("<i2").tobytes()).decode() for own in places]
    portrait["pieces"] = [["slip", text] for text in texts_of_pieces]  # in this order, which sticks would change
    file.write_text(json.dumps(words), encoding="utf-8")
    write_folder_report(tmp_path)
    with opened(chromium, tmp_path / "index.html") as seen:
        pieces = seen.page.locator("#portrait svg path.piece").all()
        text = " ".join(
            str(own.get_attribute("d")) for own in pieces if "surface" not in str(own.get_attribute("class"))
        )
        frame = seen.page.locator("#portrait svg clipPath rect")
        left, top, width, height = (float(frame.get_attribute(name)) for name in ("x", "y", "width", "height"))
    drawn = np.array(re.findall(r"-?[\d.]+", text), dtype=float).reshape(-1, 2)
    share = points / CELLS
    placed = np.column_stack([left + share[:, 0] * width, top + (1 - share[:, 1]) * height])
    assert np.abs(drawn - placed).max() < 0.06


def test_the_digits_wanted_lead_to_the_choice_that_the_index_makes(chromium: Any, reports: Path) -> None:
    rows = read_matrix(reports.parent)
    with opened(chromium, reports) as seen:
        for level in (0, *LEVELS):
            set_value(seen.page, "digits", level)
            wanted = [list(row) for row in choice_rows(rows, level or None)]
            assert choice(seen.page) == wanted
        assert seen.page.locator("#answer").inner_text().startswith("For 12 digits, all kinds of case: henon (in ")


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


def test_a_phone_sees_headings_beside_the_cells(chromium: Any, reports: Path) -> None:
    with opened(chromium, reports, size=(400, 800)) as seen:
        page = seen.page
        first = page.locator("#choice-table td").first
        assert "readings" in first.evaluate("node => getComputedStyle(node, '::before').content")
        assert page.locator("#choice-table").evaluate("node => node.scrollWidth <= node.clientWidth")
        box = page.locator("#matrix thead .solver").nth(3).bounding_box()
        assert box["x"] + box["width"] <= 400  # four solvers' columns beside the names


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
        assert "Full width: 2 readings with a transition time." in seen.page.locator("#reaches-note").inner_text()


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
