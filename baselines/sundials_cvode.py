"""SUNDIALS CVODE by scikit-sundae, with its own rootfinding: Adams and BDF.

At its starting point CVODE takes an event function that is exactly zero out of play until it has left zero,
so it does not fire again there; one that is a rounding off zero it takes at its sign. Hence ``direction`` as default
(:mod:`henon_ref.baselines.restart`): the guard as it is, falling roots alone. No restart is right more often over the
suite; an event-free step is so less often, since a guard that stays at zero is not out of play behind it. The first
steps (order 1, with Newton's iteration stopped at a part of the tolerance) move a guard by about the tolerance. Which
of the documentation's advice is followed: ``docs/solvers.md``.

Roots are located by the Illinois method on the Nordsieck polynomial to ``100 eps (abs(t) + abs(h))``; a
pair of roots inside one step is not seen. scikit-sundae keeps the events of earlier calls of one object, so
every run of a mode gets a new object; its ``max_num_steps`` counts between outputs and does not bound a run:
the deadline does, inside the callbacks.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from henon_ref.baselines.adapter import ConfiguredLibrary
from henon_ref.baselines.callbacks import filling_field
from henon_ref.baselines.mode_functions import ModeFunctions
from henon_ref.baselines.numba_callbacks import Callbacks
from henon_ref.baselines.restart import Restart
from henon_ref.baselines.sundials import SundialsAdapter, SundialsFlow
from henon_ref.baselines.work import Work


@dataclass(frozen=True)
class SundialsCvode(SundialsAdapter):
    """CVODE on one smooth mode after another, dense Newton iteration with the Jacobian that SymPy derives.

    Counts: ``steps`` are internal steps; ``rhs_evaluations`` are CVODE's own count of right-hand sides
    (Jacobians not counted); ``event_evaluations`` all evaluations of one guard each, the guard against
    divergence among them. A second pass for samples is not counted.
    """

    method: Literal["Adams", "BDF"]
    restart: Restart = field(default="direction", kw_only=True)
    callbacks: Callbacks = "python"
    """Right-hand side and Jacobian in plain Python or compiled; the event function is plain Python."""

    def load(self) -> Callable[..., Any]:
        """The class ``CVODE``."""
        from sksundae.cvode import CVODE

        return CVODE

    def flow(self, library: ConfiguredLibrary, model: ModeFunctions, work: Work, horizon: float) -> _Flow:
        return _Flow(self, library, model, work, horizon)


class _Flow(SundialsFlow):
    """CVODE on one mode."""

    def __init__(
        self, adapter: SundialsCvode, library: ConfiguredLibrary, model: ModeFunctions, work: Work, horizon: float
    ) -> None:
        super().__init__(library, model, work, horizon)
        self.function = filling_field(model, adapter.callbacks, work)
        jacobian = model.jacobian(adapter.callbacks)

        def jacfn(t: float, x: NDArray[np.float64], xp: NDArray[np.float64], out: NDArray[np.float64]) -> None:
            jacobian.fill(t, x, out)

        self.connect(jacfn, self.gates.watchers(work.count_event), method=adapter.method)

    def start(self, t: float, x: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
        """The unknowns."""
        return (x,)


ADAMS = SundialsCvode("cvode-adams", "Adams")
BDF = SundialsCvode("cvode-bdf", "BDF")
