"""A folder of made-up reports with a page, opened in Chromium."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fakes import CASE, case, truth
from made_reports import ORIGIN, changed, made

from henon_ref.casefile.case import Case
from henon_ref.harness.campaign.comparison import Comparison, ReadingResult
from henon_ref.harness.campaign.options import Options
from henon_ref.harness.report.case_report import write_report
from henon_ref.harness.report.folder_report import write_folder_report
from henon_ref.trajectory import Samples

SIZES = ((400, 800), (1400, 900))
"""Widths and heights of the windows in which a page is looked at [px]."""
SCHEMES = ("light", "dark")
MOST_BYTES = 4 * 2**20
"""Largest size of a page with all runs of every solver and peer on the whole suite [bytes]."""
TAGS = 'tags: [{}]\nstory: "A made-up story, 1 < 2."\n'
RUNS = {
    "first": {
        "henon": ("right", 2e-4),
        "heyoka": ("right", 1e-3),
        "scipy-rk45": ("right", 0.1),
        "ida": ("unavailable", 0.0),
    },
    "second": {
        "henon": ("right", 3e-4),
        "heyoka": ("misses", 2e-3),
        "scipy-rk45": ("right", 0.2),
        "ida": ("right", 0.05),
    },
}
"""What each solver does on each case, and its time [s]; ``ida`` is not there for the first."""


def comparison(name: str, own: Case | None = None, solvers: dict[str, tuple[str, float]] | None = None) -> Comparison:
    """A comparison of a case of this name, with a portrait: three solvers right to 6 and 12 digits, or as told."""
    own = own or case(name, CASE + TAGS.format(f"made-up, {name}"))
    reading = own.readings[0]
    times = np.linspace(0.0, 5.0, 101)
    samples = Samples(times, np.cos(times)[:, None], None)
    result = ReadingResult(reading, truth(), samples=samples)
    records = [
        made(solver, rtol, wall, what=what, reading=reading)
        for solver, (what, wall) in (solvers or RUNS[name]).items()
        for rtol in (1e-6, 1e-12)
    ]
    records = [changed(record, case=own.name) for record in records]
    return Comparison(replace(own, name=name), [result], records, Options())


PAIR = """readings:
  belt: {{}}
  belt_limit: {{until: 4}}
"""
"""Two readings, the name of one the beginning of the other's."""


def two_readings() -> Comparison:
    """A comparison of a case ``pair`` of two readings, each with a portrait and a figure; ``henon`` alone ran."""
    own = case("pair", CASE + PAIR)
    results, records = [], []
    for reading in own.readings:
        times = np.linspace(0.0, float(reading.problem.until), 101)
        samples = Samples(times, np.cos(times)[:, None], None)
        figure = {f"{reading.name}_cost.svg": b"<svg/>"}
        results.append(ReadingResult(reading, truth(), samples=samples, figures=figure))
        records.append(made("henon", 1e-6, 1e-3, reading=reading))
    records = [changed(record, case=own.name) for record in records]
    return Comparison(own, results, records, Options())


def made_folder(folder: Path) -> Path:
    """Write the reports of two cases and their page; return the path of the page."""
    for name in RUNS:
        write_report(comparison(name), ORIGIN, folder)
    write_folder_report(folder)
    return folder / "index.html"


def chromium() -> str | None:
    """The path of an installed Chromium; None if there is none."""
    return next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


@contextmanager
def browser() -> Iterator[Any]:
    """A headless Chromium; the test is skipped if it, Playwright or axe-core is not installed."""
    path = chromium()
    if path is None:
        pytest.skip("no Chromium is found: apt-get install chromium")
    for module in ("playwright.sync_api", "axe_playwright_python"):
        pytest.importorskip(module, exc_type=ImportError)
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield started
        started.close()


@dataclass
class Seen:
    """An open page, with its console messages and requests."""

    page: Any
    said: list[str] = field(default_factory=list)
    """Messages on the console, and errors."""
    loaded: list[str] = field(default_factory=list)
    """Addresses that were asked for."""


@contextmanager
def opened(
    browser: Any, file: Path, *, size: tuple[int, int] = SIZES[1], scheme: str = "light", at: str = ""
) -> Iterator[Seen]:
    """Open a file; the console must remain empty, and nothing else may be loaded."""
    page = browser.new_page(viewport={"width": size[0], "height": size[1]}, color_scheme=scheme)
    seen = Seen(page)
    page.on("console", lambda message: seen.said.append(message.text))
    page.on("pageerror", lambda error: seen.said.append(str(error)))
    page.on("request", lambda request: seen.loaded.append(request.url))
    address = f"file://{os.path.abspath(file)}"
    page.goto(address + at)
    yield seen
    assert seen.said == []
    assert {url.partition("#")[0] for url in seen.loaded if not url.startswith(("data:", "blob:"))} == {address}
    page.close()


def serious(page: Any) -> list[tuple[str, str]]:
    """Serious and critical findings of axe-core: the rule, and the first element."""
    from axe_playwright_python.sync_playwright import Axe

    found = Axe().run(page).response["violations"]
    return [(own["id"], own["nodes"][0]["html"]) for own in found if own["impact"] in ("serious", "critical")]


def sideways(page: Any) -> int:
    """Pixels by which a page is wider than its window."""
    return int(page.evaluate("document.documentElement.scrollWidth - window.innerWidth"))


def set_value(page: Any, name: str, value: object, event: str = "change") -> None:
    """Set the value of a control, with the events of an input by hand."""
    page.locator(f"#{name}").evaluate(
        "(node, [value, event]) => { node.value = value; node.dispatchEvent(new Event(event, {bubbles: true})); }",
        [str(value), event],
    )


def texts(page: Any, selector: str) -> list[str]:
    return [text.strip() for text in page.locator(selector).all_inner_texts()]


def titled(page: Any, words: str) -> None:
    """Wait until a run is shown."""
    page.wait_for_function("words => document.getElementById('run-title').innerText === words", arg=words)
