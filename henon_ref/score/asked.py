"""What is asked of a stranger's solver before it runs, by a worker: its module may hang or die when imported."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.metadata import EntryPoint

from henon_ref import registry
from henon_ref.score.options import Options
from henon_ref.score.pool import Jobs, WorkerPool
from henon_ref.score.worker import Failure, Job, WorkerState

LOADING_SECONDS = 60.0
"""Processor time that importing a stranger's solver may take [s]."""


@dataclass(frozen=True)
class _Asking(Job):
    """Import a solver and see whether it is driven by a step."""

    point: tuple[str, str, str]
    """Name, value and group of the entry point."""

    @property
    def seconds(self) -> float:
        return LOADING_SECONDS

    def run(self, state: WorkerState) -> bool:
        return registry.loaded(EntryPoint(*self.point)).fixed_step


def ask(point: EntryPoint) -> tuple[bool, str]:
    """Whether a solver is driven by a step, and why it must not be imported (empty where it may be)."""
    heard: list[bool | Failure] = []

    def asking() -> Jobs:
        heard.append((yield _Asking((point.name, point.value, point.group))))

    pool = WorkerPool(workers=1, memory=Options().memory)
    pool.add(point.name, asking())
    pool.run()
    (answer,) = heard
    if not isinstance(answer, Failure):
        return answer, ""
    # One that is unavailable says so itself, and better.
    return False, "" if answer.status == "unavailable" else answer.reason
