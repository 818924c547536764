"""The multiprecision route as a reference for tests, which are skipped if heyoka is not installed."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from henon_ref.modes.problem import Problem


def simulate(problem: Problem, bits: int) -> Any:
    """A ``Run`` of the multiprecision route; its ``events`` are what an instant's transitions share."""
    pytest.importorskip("heyoka")
    from henon_ref.harness.truth.multiprecision import run

    found: Any = run.simulate(problem, bits)
    found.events = [
        SimpleNamespace(
            time=t.time, before=t.from_mode, after=t.to_mode, surfaces=tuple(own.surface for own in (t, *rest))
        )
        for t, *rest in found.instants
    ]
    return found


def multiprecision(problem: Problem) -> Any:
    """A :class:`henon_ref.harness.truth.reference.Route`."""
    pytest.importorskip("heyoka")
    from henon_ref.harness.truth.multiprecision import route

    return route.multiprecision(problem)


def transitions(problem: Problem, bits: int) -> list[Any]:
    """The reference transitions of one run, with radii that claim nothing."""
    instants = simulate(problem, bits).instants
    from henon_ref.harness.truth.multiprecision.route import _transitions

    return [t for instant in instants for t in _transitions(instant, instant, 1e-30, 1e-30)]
