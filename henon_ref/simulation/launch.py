"""Launch of a run: from its arguments to the integrator and start, and from the trajectory to the outcome."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from threading import Lock
from typing import Any

from henon_ref.errors import ModelError
from henon_ref.integrator.integrator import MOST_STEPS, NO_LIMIT, Integrator, Start, local_error, order_for
from henon_ref.integrator.run_result import shown
from henon_ref.modes.mode import mode_text
from henon_ref.precision import one_at_a_time
from henon_ref.simulation.arguments import check_system, problem_of, start_of, stop_of, tolerance_of, whole_number
from henon_ref.simulation.quick_start import QuickStart
from henon_ref.simulation.system import System
from henon_ref.terminal import notice_if_slow
from henon_ref.trajectory import Counts, Status, Trajectory

MAX_COMPILED_SYSTEMS = 64
"""Largest number of cached compiled systems and orders; the least recently used one is dropped."""

_kept: OrderedDict[tuple[object, int, frozenset[int]], Integrator] = OrderedDict()
_lock = Lock()


def integrator_of(system: System, tolerance: float, open_kinks: frozenset[int] = frozenset()) -> Integrator:
    """Return the integrator of a system, for any values of its parameters, at the order for a local error.

    ``open_kinks``: see :class:`henon_ref.modes.system.FilippovSystem`. The integrator is created at the first request
    for a system of this structure. One thread creates an integrator at a time; other threads wait.
    """
    key = system.structure, order_for(tolerance), open_kinks
    with _lock:
        if key in _kept:
            _kept.move_to_end(key)
            return _kept[key]
        made = Integrator(replace(system.model, parameters={}, open_kinks=open_kinks), key[1])
        _kept[key] = made
        while len(_kept) > MAX_COMPILED_SYSTEMS:
            _kept.popitem(last=False)
        return made


def launch(
    system: System,
    initial: Any,
    until: Any,
    start: Any,
    rtol: float,
    parameters: Mapping[Any, Any] | None,
    mode: Mapping[Any, int] | None,
    stop: Mapping[Any, str] | None,
    max_steps: int,
) -> tuple[Integrator, Start]:
    """Read the arguments of :func:`henon_ref.simulate`; ArgumentError if one is invalid."""
    check_system(system)
    if start is None and system.own_start is None:
        start = 0
    if type(initial) is not dict or until is None or start is None:
        initial, until, start, mode = start_of(system, initial, until, start, mode)
    tolerance = rtol if type(rtol) is float else tolerance_of(rtol)
    quick: QuickStart | None = system.prepared.get(tolerance)
    begin = None if quick is None else quick(initial, until, start, parameters, mode)
    stopping = (0, 0) if stop is None else stop_of(system, stop)
    if begin is not None and quick is not None:
        integrator = quick.integrator
    else:  # errors are reported before anything is compiled
        error = local_error(tolerance_of(tolerance))
        given = {"until": until, "start": start, "parameters": parameters, "mode": mode}
        own, problem = problem_of(system, initial, **given, error=error)
        with notice_if_slow():
            integrator = integrator_of(own, error, problem.system.open_kinks)
            with one_at_a_time():
                begin = integrator.start(problem, tolerance=error)
            if tolerance not in system.prepared:
                quick = _prepared(system, tolerance)
                if quick is not None:  # loads its compiled functions now, not in the second run
                    quick(initial, until, start, parameters, mode)
    if stop is not None or type(max_steps) is not int or max_steps != MOST_STEPS:
        run = begin.scalars
        run.stop_falling, run.stop_rising = stopping
        run.most_steps = min(whole_number(max_steps, "max_steps"), NO_LIMIT)
    return integrator, begin


def _prepared(system: System, tolerance: float) -> QuickStart | None:
    """Prepare the starts of later runs at a tolerance, at up to 32 tolerances."""
    if len(system.prepared) >= 32:
        system.prepared.clear()
    error = local_error(tolerance)
    integrator, made = integrator_of(system, error), None
    if not system.has_moving_exponents:
        with suppress(ModelError):
            made = QuickStart(system, integrator, error)
    system.prepared[tolerance] = made
    return made


def ended(trajectory: Trajectory, begin: Start, system: System) -> Trajectory:
    """Return the result of a run without hidden kinks."""
    if begin.refused is not None:
        return trajectory._replace(end_mode=())
    return shown(trajectory, system.model if system.model.kinks else None)


class Outcome:
    """End of a run, and its work.

    Attributes
    ----------
    system : System
        System with the parameters of the run.
    trajectory : Trajectory
        Result of the integrator.
    status : str
        ``ok``, or the way in which the run ended early: ``nonunique``, ``invalid``, ``diverged``, ``failed``.
    success : bool
        Whether the status is ``ok``.
    message : str
        End of the run in one sentence.
    counts : Counts
        ``steps``, ``rhs_evaluations``, ``event_evaluations``, as in :class:`henon_ref.baselines.henon.HenonSolver`; and
        ``decisions``, the number of calls of Python by cause (:class:`henon_ref.trajectory.Decisions`).
    undecided_after : dict of str to float
        Surface -> first time at which its function was below its rounding error [s]. Double precision does not decide
        whether it reached zero there: from this time on the reported transitions may lack some of the surface. The
        key ``valid`` stands for the expressions of ``valid``: after its time the run may have left its range.
    final_mode : str
        Mode at the end, such as ``s1=-1 s2=0``; empty if no initial mode exists.
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
        first: dict[str, float] = {}
        for i, time in self.trajectory.undecided_after:
            if i < len(names):
                name = "valid" if i < 0 else names[i]
                first[name] = min(time, first.get(name, time))
        return first

    @property
    def final_mode(self) -> str:
        mode = self.trajectory.end_mode
        return mode_text(mode, self._base.model.sign_names) if mode else ""
