"""Strangers' words are shown as they are: no tag, link, image, formula or order to a terminal is made of them."""

from __future__ import annotations

import re
import unicodedata

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from markdown_it import MarkdownIt
from markdown_it.token import Token

from henon_ref.harness.result_files import TableError, read_rows, rows_text
from henon_ref.harness.rows import RunRow, StickRow, TransitionRow
from henon_ref.harness.table import Table
from henon_ref.text import LONGEST_LINE, cell, code, from_cell, link, markdown, message, one_line, paragraphs, printable

HARMLESS = {"text", "text_special", "code_inline", "softbreak", "paragraph_open", "paragraph_close", "inline"}
MARKS = st.text(st.sampled_from(list("ab1 _*`[]()<>!&#;:/.@|~$\\-+=\n\t\"'{}^")), max_size=40)
RENDER = MarkdownIt("commonmark", {"html": True}).enable("table").enable("strikethrough")


def tokens(text: str) -> list[Token]:
    return [inner for token in RENDER.parse(text) for inner in [token, *(token.children or ())]]


def shown(text: str) -> str:
    """What a reader sees of a page."""
    return "".join(token.content for token in tokens(text) if token.type in ("text", "text_special", "code_inline"))


@settings(max_examples=200)
@given(MARKS | st.text(max_size=40))
def test_text_on_a_page_is_only_text(text):
    assert {token.type for token in tokens(markdown(text))} <= HARMLESS
    assert {token.type for token in tokens(code(text))} <= HARMLESS
    assert {token.type for token in tokens(paragraphs(text))} <= HARMLESS


@settings(max_examples=200)
@given(st.text(st.sampled_from(list("ab1 _*[]()<>!&#;:.|~$\\-+=\"'{}^")), max_size=40))
def test_text_on_a_page_reads_as_it_was_written(text):
    assert shown(markdown(text)) == one_line(text)


@settings(max_examples=200)
@given(MARKS)
def test_a_cell_of_a_table_stays_one_cell(text):
    types = [token.type for token in tokens(Table(("one", "two"), "ll", [(markdown(text), "x")]).markdown)]
    assert types.count("td_open") == 2
    assert not set(types) & {"html_inline", "html_block", "image", "link_open"}


@pytest.mark.parametrize(
    "text",
    [
        "<script>alert(1)</script>",
        "<img src=http://evil.example/x.png onerror=alert(1)>",
        "![x](http://evil.example/x.png)",
        "[click](javascript:alert(1))",
        "[click]: http://evil.example",
        "<http://evil.example>",
        "&lt;b&gt;",
    ],
)
def test_no_tag_image_or_link_is_made_of_a_title(text):
    assert {token.type for token in tokens(f"# {markdown(text)}")} <= HARMLESS | {"heading_open", "heading_close"}
    assert not re.search(r"<\w|!\[|\]\(", markdown(text))
    assert shown(markdown(text)) == text


@pytest.mark.parametrize("address", ["http://evil.example/a_b_", "www.evil.example", "mailto:a@evil.example", "a@b.co"])
def test_an_address_in_a_text_is_no_link_on_any_page(address):
    """Some pages make a link of whatever looks like an address; not of code."""
    assert markdown(f"see {address} there") == f"see `{address}` there"


def test_only_a_plain_web_address_is_given_as_one():
    assert link("https://doi.org/10.1016/S0167-2789(02)00547-X") == "https://doi.org/10.1016/S0167-2789(02)00547-X"
    for bad in ("javascript:alert(1)", "http://a.b/<img src=x>", "http://a.b/ [x](y)", "data:text/html,x"):
        assert {token.type for token in tokens(link(bad))} <= HARMLESS


@given(st.text())
def test_what_is_printable_is_one_line_without_controls(text):
    line = one_line(text)
    assert not [c for c in line if unicodedata.category(c) in ("Cc", "Cf", "Cs", "Zl", "Zp")]
    assert printable(line) == line
    line.encode()


def test_a_line_on_a_terminal_is_short_and_gives_no_orders():
    words = message("error: bad.yaml:1:2: unknown key '" + "\x1b]0;x\x07" + "k" * 60_000 + "\u202e'; allowed: name\n")
    assert len(words) == LONGEST_LINE
    assert words.startswith("error: bad.yaml:1:2: unknown key ' ]0;x k")
    assert words.endswith("k '; allowed: name")


@pytest.mark.parametrize("text", ["=1+1", "+1+1", "-1+1|x", "@sum(a1)", "\t=1", "\r=1", " =1", "-x", "＝1"])
def test_no_cell_is_a_formula(text):
    assert cell(text).startswith("'")


@pytest.mark.parametrize("text", ["s=-1", "s1=0, s2=-1", "-1", "+1.5e-3", "stick", "a=b", "", "'quoted"])
def test_what_is_no_formula_stays(text):
    assert cell(text) == text


@given(st.text(st.sampled_from(list("=+-@'1ax ")), max_size=6))
def test_a_cell_reads_back_as_it_was_written(text):
    assert from_cell(cell(text)) == text


def test_a_file_reads_back_as_it_was_written(tmp_path):
    names = ("a", "b", "=cmd()", 1e-9, None)
    rows = [TransitionRow(*names, 3, "stick", "s", "s=-1", "s=0", state={"x": -1e-9, "v": None})]
    (tmp_path / "a.csv").write_text(rows_text(TransitionRow, rows, ["x", "v"]))
    assert "'=cmd(),1e-09,,3,stick,s,s=-1,s=0,,,,,,-1e-09,,,,,\n" in (tmp_path / "a.csv").read_text()
    assert read_rows(TransitionRow, tmp_path / "a.csv") == rows


@pytest.mark.parametrize(
    ("line", "words", "place"),
    [
        ("a,b,c,,,1.5,,,,,,,", "'1.5' is no number", (2, 9)),
        ("a,b,c,,,1,small,,,,,,", "'small' is no number", (2, 11)),
        ("a,b,c,,,1,nan,,,,,,", "'nan' is no number", (2, 11)),
        ("a,b,c,,,,1,,,,,,", "'' is no number", (2, 1)),
        ("a,b,c", "3 fields; there are 13 columns", (2, 1)),
        ('"a,b', "unexpected end of data", (2, 1)),
    ],
)
def test_what_is_wrong_with_a_file_is_told_with_its_place(tmp_path, line, words, place):
    (tmp_path / "a.csv").write_text(f"{','.join(StickRow.columns())}\n{line}\n")
    with pytest.raises(TableError, match=words) as raised:
        read_rows(StickRow, tmp_path / "a.csv")
    assert (raised.value.line, raised.value.column) == place


def test_a_column_that_is_there_twice_is_refused(tmp_path):
    (tmp_path / "a.csv").write_text("case,reading,solver,solver\na,b,c,d\n")
    with pytest.raises(TableError, match="a column name occurs twice"):
        read_rows(RunRow, tmp_path / "a.csv")


def test_a_file_of_another_kind_is_told_by_the_column_that_it_lacks(tmp_path):
    (tmp_path / "a.csv").write_text("case,reading\na,b\n")
    with pytest.raises(TableError, match="there is no column 'solver'; needed are case, reading, solver, rtol, "):
        read_rows(StickRow, tmp_path / "a.csv")


def test_long_text_takes_no_time():
    """One pass: of letters, of backticks, of what might begin an address."""
    for piece in ("a", "`", "a.", "1", "_", "*", "<", "w"):
        assert markdown(piece * 50_000)
