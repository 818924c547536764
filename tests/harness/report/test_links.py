"""Relative links: which of them are dead, and their replacement."""

from __future__ import annotations

import pytest

from henon_ref.harness.report.folder import dead_links, without_dead_links


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "a case").mkdir()
    (tmp_path / "a case" / "report.md").touch()
    return tmp_path


@pytest.mark.parametrize(
    "text",
    [
        "[a](a%20case/report.md#slow)",
        "![a](a%20case/report.md)",
        "[b](https://example.org/none.md) and [c](#below) and [d](mailto:a@b.c)",
        "`[e](gone.md)` and\n\n    [f](gone.md)\n",
        "\\[g\\](not a link)",
    ],
)
def test_links_that_lead_somewhere_stay(folder, text):
    assert list(dead_links(text, folder)) == []
    assert without_dead_links(text, folder) == text


def test_what_leads_nowhere_becomes_text(folder):
    text = "| [two_roots, d1e9](../two_roots/report.md#d1e9) | ![figure](gone.svg) | [here](a%20case/report.md) |"
    assert list(dead_links(text, folder)) == ["../two_roots/report.md#d1e9", "gone.svg"]
    assert without_dead_links(text, folder) == "| two_roots, d1e9 |  | [here](a%20case/report.md) |"
