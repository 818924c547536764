"""The list of cases, which is made without parsing any expression."""

from __future__ import annotations

import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

from henon_ref.casefile.case import load_case
from henon_ref.harness.cli import lists
from henon_ref.harness.cli.lists import cases_command as command
from henon_ref.harness.cli.lists import outline

CASES = Path(__file__).parents[3] / "cases"
outlines = cache(outline)
"""Each read once in a process."""
FILES = [path for path in sorted(CASES.rglob("*.yaml")) if "truth" not in path.parts]


@pytest.mark.parametrize("name", ["fig8", "static_belt", "rig_periodic", "classic/block_chain", "hard/two_roots"])
def test_an_outline_has_the_sizes_of_the_case(name):
    path = CASES / f"{name}.yaml"
    case, found = load_case(path), outline(path)
    systems = [reading.problem.system for reading in case.readings]
    assert (found.name, found.title, found.readings) == (case.name, case.title, len(case.readings))
    assert found.states == tuple(len(system.states) for system in systems)
    assert found.surfaces == tuple(len(system.surfaces) for system in systems)
    assert found.tags == tuple(dict.fromkeys(tag for reading in case.readings for tag in reading.tags))


def test_every_shipped_case_is_in_the_list(monkeypatch, capsys):
    monkeypatch.setattr(lists, "outline", outlines)
    assert command([]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split() == ["name", "readings", "states", "surfaces", "title", "tags"]
    assert [line.split()[0] for line in lines[1:]] == [path.stem for path in FILES]
    (fig8,) = [line for line in lines if line.startswith("fig8 ")]
    assert fig8.split()[:4] == ["fig8", "3", "2", "1"]
    assert "Belt oscillator with a harmonic base (Fig. 8)" in fig8
    assert fig8.endswith("paper, periodic, softening-spring")


def test_tags_choose_cases(monkeypatch, capsys):
    monkeypatch.setattr(lists, "outline", outlines)
    assert command(["--tag", "paper"]) == 0
    paper = capsys.readouterr().out.splitlines()[1:]
    assert all("paper" in line for line in paper)
    assert command(["--tag", "paper", "--tag", "periodic"]) == 0
    both = capsys.readouterr().out.splitlines()[1:]
    assert 0 < len(both) < len(paper) < len(FILES)
    assert command(["--tag", "papper"]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "did you mean 'paper'" in captured.err


def test_a_strangers_title_and_tags_are_text(tmp_path, capsys):
    title, tags = '"[red]hot[/red] :smile: \\x1B[31m"', '["[bold]a", "\\x9B1m"]'
    model = "system: {state: [x], surfaces: {s: x}, field: [-s]}"
    (tmp_path / "own.yaml").write_text(f"name: own\ntitle: {title}\ntags: {tags}\n{model}\n")
    assert command([str(tmp_path / "own.yaml")]) == 0
    (line,) = capsys.readouterr().out.splitlines()[1:]
    assert "[red]hot[/red] :smile:" in line
    assert "[bold]a" in line
    assert line.isprintable()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("name: x\ntitle: y\n", "no model"),
        ("name: x\n", "'title' is missing"),
        ("- 1\n", "mapping"),
    ],
)
def test_what_is_no_case_is_one_message(tmp_path, capsys, text, words):
    (tmp_path / "bad.yaml").write_text(text)
    assert command([str(tmp_path)]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "bad.yaml" in captured.err
    assert words in captured.err


def test_where_there_are_no_kinks_no_expression_is_looked_into():
    code = (
        "import sys; from henon_ref.harness.cli.lists import cases_command; cases_command(['hard', 'classic']); "
        "sys.exit(', '.join({'sympy', 'numpy'} & set(sys.modules)) or 0)"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert found.returncode == 0, found.stderr


def test_a_tag_of_a_shipped_case_is_one_word():
    """So that ``--tag`` needs no quotes, and no two tags differ by a blank alone."""
    assert [tag for path in FILES for tag in outlines(path).tags if not re.fullmatch(r"[a-z0-9-]+", tag)] == []
