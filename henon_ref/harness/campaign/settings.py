"""What is asked of a solver: which tolerances or steps, and the absolute tolerance that goes with them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from henon_ref.harness.score.reference import Expected
from henon_ref.modes.problem import Problem


@dataclass(frozen=True)
class Setting:
    """One row's settings: a step for a fixed-step solver, tolerances for any other."""

    rtol: float | None = None
    """Relative tolerance."""
    atol: float | None = None
    """Absolute tolerance, in units of the state."""
    step: float | None = None
    """Step [s]."""

    @property
    def label(self) -> str:
        """As messages name it."""
        return f"step {self.step:g} s" if self.step is not None else f"rtol {self.rtol:g}"


def settings(
    *, fixed_step: bool, tolerances: Sequence[float], steps: Sequence[float], scale: float
) -> tuple[Setting, ...]:
    """The settings of one solver on one reading, from the loosest to the tightest.

    Parameters
    ----------
    fixed_step : bool
        Whether the solver is driven by a step.
    tolerances, steps : sequence of float
    scale : float
        Size of the state, see :func:`state_scale`; ``atol = rtol * scale``.
    """
    if fixed_step:
        return tuple(Setting(step=step) for step in sorted(set(steps), reverse=True))
    return tuple(Setting(rtol=rtol, atol=rtol * scale) for rtol in sorted(set(tolerances), reverse=True))


def state_scale(problem: Problem, expected: Expected | None) -> float:
    """Size of the state as a power of ten: of the largest entry at the start and at the truth's transitions.

    A power of ten, rounded towards 1, so that ``atol`` equals ``rtol`` wherever states are of order one, and so
    that the same system in other units is asked for the same digits.
    """
    sizes = [abs(float(value)) for value in problem.initial]
    if expected is not None:
        sizes.append(expected.state_size)
    largest = max((size for size in sizes if math.isfinite(size)), default=0.0)
    return 10.0 ** math.trunc(math.log10(largest)) if largest > 0 else 1.0
