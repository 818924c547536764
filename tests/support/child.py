"""Runs of the peers in a separate process: jax's threads prevent a fork of this one, and diffsol may abort."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from typing import Any

import systems

from henon_ref.harness import registry


@contextmanager
def child() -> Iterator[ProcessPoolExecutor]:
    """A process that keeps what it has compiled."""
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        yield pool


def trajectory(solver: str, problem: str, rtol: float, **options: Any) -> dict[str, Any]:
    """A run of a problem of :mod:`systems`, as plain values."""
    found = registry.solver(solver).prepare(getattr(systems, problem)(), rtol=rtol, atol=rtol, deadline=60, **options)()
    return {
        "kinds": [t.kind for t in found.transitions],
        "times": [t.time for t in found.transitions],
        "status": found.status,
        "reason": found.reason,
        "end": found.end_state,
        "steps": found.counts.steps,
        "samples": found.samples,
    }
