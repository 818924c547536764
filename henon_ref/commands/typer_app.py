"""What the subcommands' typer applications have in common: how they are made, and arguments that several take."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

FLAG = ""
"""Metavar of an option that takes no value: typer would name its type."""

Cases = Annotated[
    list[Path], typer.Argument(help="Case files, or folders of them.", show_default=False, metavar="CASE")
]
"""The case files that a subcommand reads."""


def application() -> typer.Typer:
    """An application whose errors and interrupts are told by :mod:`henon_ref.commands.exit_status`."""
    return typer.Typer(add_completion=False, pretty_exceptions_enable=False)


def examples(*commands: str) -> str:
    """What the help ends with: commands to copy, each a paragraph, since old versions of typer join lines."""
    return "\n\n".join(["Examples:", *(f"henon-ref {command}" for command in commands)])
