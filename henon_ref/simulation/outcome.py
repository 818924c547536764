"""How a run ended."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any

from henon_ref.modes.mode import mode_text
from henon_ref.simulation.system import System
from henon_ref.trajectory import Counts, Status, Trajectory


class Outcome:
    """How a run ended, and what it took.

    Attributes
    ----------
    system : System
        With the parameters of the run.
    trajectory : Trajectory
        What the reference returned.
    status : str
        ``ok``, or how the run ended before its horizon: ``nonunique``, ``invalid``, ``diverged``, ``failed``.
    success : bool
        Whether it is ``ok``.
    message : str
        How the run ended, in one sentence.
    counts : Counts
        ``steps``, ``rhs_evaluations``, ``event_evaluations``, as :class:`henon_ref.baselines.henon.HenonSolver` counts;
        and ``decisions``, how often the run went to Python, by cause (:class:`henon_ref.trajectory.Decisions`).
    undecided_after : dict of str to float
        Surfaces that have been below their own rounding, and since when [s]: of these no later transition is told, for
        double precision does not decide it.
    final_mode : str
        Mode at the end, such as ``s1=-1 s2=0``; empty where there is none to begin with.
    """

    def __init__(self, base: System, parameters: Mapping[Any, Any] | None, trajectory: Trajectory) -> None:
        self._base, self._parameters, self.trajectory = base, parameters, trajectory

    @cached_property
    def system(self) -> System:
        return self._base.with_parameters(self._parameters) if self._parameters else self._base

    @property
    def status(self) -> Status:
        return self.trajectory.status

    @property
    def success(self) -> bool:
        return self.trajectory.status == "ok"

    @property
    def message(self) -> str:
        return self.trajectory.reason or "the run reached its horizon"

    @property
    def counts(self) -> Counts:
        return self.trajectory.counts

    @property
    def undecided_after(self) -> dict[str, float]:
        names = self._base.model.sign_names
        return {names[i]: time for i, time in self.trajectory.undecided_after if 0 <= i < len(names)}

    @property
    def final_mode(self) -> str:
        mode = self.trajectory.end_mode
        return mode_text(mode, self._base.model.sign_names) if mode else ""
