"""Run the code blocks of the documentation's pages; a program, and functions for the tests.

``python -m tests.support.doc_pages docs/bifurcation.md ...`` runs pages, and puts the pictures that their blocks save
where the pages show them, in ``docs/pictures``.

* ``python`` blocks run one after the other with the same names, ``bash`` blocks under ``bash -euo pipefail``, those in
  ``matlab`` by Octave where it is installed; in a folder of the page's own, where ``cases`` is the repository's and
  ``.venv/bin`` leads to this Python. A ``text`` block below is what they print (``...`` stands for anything).
* ``<!-- file: NAME -->`` before a block: it is written to that file instead.
* ``yaml`` blocks that are case or sweep files are read as such, ``json``, ``toml`` and ``csv`` blocks are read.
* ``<!-- not run: REASON -->`` before a block: it is not run. A block in any other language needs that.
* An indented block counts as ``bash`` where it begins with a command, as ``yaml`` where it is a case file.
"""

from __future__ import annotations

import csv
import doctest
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from contextlib import chdir, redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from shutil import copyfile, copytree

from markdown_it import MarkdownIt
from markdown_it.token import Token
from ruamel.yaml import YAML

from henon_ref.casefile.case import parse_case
from henon_ref.jit.cache_folder import VARIABLE, cache_root
from henon_ref.sweeps.sweep_file import load_sweep

ROOT = Path(__file__).resolve().parents[2]
PICTURES = ROOT / "docs" / "pictures"
TRUTHS = Path(__file__).parent / "truths"
"""Truths of cases that pages create, made by ``henon-ref truth`` (half a minute each), and copied to the cache with
which a page runs. A truth that does not match its case is computed again."""
SECONDS = 600
"""Largest time of a block in a shell [s]."""
SHELLS = ("bash", "sh", "shell", "console")
MATLAB = "matlab"
UNREAD = ("text", "", "diff")
"""Languages of blocks that say something and do nothing."""
_COMMAND = re.compile(r"(\S*/bin/)?(python3?|pip|henon-ref)\b")
_NOTE = re.compile(r"\A<!-- (?P<kind>file|not run): (?P<text>.+?) -->\Z", re.DOTALL)
_PICTURE = re.compile(r"!\[[^\]]*\]\(pictures/(?P<name>[^)]+)\)")


@dataclass
class Block:
    """One block of code of a page."""

    line: int
    language: str
    code: str
    shown: str | None = None
    """What stands below it as printed."""
    file: str | None = None
    """The file that it is."""
    reason: str | None = None
    """Why it is not run."""


def blocks(text: str) -> list[Block]:
    """The blocks of a page in order, what they print with them."""
    found: list[Block] = []
    last: Block | Token | None = None
    for token in MarkdownIt("commonmark").parse(text):
        if token.level and token.type not in ("fence", "code_block"):
            continue
        if token.type in ("fence", "code_block") and not token.info.startswith("{"):
            last = _block(token, last, found)
        elif token.type == "html_block":
            last = token
        elif not token.type.endswith("_close"):
            last = None
    return found


def _block(token: Token, last: Block | Token | None, found: list[Block]) -> Block | None:
    language = token.info.strip() or (_guessed(token.content) if token.type == "code_block" else "")
    runs = isinstance(last, Block) and last.language in ("python", MATLAB, *SHELLS) and last.file is None
    if isinstance(last, Block) and runs and language == "text" and last.shown is None:
        last.shown = token.content
        return None
    assert token.map is not None
    block = Block(token.map[0] + 1, language, token.content)
    if isinstance(last, Token) and (note := _NOTE.match(last.content.strip())):
        block.file = note["text"] if note["kind"] == "file" else None
        block.reason = note["text"] if note["kind"] == "not run" else None
    found.append(block)
    return block


def _guessed(code: str) -> str:
    if all(_COMMAND.match(line) for line in code.splitlines() if line.strip()):
        return "bash"
    return "yaml" if code.startswith("schema: 1\n") else "text"


def run_page(page: Path, folder: Path) -> int:
    """Run the blocks of a page in a folder, and compare what they print; how many were run, written or read.

    Raises
    ------
    AssertionError
        Where one prints something else, fails, or is in a language that nobody runs and has no reason not to be.
    """
    names: dict[str, object] = {}
    done = 0
    environment = reader_s_environment(folder)
    with chdir(folder):
        for block in blocks(page.read_text(encoding="utf-8")):
            place = f"{page.name}:{block.line}"
            if block.reason is None and block.language not in UNREAD:
                print(f"{place}: {block.language}", file=sys.stderr)
                _run(block, place, names, environment)
                done += 1
            elif block.file is not None:
                _write(block)
    return done


