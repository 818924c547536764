"""Periodic orbit to which a motion converges, with a proof; measured period of a settled run."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.enclosure.periodic_orbit import PeriodicOrbit, find_periodic_orbit
from henon_ref.enclosure.return_map import Guess, OrbitError
from henon_ref.errors import ArgumentError
from henon_ref.integrator.run import prepared_run
from henon_ref.modes.problem import Problem
from henon_ref.simulation.arguments import problem_of, tolerance_of
from henon_ref.simulation.system import System
from henon_ref.system.python_arguments import explained
from henon_ref.taylor.tape import TIME
from henon_ref.trajectory import Trajectory, Transition

REPETITIONS, LONGEST = 3, 64
"""Repetitions of a pattern required at the end of a run; largest number of transitions of a pattern."""
LAST_TRANSITIONS = 100_000
"""Number of transitions at the end of a run that are examined, which limits the memory."""


@explained
def periodic_orbit(
    system: System,
    initial: Mapping[Any, Any],
    *,
    until: Any,
    start: Any = 0,
    rtol: float = 1e-12,
    period: Any = None,
    parameters: Mapping[Any, Any] | None = None,
    mode: Mapping[Any, int] | None = None,
    radius: float = 1e-40,
) -> PeriodicOrbit:
    """Find and prove the periodic orbit to which a run converges: all its numbers are enclosures.

    Newton's method on the return map starts from the end of the run. Krawczyk's test then proves that a box contains
    exactly one fixed point (Krawczyk, *Computing* 4 (1969) 187-201). The flow is enclosed by validated integration
    (Lohner, 1988), its derivative with saltation matrices.

    Parameters
    ----------
    system : System
    initial : mapping
        State -> number.
    until : number
        Time by which the run is close to the orbit [s].
    start, rtol, parameters, mode
        As in :func:`henon_ref.simulate`.
    period : number or text, optional
        Exact period of the forcing or a multiple of it, required if the equations contain time: ``"2*pi/w"`` [s].
    radius : float
        Requested radius of state, period and derivative.

    Returns
    -------
    PeriodicOrbit
        ``state``, ``period``, ``multipliers`` and the times of ``events`` in ball arithmetic (python-flint's ``arb``).

    Raises
    ------
    HenonRefError
        For invalid arguments, if the run does not repeat itself by ``until``, or if the proof fails; the message names
        the cause.

    Examples
    --------
    >>> import henon_ref as hr
    >>> belt = hr.System(["x", "v"], {"F": 1, "d": 3, "vb": 0.2}, {"s": "v - vb"}, ["v", "-x - F*s/(1 + d*s*(v - vb))"])
    >>> orbit = hr.periodic_orbit(belt, {"x": 1.5, "v": 0}, until=100)
    >>> print(orbit.period.str(15, radius=False), float(orbit.period.rad()) < 1e-40)
    12.0010312948306 True
    """
    system, problem = problem_of(system, initial, until=until, start=start, parameters=parameters, mode=mode)
    if not (isinstance(radius, float | int) and 0 < radius < 1):
        raise ArgumentError(f"radius is {str(radius)[:60]}; wanted a number between 0 and 1")
    tolerance = tolerance_of(rtol)
    run = prepared_run(problem, rtol=tolerance)()
    if run.status != "ok":
        raise OrbitError(f"the run towards the orbit ended {run.status}: {run.reason}")
    run = run._replace(transitions=run.transitions[-LAST_TRANSITIONS:])
    late = float(problem.start) + 0.5 * (run.end_time - float(problem.start))
    _refuse_limits(problem, [t for t in run.transitions if t.time > late])
    if period is not None:
        length = system.number(period, "period")
        if not length.is_positive:
            raise ArgumentError(f"period is {str(length)[:60]}; wanted a time in s, larger than 0")
        return find_periodic_orbit(system.model, _between_events(problem, run, length, tolerance), radius=radius)
    return _autonomous(problem, run, late, radius)


def _autonomous(problem: Problem, run: Trajectory, late: float, radius: float) -> PeriodicOrbit:
    """Return the orbit of an autonomous system, with the period measured from ``late`` on."""
    if any(e.has(TIME) for e in problem.system.expressions):
        where = "the equations or 'valid'"
        raise ArgumentError(f"time is in {where}: give the period of the forcing, as in period='2*pi/w'")
    repeated = measured_period(run.transitions, after=late)
    advice = "give a later 'until', or it is not periodic"
    if not any(t.time > late for t in run.transitions):
        section = {"section": problem.system.state_names[-1]}
        advice = f"it has no transitions there; add a surface that the orbit crosses, as in surfaces={section}"
    open_ended = OrbitError(
        f"the run does not repeat itself three times between t = {late:.6g} and {run.end_time:.6g}: {advice}"
    )
    if repeated is None:
        raise open_ended
    orbit = find_periodic_orbit(problem.system, _after_an_event(problem, repeated.pattern), radius=radius)
    if not repeated.settled and not all(abs(m) < 1 for m in orbit.multipliers):
        raise open_ended
    return orbit


def _refuse_limits(problem: Problem, late: Sequence[Transition]) -> None:
    """Raise OrbitError if impacts accumulate on the orbit: no return map is enclosed across their limit."""
    impacts = {(t.time, t.time_low, t.surface) for t in late if t.kind == "reset"}
    for t in late:
        rests = t.kind == "stick" and problem.system.rests(t.surface)
        if rests and (t.time, t.time_low, t.surface) not in impacts:
            name = problem.system.sign_names[t.surface]
            raise OrbitError(f"impacts on {name} accumulate at t = {t.time:.17g}: no orbit is proven across it")


def _between_events(problem: Problem, run: Trajectory, period: sp.Expr, tolerance: float) -> Guess:
    """Return a start in the last period of a run, as far from its events as possible; without events, the horizon."""
    since = run.end_time - float(period)
    times = sorted({t.time for t in run.transitions if t.time > since})
    if not times or since < float(problem.start):
        return Guess(problem.until, run.end_state, run.end_mode, period=period)
    gaps = np.diff([*times, times[0] + float(period)])
    k = int(np.argmax(gaps))
    time = times[k] + float(gaps[k]) / 2
    time -= float(period) if time > run.end_time else 0.0
    there = prepared_run(problem, rtol=tolerance, sample_times=np.array([time]))()
    assert there.samples is not None  # sample_times is given
    assert there.sample_modes is not None
    return Guess(sp.Rational(time), tuple(there.samples[0].tolist()), there.sample_modes[0], period=period)


def _after_an_event(problem: Problem, pattern: Sequence[Transition]) -> Guess:
    """Return a start just after a change of mode or a jump, to which the orbit returns after one period.

    It is the last event whose guard is known: if several surfaces change at one instant, only a reset identifies it.
    """
    changes = [t for t in pattern if t.kind != "graze"]
    instants = [list(together) for _, together in groupby(changes, key=lambda t: (t.time, t.time_low))]
    together = next((i for i in reversed(instants) if len(i) == 1 or any(t.kind == "reset" for t in i)), instants[-1])
    first, last = next((t for t in together if t.kind == "reset"), together[0]), together[-1]
    return Guess(
        problem.start,
        last.state,
        last.to_mode,
        events=len(instants),
        surface=first.surface,
        tangent=first.kind == "release" and first.surface not in problem.system.overrides,
        reset=first.kind == "reset",
    )


class Period(NamedTuple):
    """Repeating part of a settled run."""

    value: float
    """Period [s]: mean over all repetitions."""
    pattern: tuple[Transition, ...]
    """Transitions of the last period."""
    settled: bool
    """Whether the transitions repeat to the tolerance; if not, they converge and are near their limit."""


def measured_period(transitions: Iterable[Transition], *, after: float) -> Period | None:
    """Return the period at the end of a run of an autonomous system, from its transitions after a time [s].

    None if no pattern of up to :data:`LONGEST` transitions is repeated at least three times at the end.
    """
    late = [t for t in transitions if t.time > after]
    if len(late) < REPETITIONS:
        return None
    states = np.array([t.state for t in late])
    known: dict[object, int] = {}
    changes = np.array([known.setdefault((t.kind, t.surface, t.to_mode), len(known)) for t in late])
    times = np.array([t.time for t in late]) - late[0].time
    times += np.array([t.time_low for t in late]) - late[0].time_low
    lengths = range(1, min(LONGEST, len(late) // REPETITIONS) + 1)
    sizes = [float(np.abs(states[-REPETITIONS * length :]).max()) for length in lengths]
    returns = []
    for length in lengths:
        apart = np.abs(states[length:] - states[:-length]).max(axis=1)
        apart[changes[length:] != changes[:-length]] = np.inf
        returns.append(apart)
    for length, apart, size in zip(lengths, returns, sizes, strict=True):
        same = apart <= 1e-9 * size
        if same[-(REPETITIONS - 1) * length :].all():
            first = 0 if same.all() else len(same) - int(np.argmin(same[::-1]))
            return _period(late[first:], times[first:], length, settled=True)
    for length, apart, size in zip(lengths, returns, sizes, strict=True):
        before, now = apart[-2 * length : -length].max(), apart[-length:].max()
        # Distance to the limit of a geometric series; Newton's method converges from here.
        if now < before < np.inf and now * now / (before - now) <= 1e-2 * size:
            return _period(late[-REPETITIONS * length :], times[-REPETITIONS * length :], length, settled=False)
    return None


def _period(late: list[Transition], times: NDArray[np.float64], length: int, *, settled: bool) -> Period:
    count = (len(late) - 1) // length
    return Period(float((times[count * length] - times[0]) / count), tuple(late[-length:]), settled)
