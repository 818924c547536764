"""Case files, held against the solvers that there are.

Third parties' solvers are loaded by a worker before this process does so: their modules may hang or die.
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
"""Processor time that importing a stranger's solver may take [s]."""


def load_cases(paths: Sequence[Path]) -> list[Case]:
    """Read the case files that paths lead to, held against the solvers that there are.

    Raises
    ------
    CaseError
        See :func:`henon_ref.casefile.files.read_cases`.
    """
    return read_cases(paths, solvers=registry.names(), fixed_step=fixed_step)


def fixed_step(name: str) -> bool:
    """Whether a solver is driven by a step instead of tolerances; no, where a third party's cannot be loaded."""
    known = registry.fixed_step(name)
    return _probed(registry.entry_point(name)) if known is None else known


@dataclass(frozen=True)
class LoadJob(Job):
    """Import a solver and see whether it is driven by a step."""

    point: tuple[str, str, str]
    """Name, value and group of the entry point."""
    seconds: float = LOADING_SECONDS

    def run(self, state: WorkerState) -> bool:
        return registry.loaded(EntryPoint(*self.point)).fixed_step


@cache
def _probed(point: EntryPoint) -> bool:
    """Whether a solver is driven by a step; where loading it failed, this process is told never to do so."""
    found: list[bool | Failure] = []

    def loading() -> Jobs:
        found.append((yield LoadJob((point.name, point.value, point.group), LOADING_SECONDS)))

    pool = WorkerPool(workers=1, memory=Options().memory)
    pool.add(point.name, loading())
    pool.run()
    (result,) = found
    if not isinstance(result, Failure):
        return result
    if result.status != "unavailable":  # one that is says so itself, and better
        registry.refuse(point, result.reason)
    return False
