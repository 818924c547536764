"""The multiprecision route for tests that hold something against it; they are skipped where heyoka is not installed."""

from __future__ import annotations

from typing import Any

import pytest

from henon_ref.modes.problem import Problem


def simulate(problem: Problem, bits: int) -> Any:
    """A :class:`henon_ref.harness.truth.multiprecision.run.Run`."""
    pytest.importorskip("heyoka")
    from henon_ref.harness.truth.multiprecision import run

    return run.simulate(problem, bits)


def multiprecision(problem: Problem) -> Any:
    """A :class:`henon_ref.harness.truth.reference.Route`."""
    pytest.importorskip("heyoka")
    from henon_ref.harness.truth.multiprecision import route

    return route.multiprecision(problem)


def transitions(problem: Problem, bits: int) -> list[Any]:
    """The reference transitions of one run, with radii that claim nothing."""
    events = simulate(problem, bits).events
    from henon_ref.harness.truth.multiprecision.route import _transitions

    return [t for e in events for t in _transitions(e, e, 1e-30, 1e-30)]
