"""Right-hand sides as libraries call them back: on arrays, counted, and stopped at the deadline."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from henon_ref.baselines.flow import LIMIT
from henon_ref.baselines.mode_functions import EPSILON, ModeFunctions
from henon_ref.baselines.numba_callbacks import Callbacks
from henon_ref.baselines.work import Stalled, Work
from henon_ref.modes.callables import ARITHMETIC

STALL = 2000
"""Evaluations in a row, at accepted steps and while a root is sought, within four roundings of one time."""

Field = Callable[[float, NDArray[np.float64]], Any]
"""``f(t, x)`` -> n values (a tuple or an array)."""


def counted_field(model: ModeFunctions, callbacks: Callbacks, work: Work) -> Field:
    """Time derivatives of a mode's unknowns on an array; NaN where the field has no value.

    Parameters
    ----------
    model : ModeFunctions
    callbacks : {"python", "numba"}
        The field itself; counting and the deadline stay in Python.
    work : Work
        Every call counts, and past the deadline raises.
    """
    n = len(model.unknowns)
    count = work.count_rhs
    if callbacks == "numba":
        fill, _ = model.compiled_derivatives()
        fill(0.0, np.ones(n), np.empty(n))  # compiles now, not in the run

        def jitted(t: float, x: NDArray[np.float64]) -> NDArray[np.float64]:
            count()
            out = np.empty(n)
            fill(t, x, out)
            return out

        return jitted
    field, nowhere = model.derivatives, (math.nan,) * n

    def interpreted(t: float, x: NDArray[np.float64]) -> tuple[float, ...]:
        count()
        try:
            return field(t, *x.tolist())
        except ARITHMETIC:
            return nowhere

    return interpreted


def filling_field(model: ModeFunctions, callbacks: Callbacks, work: Work) -> Callable[..., None]:
    """``rhs(t, x, out)`` that writes the time derivatives of a mode's unknowns into the library's array.

    The compiled one is handed over as it is: the library counts its calls, and the deadline is looked at in
    the event function.
    """
    if callbacks == "numba":
        fill, whole = model.compiled_derivatives()
        point = np.ones(len(model.unknowns))
        point.flags.writeable = False  # as the library hands it in: a type of its own to numba
        fill(0.0, point, np.empty(point.size))
        if whole:
            return fill
    field = counted_field(model, callbacks, work)

    def rhs(t: float, x: NDArray[np.float64], out: NDArray[np.float64]) -> None:
        out[:] = field(t, x)

    return rhs


class LastSeen:
    """The function ``1e100 - sum of abs(x)``, whose root is divergence; remembers the latest point it was asked at.

    Libraries evaluate it at every accepted step, so what it remembers is where a run was when it failed, and it
    notices where steps no longer move the time: some libraries go on then, at a pole for ever.

    Parameters
    ----------
    states : int
        The state is the first so many entries of the arrays.
    count : callable
        Called at every evaluation.
    """

    def __init__(self, states: int, count: Callable[[], None]) -> None:
        self._states = states
        self._count = count
        self._mark = -math.inf
        self._still = 0
        self.t = -math.inf
        self.x: tuple[float, ...] = ()

    def start(self, t: float, x: tuple[float, ...]) -> None:
        """Begin a run of a mode at (t, x)."""
        self.t, self.x = t, x
        self._mark, self._still = t, 0

    def value(self, t: float, x: NDArray[np.float64]) -> float:
        """1e100 - sum of abs(x).

        Raises
        ------
        Stalled
            Where the time has not moved for :data:`STALL` evaluations.
        """
        self._count()
        values = x[: self._states].tolist()
        if t > self._mark + 4.0 * EPSILON * abs(t):
            self._mark, self._still = t, 0
        else:
            self._still += 1
            if self._still > STALL:
                raise Stalled(f"the steps no longer move the time t = {t:.17g}")
        size = sum(map(abs, values))
        if t > self.t and size < math.inf:  # not so where a value is NaN
            self.t, self.x = float(t), tuple(values)
        return LIMIT - size
