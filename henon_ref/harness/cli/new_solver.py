"""Command ``new-solver``: write a template package of a solver, either a Python method or an external program."""

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

from henon_ref.commands import application, examples
from henon_ref.commands.exit_status import DONE, command_of
from henon_ref.errors import CaseError
from henon_ref.harness import registry
from henon_ref.text import message, shortened

app = application()


@app.command(epilog=examples("new-solver my-rk", "new-solver my-julia --program 'julia solver.jl'"))
def main(
    name: Annotated[
        str, typer.Argument(metavar="NAME", help="Name of the solver and of its package.", show_default=False)
    ],
    out: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Folder to write. If omitted: ./NAME.", show_default=False)
    ] = None,
    program: Annotated[
        str | None,
        typer.Option(
            metavar="COMMAND",
            help="Command of a solver program in any language that implements henon_ref's protocol. If given, the "
            "package runs this program instead of a Python method.",
        ),
    ] = None,
) -> int:
    """Write a template package for a solver of your own.

    It has a working solver with one method to replace. After pip install -e NAME, the option --solvers NAME runs it.
    """
    check_name(name)
    folder = out if out is not None else Path(name)
    words = command_words(program) if program is not None else ()
    write_package(name, folder, words)
    print(message(f"{folder}: {', '.join(package_files(name, words))}"))
    print(message(f"next: pip install -e {folder}, then henon-ref compare CASE.yaml --solvers {name}"))
    return DONE


command = command_of(app, "new-solver")


def check_name(name: str) -> None:
    """Raise CaseError for a name that is invalid, or already taken by a solver or a module."""
    if not re.fullmatch(r"[a-z][a-z0-9]*([-_][a-z0-9]+)*", name) or len(name) > 40:
        raise CaseError(
            f"NAME is {shortened(name)}; a name has lowercase letters and digits, begins with a letter, may contain "
            f"single - or _ inside, and has at most 40 characters, for example my-rk"
        )
    module = name.replace("-", "_")
    if name in registry.names():
        raise CaseError(f"a solver named '{name}' is installed; choose another name")
    if iskeyword(module) or module in (*sys.stdlib_module_names, "test"):  # which lack Python's own tests
        raise CaseError(f"'{module}' is a keyword or a standard module of Python; choose another name")
    if module in packages_distributions() or module == "henon_ref":
        raise CaseError(f"an installed package has a module '{module}'; choose another name")


def command_words(command: str) -> tuple[str, ...]:
    """Split a command line into words, and make the paths of existing files absolute."""
    try:
        words = shlex.split(command)
    except ValueError as error:
        raise CaseError(f"--program {shortened(command)}: {error}") from error
    if not words:
        raise CaseError('--program is empty; wanted a command line: --program "julia solver.jl"')
    return tuple(str(Path(word).absolute()) if Path(word).is_file() else word for word in words)


def package_files(name: str, words: tuple[str, ...] = ()) -> dict[str, str]:
    """Map the path of every file of the package to its text; ``words`` is the command of the solver program, if any.

    The module is in ``src``, because Python would import the folder of the package instead of a module of the same
    name next to it.
    """
    module = name.replace("-", "_")
    environment = Environment(
        loader=PackageLoader("henon_ref.harness.cli", "new_solver_template"),
        undefined=StrictUndefined,
        keep_trailing_newline=True,
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
    """Write the package completely, or not at all; CaseError if the folder exists, or cannot be written."""
    if os.path.lexists(folder):
        raise CaseError(f"{folder} exists already; remove it, or choose another folder with --out")
    try:
        with TemporaryDirectory(prefix=".new-solver-", dir=folder.parent) as place:
            whole = Path(place) / "package"
            for path, text in package_files(name, words).items():
                (whole / path).parent.mkdir(parents=True, exist_ok=True)
                (whole / path).write_text(text, encoding="utf-8")
            whole.rename(folder)
    except OSError as error:
        raise CaseError(f"cannot write {folder}: {error.strerror or error}") from error
