"""Read case files, and check the solvers that they name.

A worker loads each third-party solver before this process does, because importing its module may hang or crash.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.metadata import EntryPoint
from pathlib import Path

from henon_ref.casefile.case import Case
from henon_ref.casefile.files import read_cases
from henon_ref.harness import registry
from henon_ref.harness.campaign.options import Options
from henon_ref.workers.pool import Jobs, WorkerPool
from henon_ref.workers.worker import Failure, Job, WorkerState

LOADING_SECONDS = 60.0
"""Limit on the processor time to import a third-party solver [s]."""


def load_cases(paths: Sequence[Path]) -> list[Case]:
    """Read case files and folders of case files, and check the solvers that they name.

    Raises
    ------
    CaseError
        See :func:`henon_ref.casefile.files.read_cases`.
    """
    return read_cases(paths, solvers=registry.names(), fixed_step=fixed_step)


def fixed_step(name: str) -> bool:
    """Check whether a solver takes a fixed step instead of tolerances; False if a third-party solver cannot load."""
    known = registry.fixed_step(name)
    return _probed(registry.entry_point(name)) if known is None else known


@dataclass(frozen=True)
class LoadJob(Job):
    """Import a solver and check whether it takes a fixed step."""

    point: tuple[str, str, str]
    """Name, value and group of the entry point."""
    seconds: float = LOADING_SECONDS

    def run(self, state: WorkerState) -> bool:
        return registry.loaded(EntryPoint(*self.point)).fixed_step


@cache
def _probed(point: EntryPoint) -> bool:
    """Check in a worker whether a solver takes a fixed step; if loading fails, forbid this process to load it."""
    found: list[bool | Failure] = []

    def loading() -> Jobs:
        found.append((yield LoadJob((point.name, point.value, point.group), LOADING_SECONDS)))

    pool = WorkerPool(workers=1, memory=Options().memory)
    pool.add(point.name, loading())
    pool.run()
    (result,) = found
    if not isinstance(result, Failure):
        return result
    if result.status != "unavailable":  # an unavailable solver reports a better reason itself
        registry.refuse(point, result.reason)
    return False
