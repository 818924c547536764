"""The documentation's site: built without a warning, every link leads somewhere, nothing is loaded from elsewhere."""

from __future__ import annotations

import csv
import json
import re
import subprocess
import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
import typer
from html_pages import browser, serious, sideways

pytest.importorskip("sphinx", reason="the site is built where the extra docs is installed")

from henon_ref.casefile.json_schema import schema_text
from henon_ref.harness.cli import compare
from henon_ref.harness.cli.main import SUBCOMMANDS

ROOT = Path(__file__).parents[1]
LOADS = {"script": "src", "img": "src", "iframe": "src", "source": "src", "link": "href"}
"""Elements whose address a browser fetches by itself."""
MOST_BYTES = 30_000_000


class Page(HTMLParser):
    """Addresses and identifiers of a page."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.links: list[str] = []
        self.loads: list[str] = []
        self.names: set[str] = set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        self.names.update(value for key in ("id", "name") if (value := given.get(key)))
        if tag == "a" and given.get("href"):
            self.links.append(str(given["href"]))
        if tag in LOADS and given.get(LOADS[tag]):
            self.loads.append(str(given[LOADS[tag]]))


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    built = subprocess.run(
        [
            sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-d", str(folder / "doctrees"),
            "-c", str(ROOT / "docs"), str(ROOT), str(folder / "html"),
        ],
        cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert built.returncode == 0, built.stderr  # a warning is an error; what kernels print as they end is none
    return folder / "html"


@pytest.fixture(scope="module")
def pages(site: Path) -> dict[Path, Page]:
    """All but what is there to be downloaded, such as the page of the reports, which works alone."""
    return {path.resolve(): Page(path) for path in site.rglob("*.html") if "_downloads" not in path.parts}


def dead(path: Path, page: Page, pages: dict[Path, Page]) -> Iterator[str]:
    for address in (*page.links, *page.loads):
        parts = urlsplit(address)
        if parts.scheme or parts.netloc:
            continue
        target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
        known = target in pages and (not parts.fragment or unquote(parts.fragment) in pages[target].names)
        if not known and not (target.is_file() and target not in pages):
            yield address


def test_every_link_leads_to_a_file_and_a_place_in_it(pages: dict[Path, Page]) -> None:
    assert len(pages) > 30
    assert {str(path): own for path, page in pages.items() if (own := list(dead(path, page, pages)))} == {}


def test_nothing_is_loaded_from_the_network(pages: dict[Path, Page], site: Path) -> None:
    loads = {address for page in pages.values() for address in page.loads}
    assert not [address for address in loads if urlsplit(address).scheme or urlsplit(address).netloc]
    styles = "".join(path.read_text(encoding="utf-8") for path in site.rglob("*.css"))
    assert re.findall(r"""(?:@import|url\()\s*["']?https?:""", styles) == []
    assert sum(path.stat().st_size for path in site.rglob("*") if path.is_file()) < MOST_BYTES


def test_formulas_are_drawn_by_the_browser(site: Path) -> None:
    text = (site / "docs/stick_slip.html").read_text(encoding="utf-8")
    assert text.count("<math") > 5
    assert "$$" not in text


def test_a_picture_has_one_caption(site: Path) -> None:
    """Its alternative text, unless the page has written one below it."""
    text = (site / "docs/stick_slip.html").read_text(encoding="utf-8")
    (words,) = re.findall(r"<figure><img alt=\"([^\"]+)\"", text)
    assert f"<figcaption><p>{words}.</p></figcaption>" in text
    written = (site / "reports/paper/README.html").read_text(encoding="utf-8")
    assert written.count("<p><img") >= 5
    assert "<figcaption>" not in written


def test_every_page_is_in_the_contents(pages: dict[Path, Page], site: Path) -> None:
    first = pages[(site / "docs/index.html").resolve()]
    written = {path.stem for path in (ROOT / "docs").rglob("*.md")} - {"index"}
    assert written <= {Path(urlsplit(link).path).stem for link in first.links}


def test_the_notebooks_ran_and_have_their_outputs(site: Path) -> None:
    """Nothing on standard error, which notebooks show red, no warning, and a picture or more each."""
    written = sorted((ROOT / "docs/notebooks").glob("*.md"))
    assert len(written) == 4
    for page in written:
        content = json.loads((site.parent / f"jupyter_execute/docs/notebooks/{page.stem}.ipynb").read_text("utf-8"))
        outputs = [output for cell in content["cells"] for output in cell.get("outputs", [])]
        assert {output["output_type"] for output in outputs} <= {"stream", "display_data", "execute_result"}
        assert not [output for output in outputs if output.get("name") == "stderr"]
        assert "Warning" not in json.dumps(outputs)
        assert sum("image/png" in output.get("data", {}) for output in outputs) >= 1


def test_the_search_index_is_a_file_and_knows_the_words(site: Path) -> None:
    index = (site / "searchindex.js").read_text(encoding="utf-8")
    for word in ("filippov", "graze", "bernstein"):
        assert f'"{word}"' in index or f"{word}:" in index


def test_the_search_shows_excerpts_from_disk(site: Path) -> None:
    with browser() as started:
        page = started.new_page()
        page.goto(f"{(site / 'search.html').as_uri()}?q=graze")
        excerpts = page.locator("#search-results p.context")
        excerpts.first.wait_for()
        assert any("graze" in text for text in excerpts.all_inner_texts())


@pytest.mark.parametrize("name", ["index", "scenes", "gallery/drill_string", "notebooks/my_friction"])
def test_a_page_has_no_serious_finding(site: Path, name: str) -> None:
    with browser() as started:
        page = started.new_page(viewport={"width": 400, "height": 900})
        page.goto((site / f"docs/{name}.html").as_uri())
        assert serious(page) == []
        assert sideways(page) <= 0


def test_the_schema_is_published(site: Path) -> None:
    assert (site / "case.schema.json").read_text(encoding="utf-8") == schema_text()


def test_which_solver_says_what_the_matrix_has(site: Path) -> None:
    with (ROOT / "reports/matrix.csv").open(newline="", encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["kind"] == "stick-slip"]
    text = re.sub(r"<[^>]+>", "", (site / "docs/which_solver_in_numbers.html").read_text(encoding="utf-8"))
    section = re.sub(r"\s+", " ", text[text.index("Stick-slip¶") :])
    for solver in ("henon", "heyoka", "scipy-dop853"):
        own = [row for row in rows if row["solver"] == solver]
        counts = [sum(row[f"wall_{column}"] != "" for row in own) for column in ("s", "3_s", "6_s", "9_s", "12_s")]
        pattern = rf" {solver} " + " ".join(rf"{count} \(×[\d.]+\)" for count in counts)
        assert re.search(pattern, section), pattern
    assert f"{len({(row['case'], row['reading']) for row in rows})} readings" in section


def test_the_command_reference_has_every_subcommand_and_option(site: Path) -> None:
    text = re.sub(r"<[^>]+>", "", (site / "docs/commands.html").read_text(encoding="utf-8"))
    assert all(f"henon-ref {name} [OPTIONS]" in text for name in SUBCOMMANDS)
    for parameter in typer.main.get_command(compare.app).params:
        assert all(name in text for name in (parameter.opts if parameter.param_type_name == "option" else ()))


def test_a_page_that_links_to_nothing_is_told(tmp_path: Path) -> None:
    (tmp_path / "a.html").write_text('<h1 id="here"></h1><a href="#here"></a><a href="#no"></a><a href="b.html"></a>')
    path = (tmp_path / "a.html").resolve()
    page = Page(path)
    assert list(dead(path, page, {path: page})) == ["#no", "b.html"]
