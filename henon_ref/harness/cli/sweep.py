"""The command ``sweep`` with what the harness gives it: a lock on the folder, and the folder's page."""

from __future__ import annotations

from collections.abc import Sequence

from henon_ref.commands import sweep
from henon_ref.harness.report.sweep import written

app = sweep.app


def program(arguments: Sequence[str] | None = None) -> int:
    """Run the command; the exit status."""
    return sweep.program(arguments, around=written)
