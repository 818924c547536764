"""Expected results of a reading: published figures, closed forms, orbits, gates, the end of the run."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace

import sympy as sp

from henon_ref.casefile.schema import CaseForm, Exact, Expect, Orbit
from henon_ref.expressions.bounds import exact_sign
from henon_ref.modes.problem import Problem
from henon_ref.system.source import Source
from henon_ref.text import did_you_mean, listed


def _precedes(one: tuple[sp.Expr, float], other: tuple[sp.Expr, float]) -> bool:
    """Compare two exact numbers by their doubles, and exactly only if the doubles nearly agree."""
    if abs(one[1] - other[1]) > 1e-12 * (abs(one[1]) + abs(other[1])):
        return one[1] < other[1]
    return one[0] != other[0] and exact_sign(other[0] - one[0]) > 0


def exact(source: Source, form: CaseForm, problem: Problem) -> Exact | None:
    """Read the closed forms as exact numbers; the transition times must be in order and within the run."""
    if form.exact is None:
        return None
    modes, times = form.exact.modes, []
    before, until = ((limit, float(limit)) for limit in (problem.start, problem.until))
    for i in range(len(form.exact.transition_times)):
        path = ("exact", "transition_times", i)
        number = source.number(path, problem.system.parameter_values)
        time = (number, float(number))
        if _precedes(time, before):
            raise source.error(path, "exact transition times must be in increasing order and not before the start")
        if _precedes(until, time):
            raise source.error(path, "this exact transition time is after 'until'")
        times.append(number)
        before = time
    for i, mode in enumerate(modes):
        if len(mode) != len(problem.system.surfaces):
            message = f"a mode needs one entry for each surface ({len(problem.system.surfaces)}), not {len(mode)}"
            raise source.error(("exact", "modes", i), message)
    if modes and len(modes) < len(times):
        message = f"{len(times)} transition times but {len(modes)} modes; give the mode after every transition"
        raise source.error(("exact", "modes"), message)
    return Exact(tuple(times), modes)


def orbit(source: Source, form: CaseForm, problem: Problem) -> Orbit | None:
    """Read the periodic orbit that the case claims, with an exact period."""
    if form.orbit is None:
        return None
    period = source.number(("orbit", "period"), problem.system.parameter_values)
    if exact_sign(period) <= 0:
        raise source.error(("orbit", "period"), "a period must be larger than 0")
    return replace(form.orbit, period=period)


def expectation(source: Source, form: CaseForm, problem: Problem) -> Expect | None:
    """Read how and when the run is expected to end; the time must be within the run, status ok at the horizon."""
    found, path = form.expect, ("expect", "time")
    if found is None or found.time is None:
        return found
    time = source.number(path, problem.system.parameter_values)
    if found.status == "ok" and exact_sign(problem.until - time) != 0:
        raise source.error(path, f"a run with status ok ends at 'until', {problem.until}; leave 'time' out")
    if exact_sign(time - problem.start) < 0 or exact_sign(problem.until - time) < 0:
        raise source.error(path, f"the time must be between the start, {problem.start}, and 'until', {problem.until}")
    return replace(found, time=time)


def check_gates(source: Source, form: CaseForm, fixed_step: Callable[[str], bool] | None) -> None:
    """Raise CaseError if a gate names a solver or a tolerance that is not run."""
    for solver, gate in form.gate.items():
        if form.solvers and solver not in form.solvers:
            message = f"the gate names '{solver}', which is not among 'solvers'"
            raise source.error(("gate", solver), message, key=True)
        if gate.at is not None and gate.at not in form.tolerances:
            tolerances = listed([f"{tolerance:g}" for tolerance in form.tolerances])
            raise source.error(("gate", solver, "at"), f"{gate.at:g} is not among 'tolerances': {tolerances}")
        if gate.at is not None and fixed_step is not None and fixed_step(solver):
            message = f"'{solver}' has steps, not tolerances; leave 'at' out to gate its row with the smallest step"
            raise source.error(("gate", solver, "at"), message, key=True)


def check_runs(source: Source, form: CaseForm, known: Collection[str] | None) -> None:
    """Raise CaseError if a solver is unknown, or a solver, tolerance or step is listed twice."""
    for key, entries in (("solvers", form.solvers or ()), ("tolerances", form.tolerances), ("steps", form.steps)):
        for i, entry in enumerate(entries):
            if entry in entries[:i]:
                raise source.error((key, i), f"{entry} is listed twice in '{key}'")
    if known is None:
        return
    for i, solver in enumerate(form.solvers or ()):
        if solver not in known:
            raise source.error(("solvers", i), unknown_solver(solver, known))
    for solver in form.gate:
        if solver not in known:
            raise source.error(("gate", solver), unknown_solver(solver, known), key=True)


def unknown_solver(solver: str, known: Collection[str]) -> str:
    """Error message for an unknown solver name."""
    hint = "a solver of your own becomes available once its package is installed"
    return f"unknown solver '{solver}'{did_you_mean(solver, known)}; solvers: {listed(known)}; {hint}"
