"""What is asked of a stranger's solver before it runs, behind a fence: its module may hang or die when imported."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from importlib.metadata import EntryPoint
from typing import Any

from henon_ref import registry
from henon_ref.score.fence import Answer, Fence, Lane
from henon_ref.score.options import Options
from henon_ref.score.worker import Failure, Job, Stages

LOADING_SECONDS = 120.0
"""Time that importing a stranger's solver may take [s]."""


@dataclass(frozen=True)
class _Asking:
    """Import a solver and see whether it is driven by a step."""

    point: tuple[str, str, str]
    """Name, value and group of the entry point."""
    seconds: float

    def stages(self) -> Stages:
        name, value, group = self.point
        yield "loaded", registry.loaded(EntryPoint(name, value, group)).fixed_step


class _Heard:
    """Takes the one answer."""

    def __init__(self) -> None:
        self.fixed_step = False
        self.failure: Failure | None = None

    def receive(self, lane: Lane, job: Job, stage: str, payload: Any) -> Answer:
        """It is loaded."""
        self.fixed_step = payload
        return Answer(None, job.seconds)

    def finished(self, lane: Lane, job: Job, failure: Failure | None) -> None:
        """It is loaded, or cannot be."""
        self.failure = failure

    def tick(self) -> None:
        """There is nobody to tell."""


def ask(point: EntryPoint) -> tuple[bool, str]:
    """Whether a solver is driven by a step, and why it must not be imported (empty where it may be)."""
    heard = _Heard()
    asking = _Asking((point.name, point.value, point.group), LOADING_SECONDS)
    Fence(processes=1, memory=Options().memory).run([Lane(point.name, deque([asking]))], heard)
    failure = heard.failure
    # One that is unavailable says so itself, and better.
    return heard.fixed_step, "" if failure is None or failure.status == "unavailable" else failure.reason
