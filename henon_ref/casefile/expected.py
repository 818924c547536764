"""What a reading is scored against: published figures, closed forms, orbits, the gate, an expected end."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from decimal import Decimal

import sympy as sp

from henon_ref.casefile.schema import CaseForm, ExpectedStatus, ExpectedVerdict, GateStatus
from henon_ref.casefile.source import Names, Source
from henon_ref.modes.bounds import Rounded, exact_sign
from henon_ref.modes.mode import Mode
from henon_ref.modes.problem import Problem
from henon_ref.text import did_you_mean, listed


@dataclass(frozen=True)
class Published:
    """Figures of the source with the digits it prints."""

    stick_durations: tuple[Decimal, ...] = ()
    """[s]; a source that prints fewer than there are sticks means them to repeat in this order."""
    stick_lengths: tuple[Decimal, ...] = ()
    transition_times: tuple[Decimal, ...] = ()
    """[s], of any of the transitions: each stands beside the exact one that is nearest."""


@dataclass(frozen=True)
class Exact:
    """Closed forms as exact numbers; they outrank computed truth."""

    transition_times: tuple[sp.Expr, ...]
    """[s], in order, from the first transition on."""
    modes: tuple[Mode, ...] = ()
    """Mode after each transition, of all of them (there may be more than closed forms); empty where not given."""


@dataclass(frozen=True)
class Orbit:
    """A periodic orbit that is known or claimed."""

    period: sp.Expr
    """[s]."""
    sticks: tuple[Decimal, ...] = ()
    """Durations [s]."""
    crossings: tuple[Decimal, ...] = ()
    """Times modulo the period [s]."""


@dataclass(frozen=True)
class Gate:
    """What one solver must reach for ``--gate``."""

    at: float | None = None
    """Tolerance of the row; None: the tightest (for a fixed-step solver the smallest step)."""
    max_time_error: float | None = None
    """[s]."""
    max_stick_error: float | None = None
    """[s]."""
    status: GateStatus = "ok"


@dataclass(frozen=True)
class Expect:
    """How a run has to end."""

    status: ExpectedStatus
    reason: str | None = None
    time: sp.Expr | None = None
    """Where it ends [s]."""
    verdict: ExpectedVerdict | None = None
    """What is said of runs that miss or invent transitions, where rounding alone decides on them."""


def published(form: CaseForm) -> Published | None:
    """Figures of the source."""
    if form.published is None:
        return None
    found = form.published
    return Published(tuple(found.stick_durations), tuple(found.stick_lengths), tuple(found.transition_times))


def exact(source: Source, form: CaseForm, names: Names, problem: Problem) -> Exact | None:
    """Closed forms; they must lie within the run and must not fall."""
    if form.exact is None:
        return None
    times: list[sp.Expr] = []
    before, until = Rounded(problem.start), Rounded(problem.until)
    for i in range(len(form.exact.transition_times)):
        path = ("exact", "transition_times", i)
        time = Rounded(source.number(path, names.values))
        if time < before:
            raise source.error(path, "exact transition times come in order, from the start on")
        if until < time:
            raise source.error(path, "this exact transition time lies beyond 'until'")
        times.append(time.exact)
        before = time
    modes = tuple(tuple(mode) for mode in form.exact.modes)
    for i, mode in enumerate(modes):
        if len(mode) != len(problem.system.surfaces):
            message = f"a mode has an entry for each surface ({len(problem.system.surfaces)}), not {len(mode)}"
            raise source.error(("exact", "modes", i), message)
    if modes and len(modes) < len(times):
        message = f"{len(times)} transition times but {len(modes)} modes; give the mode after every transition"
        raise source.error(("exact", "modes"), message)
    return Exact(tuple(times), modes)


def orbit(source: Source, form: CaseForm, names: Names) -> Orbit | None:
    """A periodic orbit that the case claims."""
    if form.orbit is None:
        return None
    period = source.number(("orbit", "period"), names.values)
    if exact_sign(period) <= 0:
        raise source.error(("orbit", "period"), "a period must be larger than 0")
    return Orbit(period, tuple(form.orbit.sticks), tuple(form.orbit.crossings))


def expectation(source: Source, form: CaseForm, names: Names, problem: Problem) -> Expect | None:
    """How the case says the run ends, and where: within the run, with status ok at its horizon."""
    if form.expect is None:
        return None
    path, status = ("expect", "time"), form.expect.status
    time = source.number(path, names.values) if form.expect.time is not None else None
    if time is not None and status == "ok" and exact_sign(problem.until - time) != 0:
        raise source.error(path, f"a run with status ok ends at 'until', {problem.until}; leave 'time' out")
    if time is not None and (exact_sign(time - problem.start) < 0 or exact_sign(problem.until - time) < 0):
        raise source.error(path, f"the run ends between its start, {problem.start}, and 'until', {problem.until}")
    return Expect(status, form.expect.reason, time, form.expect.verdict)


def gates(source: Source, form: CaseForm, fixed_step: Callable[[str], bool] | None) -> dict[str, Gate]:
    """The gate, each solver's row among those that are run."""
    found = {}
    for solver, gate in form.gate.items():
        if form.solvers and solver not in form.solvers:
            message = f"the gate names '{solver}', which is not among 'solvers'"
            raise source.error(("gate", solver), message, key=True)
        if gate.at is not None and gate.at not in form.tolerances:
            tolerances = listed([f"{tolerance:g}" for tolerance in form.tolerances])
            raise source.error(("gate", solver, "at"), f"{gate.at:g} is not among 'tolerances': {tolerances}")
        if gate.at is not None and fixed_step is not None and fixed_step(solver):
            message = f"'{solver}' has steps and no tolerances; without 'at' its row with the smallest step is meant"
            raise source.error(("gate", solver, "at"), message, key=True)
        found[solver] = Gate(gate.at, gate.max_time_error, gate.max_stick_error, gate.status or "ok")
    return found


def check_runs(source: Source, form: CaseForm, known: Collection[str] | None) -> None:
    """Refuse solvers that do not exist, and a solver, tolerance or step that stands twice."""
    for key, entries in (("solvers", form.solvers or []), ("tolerances", form.tolerances), ("steps", form.steps)):
        for i, entry in enumerate(entries):
            if entry in entries[:i]:
                raise source.error((key, i), f"{entry} stands twice in '{key}'")
    if known is None:
        return
    for i, solver in enumerate(form.solvers or []):
        if solver not in known:
            raise source.error(("solvers", i), unknown_solver(solver, known))
    for solver in form.gate:
        if solver not in known:
            raise source.error(("gate", solver), unknown_solver(solver, known), key=True)


def unknown_solver(solver: str, known: Collection[str]) -> str:
    """What is wrong with a solver's name, and what may be written."""
    own = "one of your own is known once its package is installed"
    return f"unknown solver '{solver}'{did_you_mean(solver, known)}; solvers: {listed(known)}; {own}"
