"""What the limit of impacts that accumulate does to a perturbation (:mod:`henon_ref.analysis.variational`)."""

from __future__ import annotations

from collections.abc import Callable
from typing import cast

import numpy as np
import sympy as sp

from henon_ref.analysis.saltation import Matrix
from henon_ref.modes.equations import along
from henon_ref.modes.mode import Mode
from henon_ref.modes.resets import impact_of
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.tape import TIME
from henon_ref.trajectory import Transition


class LimitOfImpacts:
    """Derivatives over the limits of impacts of one system, in double precision.

    Parameters
    ----------
    system : FilippovSystem
        The system itself, without tangent vectors.
    """

    def __init__(self, system: FilippovSystem) -> None:
        self.system = system
        self._functions: dict[tuple[Mode, int], Callable[..., list[float]]] = {}

    def matrix(self, transition: Transition) -> Matrix:
        """What a perturbation after the last impact becomes where a body comes to rest on a surface h, shape (n, n).

        ``I - A (C A)^-1 C``, with the gradients of h and h' in the rows of C, and in the columns of A the change p of
        the state by an impulse that changes h' by 1, and ``(df/dx) p - dp/dt``, by which the state moves on after one.
        When the body comes to rest is of no account: from the impact on the force is the same in the mean. It is the
        limit for a rest that follows at once.
        """
        mode = transition.from_mode
        index = next(i for i, entry in enumerate(transition.to_mode) if entry == 0 != mode[i])
        if (mode, index) not in self._functions:
            self._functions[mode, index] = self._function(mode, index)
        pushes, rows = np.array(self._functions[mode, index](transition.time, *transition.state)).reshape(2, 2, -1)
        return np.eye(len(self.system.states)) - pushes.T @ np.linalg.solve(rows @ pushes.T, rows)

    def _function(self, mode: Mode, index: int) -> Callable[..., list[float]]:
        system, impact = self.system, impact_of(self.system, index)
        assert impact is not None  # a body rests
        states, field, push = system.states, system.equations(mode).field, impact.push
        moved = [
            along(f, states, push) - sp.diff(f, TIME) - along(p, states, field)
            for f, p in zip(field, push, strict=True)
        ]
        rows = [sp.diff(zero, x) for zero in (system.surfaces[index], impact.speed) for x in states]
        numeric = [system.numeric(e) for e in (*push, *moved, *rows)]
        return cast(Callable[..., list[float]], sp.lambdify([TIME, *states], numeric, "math", cse=True))
