"""Third parties' solvers, loaded by a worker before this process does so: their modules may hang or die."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib.metadata import EntryPoint

from henon_ref.harness import registry
from henon_ref.harness.campaign.options import Options
from henon_ref.workers.pool import Jobs, WorkerPool
from henon_ref.workers.worker import Failure, Job, WorkerState

LOADING_SECONDS = 60.0
"""Processor time that importing a stranger's solver may take [s]."""


@dataclass(frozen=True)
class LoadJob(Job):
    """Import a solver and see whether it is driven by a step."""

    point: tuple[str, str, str]
    """Name, value and group of the entry point."""

    @property
    def seconds(self) -> float:
        return LOADING_SECONDS

    def run(self, state: WorkerState) -> bool:
        return registry.loaded(EntryPoint(*self.point)).fixed_step


def fixed_step(name: str) -> bool:
    """Whether a solver is driven by a step instead of tolerances; no, where a third party's cannot be loaded."""
    known = registry.fixed_step(name)
    return _probed(registry.entry_point(name)) if known is None else known


@cache
def _probed(point: EntryPoint) -> bool:
    fixed, reason = probe(point)
    if reason:
        registry.refuse(point, reason)
    return fixed


def probe(point: EntryPoint) -> tuple[bool, str]:
    """Whether a solver is driven by a step, and why it must not be imported (empty where it may be)."""
    results: list[bool | Failure] = []

    def loading() -> Jobs:
        results.append((yield LoadJob((point.name, point.value, point.group))))

    pool = WorkerPool(workers=1, memory=Options().memory)
    pool.add(point.name, loading())
    pool.run()
    (found,) = results
    if not isinstance(found, Failure):
        return found, ""
    # One that is unavailable says so itself, and better.
    return False, "" if found.status == "unavailable" else found.reason
