"""Every block of code in the documentation runs, and prints what stands below it; the pictures are those it draws."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import pytest
from doc_pages import PICTURES, ROOT, blocks, pictures, run_page
from matplotlib import pyplot as plt
from matplotlib.testing.compare import compare_images
from often import daily

from henon_ref.harness.truth import store

PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
NAMES = "add_a_solver compare first_case own_friction read_a_report simulate start three_blocks"
COMPARE = [ROOT / "docs" / f"{name}.md" for name in NAMES.split()]
"""Pages that compare solvers by a process each: 7 to 16 s of processor time; daily: .ci/run runs them."""
SAME = 10
"""Root mean square of what a picture may differ by, of 255: fonts and line ends, no other curve."""


@pytest.mark.parametrize("page", daily(PAGES, some={*PAGES} - {*COMPARE}), ids=lambda page: page.name)
def test_every_block_runs_and_prints_what_the_page_shows(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for library in ("heyoka", "sksundae"):  # whose rows pages show
        pytest.importorskip(library)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / ".cache"))
    monkeypatch.setattr(store, "user_folder", lambda: tmp_path / ".cache" / "henon_ref" / "truth")  # the shell's, too
    run_page(page, tmp_path)
    plt.close("all")
    for name in pictures(page):
        assert (tmp_path / name).stat().st_size > 0
        if f"matplotlib=={matplotlib.__version__}\n" not in (ROOT / "constraints.txt").read_text(encoding="utf-8"):
            continue  # another version puts letters elsewhere
        difference = compare_images(str(PICTURES / name), str(tmp_path / name), SAME)
        assert difference is None, f"{difference}\nrun python -m tests.support.doc_pages docs/{page.name}"


def test_every_picture_is_shown_by_one_page() -> None:
    shown = sorted(name for page in PAGES for name in pictures(page))
    assert shown == sorted(path.name for path in PICTURES.glob("*.png"))


def run(text: str, folder: Path) -> int:
    page = folder / "page.md"
    page.write_text(text)
    place = folder / "place"
    place.mkdir()
    return run_page(page, place)


def test_blocks_share_names_and_their_output_is_compared(tmp_path: Path) -> None:
    text = "```python\nx = 2\n```\n\n```python\nprint(x, 0.125)\n```\n\n```text\n{}\n```\n"
    assert run(text.format("2 0..."), tmp_path) == 2


@pytest.mark.parametrize(
    "text",
    [
        "```python\nprint(2)\n```\n\n```text\n3\n```\n",
        "```python\nprint(2)\n```\n",
        "```bash\nexit 3\n```\n",
        "    henon-ref no-such-command\n",
        "```bash\necho 2\n```\n\n```text\n3\n```\n",
        "```fortran\nend\n```\n",
        "```csv\na,b\n1\n```\n",
    ],
)
def test_a_page_that_says_something_else_fails(text: str, tmp_path: Path) -> None:
    with pytest.raises(AssertionError, match=r"page\.md:1"):
        run(text, tmp_path)


@pytest.mark.parametrize("text", ["```json\n{\n```\n", "```yaml\nschema: 1\nname: Bad Name\n```\n"])
def test_a_page_whose_data_cannot_be_read_fails(text: str, tmp_path: Path) -> None:
    with pytest.raises(Exception, match=r"name|Expecting"):
        run(text, tmp_path)


def test_a_block_that_is_not_run_says_why() -> None:
    (block,) = blocks("<!-- not run: it takes\na week -->\n\n```bash\nfalse\n```\n")
    assert block.reason == "it takes\na week"
    for page in PAGES:
        reasons = [block.reason for block in blocks(page.read_text(encoding="utf-8")) if block.reason is not None]
        assert all(len(reason.split()) >= 3 for reason in reasons)


def test_a_file_of_a_page_is_written_and_a_shell_finds_the_program(tmp_path: Path) -> None:
    text = "<!-- file: a/b.txt -->\n```text\nhere\n```\n\n```bash\ncat a/b.txt\n.venv/bin/henon-ref --version\n```\n\n"
    assert run(text + "```text\nhere\nhenon-ref 0...\n```\n", tmp_path) == 1
