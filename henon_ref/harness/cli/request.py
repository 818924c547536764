"""What the command was asked for."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Request:
    """The command's arguments."""

    cases: tuple[Path, ...]
    out: Path
    solvers: tuple[str, ...] | None
    tolerances: tuple[float, ...] | None
    repeats: int | None
    timeout: float
    processes: int
    resume: bool
    gate: bool = False
    figures: bool = True
    required: tuple[str, ...] = ()
    """Solvers that have to be right in every reading."""
    check: bool = False
    """Only read and explain the case files."""
    json: bool = False
    """Show the table as a JSON document, and nothing else on standard output."""
