"""The function :func:`henon_ref.sweep`: a sweep, and where it has a folder, the page of that."""

from __future__ import annotations

import os
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

from henon_ref.errors import ArgumentError
from henon_ref.harness.report.folder import check_folder, locked
from henon_ref.sweeps import sweep as sweeps

if TYPE_CHECKING:
    from henon_ref.sweeps.table import SweepTable


@wraps(sweeps.sweep)
def sweep(*arguments: Any, **options: Any) -> SweepTable:
    out = options.get("out")
    if out is None:
        return sweeps.sweep(*arguments, **options)
    if not isinstance(out, str | os.PathLike):
        raise ArgumentError(f"out is {str(out)[:60]}; wanted the path of a folder, or None")
    from henon_ref.harness.report.html.sweep_page import write_sweep_page

    folder = Path(out)
    check_folder(folder)
    with locked([folder]):
        table = sweeps.sweep(*arguments, **options)
        write_sweep_page(folder)
    return table
