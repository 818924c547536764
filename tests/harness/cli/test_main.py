"""The program ``henon-ref``: its subcommands, their help, its version."""

from __future__ import annotations

import subprocess
import sys
from importlib import metadata
from itertools import pairwise

import pytest
import typer

from henon_ref import __version__
from henon_ref.harness.campaign.jobs import PREPARE_SECONDS, TRUTH_SECONDS
from henon_ref.harness.cli import main
from henon_ref.harness.cli.main import SUBCOMMANDS, Subcommand, program

HEAVY = {"numpy", "scipy", "sympy", "numba", "heyoka", "sksundae", "flint", "pandas", "matplotlib", "llvmlite"}


@pytest.fixture(autouse=True)
def narrow(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setenv("TERMINAL_WIDTH", "80")


@pytest.mark.parametrize("name", SUBCOMMANDS)
def test_every_subcommand_has_a_help_of_80_columns_that_ends_with_examples_a_line_each(name, capsys):
    assert program([name, "--help"]) == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    assert f"Usage: henon-ref {name} " in captured.out
    assert max(map(len, captured.out.splitlines())) <= 80
    lines = [line.rstrip() for line in captured.out.split("╭")[0].splitlines()]
    for line, following in pairwise(lines):
        if line and following:  # within a paragraph: the next word would not have had room
            assert len(line) + 1 + len(following.split()[0]) > 79, line
    if name != "new-solver":
        examples = captured.out.partition("Examples:")[2].split("\n")
        given = [line.strip() for line in examples if line.strip()]
        assert given
        assert all(line.startswith(f"henon-ref {name}") for line in given)


@pytest.mark.parametrize("name", SUBCOMMANDS)
def test_no_help_has_a_word_in_brackets_which_rich_would_read_as_markup(name):
    """[s] is "strike through" and is not shown."""
    texts = [getattr(option, "help", None) or "" for option in typer.main.get_command(SUBCOMMANDS[name].app).params]
    assert not [text for text in texts if "[" in text]


def test_the_options_of_compare_stand_in_groups_and_its_limits_are_told(capsys):
    program(["compare", "--help"])
    text = capsys.readouterr().out
    for panel in ("Options", "Runs", "Output", "Exit status"):
        assert f"─ {panel} ─" in text
    words = " ".join(text.replace("│", " ").split())
    assert "Limit on the processor time of one run." in words
    assert f"may take {PREPARE_SECONDS:g} s in addition, and a truth that is not stored {TRUTH_SECONDS:g} s." in words


def test_the_list_of_subcommands_is_shown_where_none_is_named(capsys):
    assert program([]) == 0
    alone = capsys.readouterr().out
    assert program(["--help"]) == 0
    assert alone == capsys.readouterr().out
    assert all(f"│ {name} " in alone for name in SUBCOMMANDS)


def test_helps_import_no_library_that_computes():
    code = (
        "import sys; from henon_ref.harness.cli.main import program\n"
        "for name in ('compare', 'cases', 'solvers', 'schema', 'study'):\n"
        "    program([name, '--help'])\n"
        f"    assert not {HEAVY!r} & set(sys.modules), name"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert found.returncode == 0, found.stderr


def test_the_version_and_the_libraries(capsys):
    assert program(["--version"]) == 0
    assert capsys.readouterr().out == f"henon-ref {__version__}\n"
    assert program(["--version", "--verbose"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == f"henon-ref {__version__}"
    assert f"numpy {metadata.version('numpy')}" in lines
    assert program(["--verbose"]) == 2
    assert "--version" in capsys.readouterr().err


def test_a_subcommand_that_there_is_not_is_one_message(capsys):
    assert program(["compre", "x.yaml"]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert "compare" in captured.err


def test_a_subcommand_gets_its_arguments_as_they_are_and_its_status_is_the_program_s(monkeypatch):
    given = []

    def run(self, arguments):
        given.append(list(arguments))
        return 42

    monkeypatch.setattr(Subcommand, "run", run)
    words = ["compare", "--", "-x.yaml", "--version", "--help", "compare"]
    assert program(words) == 42
    assert given == [words[1:]]


def test_python_m_henon_ref_is_the_program():
    found = subprocess.run([sys.executable, "-m", "henon_ref", "--version"], capture_output=True, text=True, check=True)
    assert found.stdout == f"henon-ref {__version__}\n"
    bad = subprocess.run([sys.executable, "-m", "henon_ref", "compare"], capture_output=True, text=True, check=False)
    assert bad.returncode == 2
    assert bad.stderr.startswith("error: Missing argument")


def test_the_arguments_are_those_of_the_process_where_none_are_given(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["henon-ref", "--version"])
    assert main.program() == 0
    assert capsys.readouterr().out == f"henon-ref {__version__}\n"
