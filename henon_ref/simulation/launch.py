"""From the arguments of a run to where the reference starts it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

from henon_ref.henon.integrator import Integrator
from henon_ref.henon.records import HENON
from henon_ref.henon.start import Start
from henon_ref.simulation.arguments import check_absolute_tolerance, problem_of, stop_of, tolerance_of
from henon_ref.simulation.compiled import integrator_of, local_error
from henon_ref.simulation.system import System
from henon_ref.trajectory import Trajectory


class Launch(NamedTuple):
    """A run that is ready to go."""

    system: System
    """With the parameters of the run."""
    integrator: Integrator
    start: Start

    def ended(self, trajectory: Trajectory) -> Trajectory:
        """What the run returned, with the words for a run that was to stop, and no mode where there was none."""
        if self.start.refused is not None:
            return trajectory._replace(end_mode=())
        if (self.start.stop_falling or self.start.stop_rising) and trajectory.status == "ok":
            last = trajectory.transitions[-1] if len(trajectory.transitions) else None
            if last is not None and (last.time, last.time_low) != self.start.until and last.time == trajectory.end_time:
                name = self.system.model.sign_names[last.surface]
                return trajectory._replace(reason=f"the run stopped on the surface of {name}, as it was to")
        return trajectory


def launch(
    system: System,
    initial: Mapping[Any, Any],
    until: Any,
    start: Any,
    rtol: float,
    atol: float | None,
    parameters: Mapping[Any, Any] | None,
    mode: Mapping[Any, int] | None,
    stop: Mapping[Any, str] | None,
) -> Launch:
    """Read the arguments of :func:`henon_ref.simulation.simulate.simulate`.

    Raises
    ------
    ArgumentError
        For what cannot be meant.
    """
    error = local_error(tolerance_of(rtol, "rtol"))
    if atol is not None:
        check_absolute_tolerance(atol)
    system, problem = problem_of(system, initial, until=until, start=start, parameters=parameters, mode=mode)
    integrator = integrator_of(system, error)
    begin = integrator.start(problem, tolerance=error, landing=HENON)
    if stop:
        falling, rising = stop_of(system, stop)
        begin = replace(begin, stop_falling=falling, stop_rising=rising)
    return Launch(system, integrator, begin)
