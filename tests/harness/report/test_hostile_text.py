"""Names from untrusted case files and solvers have no effect in a report, a file or a terminal."""

from __future__ import annotations

import csv
import json
import unicodedata
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest
from fakes import CASE, expected, found, trajectory, truth
from made_reports import made
from markdown_it import MarkdownIt

from henon_ref.casefile.case import Case, parse_case
from henon_ref.harness.campaign.comparison import Comparison, ReadingResult
from henon_ref.harness.campaign.options import Options, Setting
from henon_ref.harness.campaign.rows import Outcome, Record, record
from henon_ref.harness.cli.compare import command
from henon_ref.harness.figures import draw_cost, draw_errors
from henon_ref.harness.report.case_report import write_report
from henon_ref.harness.report.folder_report import write_folder_report
from henon_ref.harness.report.manifest import provenance
from henon_ref.harness.report.svg import svg
from henon_ref.harness.score.scoring import score
from henon_ref.workers.worker import Failure

EVIL = (
    "<script>alert(1)</script><img src=//evil.example/x.png> ![x](//evil.example/x.png) [y](//evil.example) "
    "[z]: //evil.example </a> www.evil.example \u202eback | cell $x$ `"
)


def hostile(**changes: str) -> Case:
    words = {"title": EVIL, "source": EVIL, "story": f"{EVIL}\n\n# {EVIL}\n\n    {EVIL}\n- {EVIL}"} | changes
    text = CASE.format(name="made_up")
    lines = [line for line in text.splitlines() if not line.startswith(("title", "source", "gate"))]
    told = [f"{key}: {json.dumps(value)}" for key, value in words.items()]
    return parse_case("\n".join([*lines, *told, f"links: {json.dumps([EVIL, 'javascript:alert(1)'])}"]))


def records(case: Case) -> list[Record]:
    """A solver that is right, one that is wrong, one that fails: all with bad names."""
    reading, setting, records = case.readings[0], Setting(1e-6, 1e-6), []
    for name, events, failure in (
        (f"=right{EVIL}\x1b[31m", found(error=1e-7), None),
        (f"@wrong{EVIL}\x9b31m", found()[1:], None),
        ("-gone", (), Failure("failed", f"=cmd()|{EVIL}")),
        ("+none", (), Failure("unavailable", EVIL)),
    ):
        known = {"library_version": f"+1{EVIL}", "failure": failure}
        if failure is None:
            run = trajectory(events)
            known |= {"trajectory": run, "score": score(run, expected(), tolerance=1e-6), "samples": (1e-3,)}
        records.append(record(Outcome("made_up", reading, name, setting, **known), expected()))
    return records


@pytest.fixture
def folder(tmp_path) -> Path:
    """A hostile report, its figures, and the index above it."""
    case = hostile()
    result = ReadingResult(case.readings[0], replace(truth(), reason=EVIL, uncertified_because=EVIL))
    rows = records(case)
    result.figures["default_errors.svg"] = svg(draw_errors([(row.run, row.transitions) for row in rows], expected()))
    result.figures["default_cost.svg"] = svg(draw_cost([row.run for row in rows], expected()))
    comparison = Comparison(case, [result], [*rows, made("henon", 1e-6, 1e-4)], Options())
    origin = provenance(f"python -m henon_ref.compare '{EVIL}\n\n# x\n.yaml'")
    write_report(comparison, origin, tmp_path)
    write_folder_report(tmp_path)
    return tmp_path


def test_a_page_holds_no_tag_image_or_link_of_a_stranger(folder):
    for page in (folder / "README.md", folder / "made_up/report.md"):
        parsed = MarkdownIt("commonmark", {"html": True}).enable("table").parse(page.read_text())
        inner = [token for outer in parsed for token in [outer, *(outer.children or ())]]
        assert not [token for token in inner if token.type.startswith("html")]
        targets = [
            token.attrGet("src") or token.attrGet("href") for token in inner if token.type in ("image", "link_open")
        ]
        assert targets
        assert not [target for target in targets if "evil" in target or "script" in target]
        headings = [b.content for a, b in pairwise(parsed) if a.type == "heading_open"]
        assert not [text for text in headings[1:] if "evil" in text]


def test_no_file_of_a_report_holds_a_control_character(folder):
    files = [path for path in folder.rglob("*") if path.is_file()]
    assert {path.suffix for path in files} == {".md", ".csv", ".json", ".svg", ".html"}
    for path in files:
        bad = {c for c in path.read_text() if unicodedata.category(c) in ("Cc", "Cf", "Cs", "Zl", "Zp")} - {"\n"}
        assert not bad, path


def test_no_cell_of_a_stranger_is_a_formula(folder):
    for path in folder.rglob("*.csv"):
        with path.open(newline="") as file:
            cells = [cell for row in csv.reader(file) for cell in row]
        assert not [cell for cell in cells if cell.lstrip().startswith(("=", "@", "+"))]
        for cell in cells:
            if cell.startswith("-"):
                float(cell)
    with (folder / "made_up/transitions.csv").open(newline="") as file:
        modes = {row["from_mode"] for row in csv.DictReader(file)}
    assert modes == {"s=-1", "s=0", "s=+1"}


@pytest.mark.parametrize(
    "line",
    ["{key}: 1", "title: [{key}]", "solvers: ['{key}']", "tolerances: ['{key}']", "readings: {{'{key}': {{}}}}"],
)
def test_a_message_is_one_short_line(tmp_path, monkeypatch, capsys, line):
    """However long the words are that it is about, with its place first and the mend last."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bad.yaml").write_text(CASE.format(name="bad") + line.format(key="k" * 60_000) + "\n")
    assert command(["bad.yaml"]) == 2
    (words,) = capsys.readouterr().err.splitlines()
    assert words.startswith("error: bad.yaml:")
    assert len(words) <= 2000


def test_a_message_gives_a_terminal_no_orders(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    name = "\x1b[31m\u202e\x9b5mx.yaml"
    (tmp_path / name).write_text("schema: 2")
    assert command([name]) == 2
    words = capsys.readouterr().err
    assert words.isascii()
    assert words[:-1].isprintable()
