"""The function :func:`henon_ref.sweep`, which also locks the folder of the sweep and writes its page."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

from henon_ref.errors import ArgumentError
from henon_ref.harness.report.folder import check_folder, locked
from henon_ref.sweeps import sweep as sweeps

if TYPE_CHECKING:
    from henon_ref.sweeps.sweep import SweepTable


@contextmanager
def written(folder: Path) -> Iterator[None]:
    """Lock the folder of a sweep while it is written, and finally write its page."""
    from henon_ref.harness.report.sweep_page import write_sweep_page

    check_folder(folder)
    with locked([folder]):
        yield
        write_sweep_page(folder)


@wraps(sweeps.sweep)
def sweep(*arguments: Any, **options: Any) -> SweepTable:
    out = options.get("out")
    if out is None:
        return sweeps.sweep(*arguments, **options)
    if not isinstance(out, str | os.PathLike):
        raise ArgumentError(f"out is {str(out)[:60]}; wanted the path of a folder, or None")
    with written(Path(out)):
        return sweeps.sweep(*arguments, **options)
