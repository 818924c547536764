"""Commands that do not need the harness, and the common parts of all typer applications of this package."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from henon_ref.terminal import Line

FLAG = ""
"""Metavar of an option without a value, for which typer would show a type."""

status_line = Line()
"""Status line of a terminal while libraries are imported that can show more."""


def path_of(text: str | Path) -> Path:
    """Return the path of an argument; an empty text, such as an unset variable of a shell, is refused."""
    if not str(text).strip():
        raise typer.BadParameter("the path is empty; use . for the current folder")
    return Path(text)


Cases = Annotated[
    list[Path],
    typer.Argument(help="Case files, or folders of them.", show_default=False, metavar="CASE", parser=path_of),
]


def application() -> typer.Typer:
    """Create an application whose errors and interrupts :mod:`henon_ref.commands.exit_status` reports."""
    return typer.Typer(add_completion=False, pretty_exceptions_enable=False)


def examples(*commands: str) -> str:
    """Return the end of a help text: commands to copy, a paragraph each, since old versions of typer join lines."""
    return "\n\n".join(["Examples:", *(f"henon-ref {command}" for command in commands)])
