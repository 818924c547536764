"""Check the result of a solver in the worker; a result that violates the contract becomes a failed row.

What is refused raises a ContractError with the name of the value, the value, and what was wanted.

The checked result consists of built-in types: exact ``str``, ``int``, ``float``, ``tuple`` and ``Transition``. The rest
of the package relies on these. A solver may return NumPy numbers, or objects of its own classes that change between two
accesses or after pickling; none of these leaves the worker.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Sequence
from itertools import islice, zip_longest
from numbers import Integral, Real
from typing import TypeVar, get_args

from henon_ref.errors import ContractError
from henon_ref.harness.campaign.options import shown
from henon_ref.modes.mode import Mode
from henon_ref.modes.problem import Problem
from henon_ref.text import short_line
from henon_ref.trajectory import Counts, Kind, Status, Trajectory, Transition

Word = TypeVar("Word", bound=str)


class _Wrong(Exception):  # noqa: N818 - converted to a ContractError when the full name of the value is known
    """Invalid part of a trajectory; arguments: its name, its value, and a description of a valid value."""


def check_prepared(run: object, *, landing: object, version: object) -> tuple[str, str]:
    """Refuse a run that is not callable; return landing and version, which must be strings, each on one line."""
    if not callable(run):
        raise ContractError(f"the solver's prepare() returned {_typed(run)}, wanted a function that runs it")
    words = []
    for what, value in (("landing", landing), ("version", version)):
        if not isinstance(value, str):
            raise ContractError(f"the solver's {what} is {_typed(value)}, wanted a str")
        words.append(short_line(value))
    return words[0], words[1]


def check_trajectory(returned: object, problem: Problem, *, most: int) -> Trajectory:
    """Convert the result of a run to a trajectory of built-in types with at most ``most`` transitions.

    Samples are dropped: no scored run is asked for samples.
    """
    if not isinstance(returned, Trajectory):
        raise ContractError(f"the solver returned {_typed(returned)}, wanted a Trajectory")
    counts: object = returned.counts
    states, surfaces = len(problem.system.states), len(problem.system.surfaces)
    ends: tuple[Status, ...] = ("ok", "diverged", "nonunique", "invalid", "timeout", "failed")
    try:
        if not isinstance(counts, Counts):
            raise _Wrong("counts", counts, "a Counts")
        checked = Trajectory(
            status=_word("status", returned.status, ends),
            transitions=_transitions(returned.transitions, problem, most),
            end_time=_time("end_time", returned.end_time),
            end_state=_state("end_state", returned.end_state, states),
            end_mode=_mode("end_mode", returned.end_mode, surfaces),
            reason=_text("reason", returned.reason),
            counts=Counts(*(_count(f"counts.{what}", getattr(counts, what)) for what in Counts._fields)),
            max_surface_drift=_size("max_surface_drift", returned.max_surface_drift),
            undecided_after=_undecided_after(returned.undecided_after, surfaces),
        )
        _check_times(checked, problem)
        if checked.status == "ok":
            _check_finite(checked)
    except _Wrong as error:
        what, value, wanted = error.args
        raise ContractError(
            f"the solver returned a Trajectory whose {what} is {_typed(value)}, wanted {wanted}"
        ) from None
    return checked


def check_repeated(returned: object, problem: Problem, first: Trajectory, *, most: int) -> None:
    """Refuse the result of a repeated run whose status or sequence of transitions is not that of the first run."""
    again = check_trajectory(returned, problem, most=most)
    if again.status != first.status:
        raise ContractError(f"the status of a repeated run is {again.status}, that of the first run {first.status}")
    sequences = (map(_change, run.transitions) for run in (first, again))
    for k, (before, now) in enumerate(zip_longest(*sequences)):
        if before != now:
            raise ContractError(f"transitions[{k}] of a repeated run is not that of the first run")


def _change(event: Transition) -> tuple[str, int, Mode, Mode]:
    return event.kind, event.surface, event.from_mode, event.to_mode


def check_wall_times(what: str, value: object, count: int) -> tuple[float, ...]:
    """Convert so many wall times that a run has measured itself to positive numbers [s]."""
    try:
        entries = _entries(what, value, count, "")
    except _Wrong:
        raise ContractError(f"the run's {what} is {_typed(value)}, wanted {count} positive numbers [s]") from None
    return tuple(check_wall_time(what, entry) for entry in entries)


def check_wall_time(what: str, value: object) -> float:
    """Convert a wall time that a run has measured itself to a positive number [s]."""
    try:
        time = _number(what, value)
        if not 0 < time < math.inf:
            raise _Wrong(what, value, "")
    except _Wrong:
        raise ContractError(f"the run's {what} is {_typed(value)}, wanted a positive number [s]") from None
    return time


def _check_times(run: Trajectory, problem: Problem) -> None:
    """Refuse times outside the interval of the problem, times out of order, and ``time_low`` above a rounding error."""
    start, until = float(problem.start), float(problem.until)
    rounding = 64 * sys.float_info.epsilon * max(abs(start), abs(until))  # 64 roundings of the largest time
    slack = max(rounding, 1e-9 * (until - start))  # a solver may add up its steps
    between = f"a time from {start:.17g} to {until:.17g}"
    latest = start
    for k, event in enumerate(run.transitions):
        if not start - slack <= event.time <= until + slack:
            raise _Wrong(f"transitions[{k}].time", event.time, between)
        if abs(event.time_low) > rounding:
            raise _Wrong(f"transitions[{k}].time_low", event.time_low, f"a rounding error of at most {rounding:.1e}")
        if event.time < latest - slack:
            raise _Wrong(f"transitions[{k}].time", event.time, f"a time not before {latest!r}, the latest so far")
        latest = max(latest, event.time)
    if not start - slack <= run.end_time <= until + slack:
        raise _Wrong("end_time", run.end_time, between)
    if run.status == "ok" and run.end_time < until - slack:
        raise _Wrong("end_time", run.end_time, f"the horizon, {until:.17g}, if the status is ok")


def _check_finite(run: Trajectory) -> None:
    states = [(f"transitions[{k}].state", event.state) for k, event in enumerate(run.transitions)]
    for what, state in [*states, ("end_state", run.end_state)]:
        if not all(map(math.isfinite, state)):
            raise _Wrong(what, state, "finite numbers if the status is ok")


def _transitions(found: object, problem: Problem, most: int) -> tuple[Transition, ...]:
    if not isinstance(found, Sequence):
        raise _Wrong("transitions", found, "a sequence of Transition")
    events = tuple(islice(found, most + 1))
    if len(events) > most:
        raise ContractError(
            f"the solver returned more than {most} transitions, the most that are scored on this reading"
        )
    states, surfaces = len(problem.system.states), len(problem.system.surfaces)
    converted = []
    for k, event in enumerate(events):
        try:
            converted.append(_transition(event, states, surfaces))
        except _Wrong as error:  # format the index only in the rare case of an error
            what, value, wanted = error.args
            raise _Wrong(f"transitions[{k}]{what and '.'}{what}", value, wanted) from None
    return tuple(converted)


def _transition(event: object, states: int, surfaces: int) -> Transition:
    if not isinstance(event, Transition):
        raise _Wrong("", event, "a Transition")
    kind = _word("kind", event.kind, get_args(Kind))
    surface = _whole("surface", event.surface)
    if not 0 <= surface < surfaces:
        raise _Wrong("surface", surface, f"the index of one of {surfaces} surfaces")
    return Transition(
        kind=kind,
        surface=surface,
        from_mode=_mode("from_mode", event.from_mode, surfaces),
        to_mode=_mode("to_mode", event.to_mode, surfaces),
        time=_time("time", event.time),
        state=_state("state", event.state, states),
        time_low=_time("time_low", event.time_low),
        landing=_text("landing", event.landing),
    )


def _mode(what: str, value: object, surfaces: int) -> Mode:
    wanted = f"{surfaces} entries, each -1, 0 or +1"
    mode = tuple([_whole(what, entry) for entry in _entries(what, value, surfaces, wanted)])
    if not all(-1 <= entry <= 1 for entry in mode):
        raise _Wrong(what, value, wanted)
    return mode


def _state(what: str, value: object, states: int) -> tuple[float, ...]:
    return tuple([_number(what, entry) for entry in _entries(what, value, states, f"{states} numbers")])


def _undecided_after(value: object, surfaces: int) -> tuple[tuple[int, float], ...]:
    most = 2 * surfaces + 64
    what, wanted = "undecided_after", f"pairs of a surface, or -1, and a time, at most {most}"
    if not isinstance(value, Sequence) or isinstance(value, str) or len(value) > most:
        raise _Wrong(what, value, wanted)
    pairs = [_entries(what, entry, 2, wanted) for entry in value]
    found = tuple((_whole(what, surface), _time(what, time)) for surface, time in pairs)
    if not all(-1 <= surface < surfaces for surface, _ in found):
        raise _Wrong(what, value, wanted)
    return found


def _entries(what: str, value: object, count: int, wanted: str) -> tuple[object, ...]:
    if not isinstance(value, Iterable) or isinstance(value, str):
        raise _Wrong(what, value, wanted)
    entries = tuple(islice(value, count + 1))
    if len(entries) != count:
        raise _Wrong(what, value, wanted)
    return entries


def _count(what: str, value: object) -> int:
    """Convert a count to a nonnegative integer of 64 bits."""
    count = _whole(what, value)
    if not 0 <= count < 2**63:
        raise _Wrong(what, count, "a whole number from 0 to 2**63 - 1")
    return count


def _size(what: str, value: object) -> float:
    """Convert a value to a finite number of at least 0, or NaN if unknown."""
    size = _number(what, value)
    if size < 0 or math.isinf(size):
        raise _Wrong(what, size, "a finite number from 0 on, or NaN")
    return size


def _time(what: str, value: object) -> float:
    time = _number(what, value)
    if not math.isfinite(time):
        raise _Wrong(what, time, "a finite number")
    return time


def _number(what: str, value: object) -> float:
    """Convert a value to a float, finite or not."""
    if type(value) is float:
        return value
    if not isinstance(value, Real) or isinstance(value, bool):
        raise _Wrong(what, value, "a number")
    return float(value)


def _whole(what: str, value: object) -> int:
    if type(value) is int:
        return value
    if not isinstance(value, Integral) or isinstance(value, bool):
        raise _Wrong(what, value, "a whole number")
    return int(value)


def _text(what: str, value: object) -> str:
    if not isinstance(value, str):
        raise _Wrong(what, value, "a str")
    return short_line(value)


def _word(what: str, value: object, allowed: Sequence[Word]) -> Word:
    given = str.__str__(value) if isinstance(value, str) else None
    found = next((word for word in allowed if word == given), None)
    if found is None:
        raise _Wrong(what, value, f"one of {', '.join(allowed)}")
    return found


def _typed(value: object) -> str:
    return f"{shown(value)} ({type(value).__name__})"
