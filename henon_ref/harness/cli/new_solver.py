"""The command ``new-solver``: a package with a solver to fill in, which works as it stands, or that names a program."""

from __future__ import annotations

import os
import re
import shlex
import sys
from importlib.metadata import packages_distributions
from keyword import iskeyword
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import typer
from jinja2 import Environment, PackageLoader, StrictUndefined

from henon_ref.commands.exit_status import DONE, command_of
from henon_ref.errors import CaseError
from henon_ref.harness import registry
from henon_ref.text import message, shortened

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)

TEMPLATES = "new_solver_template"
"""Folder of the templates, beside this file."""
NAME = re.compile(r"[a-z][a-z0-9]*([-_][a-z0-9]+)*")
LONGEST = 40
"""Characters of a name."""


@app.command()
def main(
    name: Annotated[
        str, typer.Argument(metavar="NAME", help="Name of the solver and of its package.", show_default=False)
    ],
    out: Annotated[
        Path | None, typer.Option(metavar="PATH", help="Folder to write, ./NAME if left out.", show_default=False)
    ] = None,
    program: Annotated[
        str | None,
        typer.Option(
            metavar="COMMAND",
            help="A program in any language that speaks the protocol, in place of a method in Python.",
        ),
    ] = None,
) -> int:
    """Write a package with a solver of your own, which works as it stands and has one method to fill in.

    The package registers NAME with henon_ref: once it is installed (pip install -e NAME), --solvers NAME runs it.
    """
    check_name(name)
    folder = out if out is not None else Path(name)
    words = command_words(program) if program is not None else ()
    write_package(name, folder, words)
    print(message(f"{folder}: {', '.join(package_files(name, words))}"))
    print(message(f"next: pip install -e {folder}, then henon-ref compare CASE.yaml --solvers {name}"))
    return DONE


command = command_of(app, "new-solver")


def module_of(name: str) -> str:
    """The module in which a solver of this name is written."""
    return name.replace("-", "_")


def check_name(name: str) -> None:
    """Refuse a name that no package, no module or no further solver may have.

    Raises
    ------
    CaseError
    """
    if not NAME.fullmatch(name) or len(name) > LONGEST:
        raise CaseError(
            f"NAME is {shortened(name)}; allowed are small letters and digits, begun with a letter, in parts joined by "
            f"- or _, {LONGEST} characters at most: my-rk"
        )
    module = module_of(name)
    if name in registry.names():
        raise CaseError(f"a solver named '{name}' is installed; take another name")
    if iskeyword(module) or module in sys.stdlib_module_names:
        raise CaseError(f"'{module}' is a word or a module of Python; take another name")
    if module in packages_distributions() or module == "henon_ref":
        raise CaseError(f"an installed package has a module '{module}'; take another name")


def command_words(command: str) -> tuple[str, ...]:
    """The words of a command line, paths of files that are there made absolute.

    Raises
    ------
    CaseError
        Where it has none, or a quotation mark is left open.
    """
    try:
        words = shlex.split(command)
    except ValueError as error:
        raise CaseError(f"--program {shortened(command)}: {error}") from error
    if not words:
        raise CaseError('--program is empty; wanted a command line: --program "julia solver.jl"')
    return tuple(str(Path(word).absolute()) if Path(word).is_file() else word for word in words)


def package_files(name: str, words: tuple[str, ...] = ()) -> dict[str, str]:
    """Path of every file of the package -> its text; ``words``: the command of a program, where it names one.

    The module lies below ``src``: the package's own folder, seen from the folder that it is in, would be taken for the
    module where both have one name.
    """
    module = module_of(name)
    environment = Environment(
        loader=PackageLoader("henon_ref.harness.cli", TEMPLATES), undefined=StrictUndefined, keep_trailing_newline=True
    )
    files = {
        "pyproject.toml": "pyproject.toml",
        "README.md": "README.md",
        f"src/{module}.py": "program.py" if words else "module.py",
        f"tests/test_{module}.py": "test_module.py",
    }
    return {
        path: environment.get_template(f"{template}.j2").render(name=name, module=module, command=words)
        for path, template in files.items()
    }


def write_package(name: str, folder: Path, words: tuple[str, ...] = ()) -> None:
    """Write the package, whole or not at all.

    Raises
    ------
    CaseError
        Where the folder is there already, or cannot be written.
    """
    if os.path.lexists(folder):
        raise CaseError(f"{folder} exists already; remove it, or give another folder by --out")
    try:
        with TemporaryDirectory(prefix=".new-solver-", dir=folder.parent) as place:
            whole = Path(place) / "package"
            for path, text in package_files(name, words).items():
                (whole / path).parent.mkdir(parents=True, exist_ok=True)
                (whole / path).write_text(text, encoding="utf-8")
            whole.rename(folder)
    except OSError as error:
        raise CaseError(f"cannot write {folder}: {error.strerror or error}") from error
