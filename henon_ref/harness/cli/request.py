"""What the command was asked for."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from henon_ref.casefile.shipped import located


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

    @property
    def whole(self) -> bool:
        """A folder is run with the settings of its cases: it gets the atlas and the experiments, too.

        Not where some solvers were chosen: the atlas would lose the others.
        """
        from henon_ref.harness.registry import ALL

        chosen = self.tolerances is not None or self.solvers not in (None, (ALL,))
        return not chosen and any(located(path).is_dir() for path in self.cases)