def _write(block: Block) -> None:
    path = Path(str(block.file))
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(block.code, encoding="utf-8")


def _run(block: Block, place: str, names: dict[str, object], environment: dict[str, str]) -> None:
    if block.file is not None:
        _write(block)
    if block.language in SHELLS:
        _compare(block, place, _shell(block.code, place, environment))
    elif block.language == MATLAB:
        Path("program.m").write_text(block.code, encoding="utf-8")
        if shutil.which("octave"):
            _compare(block, place, _shell("octave --quiet --no-gui program.m", place, environment))
    elif block.language == "python" and block.file is None:
        printed = StringIO()
        with redirect_stdout(printed):
            exec(compile(block.code, place, "exec"), names)
        _compare(block, place, printed.getvalue())
    elif block.language == "python":
        compile(block.code, place, "exec")
    else:
        _read(block, place)


def _shell(code: str, place: str, environment: dict[str, str]) -> str:
    done = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", code],
        env=environment, capture_output=True, text=True, timeout=SECONDS, check=False,
    )  # fmt: skip
    assert done.returncode == 0, f"{place}: exit status {done.returncode}\n{done.stdout}{done.stderr}"
    return done.stdout


def _compare(block: Block, place: str, printed: str) -> None:
    if block.shown is None and block.language in SHELLS:
        return  # of a command the page need not show what it prints
    same = doctest.OutputChecker().check_output(block.shown or "", printed, doctest.ELLIPSIS)
    assert same, f"{place} prints\n{printed}\nand not\n{block.shown}"


def _read(block: Block, place: str) -> None:
    if block.language in ("yaml", "yml"):
        content = YAML(typ="safe").load(block.code)
        if isinstance(content, dict) and "points" in content and "schema" in content:
            with tempfile.NamedTemporaryFile("w", suffix=".yaml") as file:
                file.write(block.code)
                file.flush()
                load_sweep(Path(file.name))
        elif isinstance(content, dict) and "schema" in content:
            parse_case(block.code)
    elif block.language == "json":
        json.loads(block.code)
    elif block.language == "toml":
        tomllib.loads(block.code)
    elif block.language == "csv":
        assert len({len(row) for row in csv.reader(block.code.splitlines())}) == 1, place
    else:
        raise AssertionError(f"{place}: nobody runs '{block.language}'; <!-- not run: REASON --> before it says why")


def reader_s_environment(folder: Path) -> dict[str, str]:
    """Give a folder ``cases`` and ``.venv/bin``, and the environment in which both are found."""
    tools = folder / ".venv" / "bin"
    tools.mkdir(parents=True)
    (folder / "cases").symlink_to(ROOT / "cases")
    copytree(TRUTHS, folder / ".cache" / "henon_ref" / "truth")
    packages = folder / ".venv" / "packages"
    packages.mkdir()
    lines = {
        "python": f'exec "{sys.executable}" "$@"',
        "henon-ref": f'exec "{sys.executable}" -m henon_ref "$@"',
        "pip": f'exec "{sys.executable}" "{ROOT}/tests/support/editable.py" "{packages}" "$@"',
    }
    for name, line in lines.items():
        (tools / name).write_text(f"#!/bin/sh\n{line}\n")
        (tools / name).chmod(0o755)
    return dict(os.environ) | {
        "PATH": f"{tools}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": f"{packages}{os.pathsep}{ROOT}",
        "XDG_CACHE_HOME": str(folder / ".cache"),  # truths that a page computes are not the user's
        VARIABLE: str(cache_root()),
        "MPLBACKEND": "Agg",
    }


def pictures(page: Path) -> Iterator[str]:
    """Names of the pictures that a page shows from ``docs/pictures``: its blocks save them."""
    for found in _PICTURE.finditer(page.read_text(encoding="utf-8")):
        yield found["name"]


def main() -> None:
    """Run pages, and keep their pictures."""
    for page in map(Path, sys.argv[1:]):
        with tempfile.TemporaryDirectory() as place:
            run_page(page.resolve(), Path(place))
            for name in pictures(page):
                PICTURES.mkdir(exist_ok=True)
                copyfile(Path(place) / name, PICTURES / name)


if __name__ == "__main__":
    main()
