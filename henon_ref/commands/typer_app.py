"""Common parts of the subcommands' typer applications: their construction, and shared arguments."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

FLAG = ""
"""Metavar of an option without a value, for which typer would show a type."""


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
