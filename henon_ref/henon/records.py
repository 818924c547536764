"""Records that the compiled loop and Python share, and the numbers in their fields: ``henon_ref/kernel/kernel.h``."""

from __future__ import annotations

from typing import Any

import numpy as np

from henon_ref.kernel.shared import kernel, record_dtype

STICK: int = kernel.STICK
RELEASED: int = kernel.RELEASED
CROSSING: int = kernel.CROSSING
GRAZE: int = kernel.GRAZE
RESET: int = kernel.RESET
"""Kinds of transitions."""
HENON: int = kernel.HENON
NEWTON: int = kernel.NEWTON
BRENT: int = kernel.BRENT
"""Ways of landing."""
LANDINGS = ("henon", "newton", "brent", "bracket")
"""Their names, and that of bisection, which they fall back on."""
MODE, GUARD = record_dtype("mode"), record_dtype("guard")
"""A compiled mode, and a guard of it."""
TRANSITION = record_dtype("transition")
"""A transition; behind it in memory stands the state, n doubles (see :func:`transition_dtype`)."""
TRANSITION_PLACES = TRANSITION.itemsize // 8
"""Its length in doubles."""
STEP = record_dtype("step")
"""A step that was taken; behind it in memory stand the states' Taylor coefficients (see :func:`step_dtype`)."""
STEP_PLACES = STEP.itemsize // 8
"""Its length in doubles."""


def mode_dtype(guards: int) -> np.dtype[Any]:
    """A mode with its guards, as one row of a table; ``guards``: of the largest mode."""
    return np.dtype([("mode", MODE), ("guards", GUARD, (guards,))])


def transition_dtype(states: int) -> np.dtype[Any]:
    """A transition with its state."""
    return _followed(TRANSITION, "state", (states,))


def step_dtype(states: int, order: int) -> np.dtype[Any]:
    """A step with the states' coefficients: x_i(time + tau unit) = sum over k of coefficients[i, k] tau^k."""
    return _followed(STEP, "coefficients", (states, order + 1))


def _followed(record: np.dtype[Any], name: str, shape: tuple[int, ...]) -> np.dtype[Any]:
    """A record and the doubles that stand behind it."""
    assert record.names is not None
    return np.dtype([*((field, record[field]) for field in record.names), (name, "f8", shape)], align=True)
