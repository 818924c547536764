"""Command ``sweep`` of the program: it also locks the folder of the results, and writes the page of the folder."""

from __future__ import annotations

from collections.abc import Sequence

from henon_ref.commands import sweep
from henon_ref.harness.report.sweep import written

app = sweep.app


def program(arguments: Sequence[str] | None = None) -> int:
    return sweep.program(arguments, around=written)
