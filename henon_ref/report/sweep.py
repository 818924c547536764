"""The function :func:`henon_ref.sweep`: a sweep, and where it has a folder, the page of that."""

from __future__ import annotations

from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

from henon_ref.sweeps import sweep as sweeps

if TYPE_CHECKING:
    from henon_ref.sweeps.table import SweepTable


@wraps(sweeps.sweep)
def sweep(*arguments: Any, **options: Any) -> SweepTable:
    table = sweeps.sweep(*arguments, **options)
    if options.get("out") is not None:
        from henon_ref.report.html.sweep_page import write_sweep_page

        write_sweep_page(Path(options["out"]))
    return table
