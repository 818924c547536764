"""What a solver hands back, checked in the worker: what breaks the contract is its own failed row.

What passes is made of built-in types, exact ``str``, ``int``, ``float``, ``tuple``, ``Transition``: the rest of the
package relies on that. NumPy's numbers are what a solver naturally has; objects of its own classes may be anything when
they are looked at a second time, or taken out of a pickle. None of them leaves the worker.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Sequence
from itertools import islice
from numbers import Integral, Real
from typing import TypeVar, get_args

from henon_ref.errors import ContractError
from henon_ref.modes.mode import Mode
from henon_ref.modes.problem import Problem
from henon_ref.modes.system import FilippovSystem
from henon_ref.text import short_line
from henon_ref.trajectory import Counts, Kind, Status, Trajectory, Transition

ENDS: tuple[Status, ...] = ("ok", "diverged", "nonunique", "invalid", "timeout", "failed")
"""Statuses that a run may end with."""
ROUNDINGS = 64
"""So many roundings of the largest time of a problem are granted to times; ``time_low`` is no more than that."""
ADDED_UP = 1e-9
"""So much of the run is granted to times that a solver adds up from its steps."""
KINDS: tuple[Kind, ...] = get_args(Kind)
SIGNS = frozenset((-1, 0, 1))
"""Entries of a mode."""
LARGEST_COUNT = 2**63 - 1
Word = TypeVar("Word", bound=str)


def check_prepared(run: object, *, landing: object, version: object) -> tuple[str, str]:
    """Refuse a run that cannot be called, and words that are none.

    Returns
    -------
    tuple of str
        Landing and version, each in one line.

    Raises
    ------
    ContractError
    """
    if not callable(run):
        raise ContractError(f"the solver's prepare() returned {shown(run)}, wanted a function that runs it")
    return _word("landing", landing), _word("version", version)


def _word(what: str, value: object) -> str:
    if not isinstance(value, str):
        raise ContractError(f"the solver's {what} is {shown(value)}, wanted a str")
    return short_line(value)


def check_trajectory(returned: object, problem: Problem, *, most: int) -> Trajectory:
    """What a run returned, in built-in types; samples, which no run that is scored was asked for, left out.

    Parameters
    ----------
    returned : object
    problem : Problem
        What was run.
    most : int
        Transitions that it may have.

    Raises
    ------
    ContractError
        Where it is no trajectory that can be scored.
    """
    if not isinstance(returned, Trajectory):
        raise ContractError(f"the solver returned {shown(returned)}, wanted a Trajectory")
    given, convert = Trajectory._make(returned), Converter(problem.system)
    checked = Trajectory(
        status=convert.word("status", given.status, ENDS),
        transitions=convert.transitions(given.transitions, most),
        end_time=convert.time("end_time", given.end_time),
        end_state=convert.state("end_state", given.end_state),
        end_mode=convert.mode("end_mode", given.end_mode),
        reason=convert.text("reason", given.reason),
        counts=convert.counts(given.counts),
        max_surface_drift=convert.size("max_surface_drift", given.max_surface_drift),
        undecided_after=convert.undecided_after(given.undecided_after),
    )
    _check_times(checked, problem)
    if checked.status == "ok":
        _check_finite(checked)
    return checked


def _check_times(run: Trajectory, problem: Problem) -> None:
    """Refuse times outside of the problem's, out of order, or in the wrong part of a compensated time."""
    start, until = float(problem.start), float(problem.until)
    rounding = ROUNDINGS * sys.float_info.epsilon * max(abs(start), abs(until))
    slack = max(rounding, ADDED_UP * (until - start))
    between = f"a time from {start:.17g} to {until:.17g}"
    latest = start
    for k, event in enumerate(run.transitions):
        if not start - slack <= event.time <= until + slack:
            raise wrong(f"transitions[{k}].time", event.time, between)
        if abs(event.time_low) > rounding:
            raise wrong(f"transitions[{k}].time_low", event.time_low, f"what rounding lost, at most {rounding:.1e}")
        if event.time < latest - slack:
            raise wrong(f"transitions[{k}].time", event.time, f"one not before {latest!r}, the latest so far")
        latest = max(latest, event.time)
    if not start - slack <= run.end_time <= until + slack:
        raise wrong("end_time", run.end_time, between)
    if run.status == "ok" and run.end_time < until - slack:
        raise wrong("end_time", run.end_time, f"the horizon, {until:.17g}, where the status is ok")


def _check_finite(run: Trajectory) -> None:
    """Refuse states that are not finite."""
    states = [(f"transitions[{k}].state", event.state) for k, event in enumerate(run.transitions)]
    for what, state in [*states, ("end_state", run.end_state)]:
        if not all(map(math.isfinite, state)):
            raise wrong(what, state, "finite numbers where the status is ok")


class Converter:
    """Makes values of built-in types, or says what is wrong with them (:class:`~henon_ref.errors.ContractError`).

    Parameters
    ----------
    system : FilippovSystem
        Says how many states and surfaces there are.
    """

    def __init__(self, system: FilippovSystem) -> None:
        self.states = len(system.states)
        self.surfaces = len(system.surfaces)

    def transitions(self, found: object, most: int) -> tuple[Transition, ...]:
        """Transitions, no more than ``most``, each of built-in types."""
        if not isinstance(found, Sequence):
            raise wrong("transitions", found, "a sequence of Transition")
        events = tuple(islice(found, most + 1))
        if len(events) > most:
            raise ContractError(
                f"the solver returned more than {most} transitions, the most that are scored on this reading"
            )
        return tuple(
            event if self.is_builtin(event) else self.transition(f"transitions[{k}]", event)
            for k, event in enumerate(events)
        )

    def is_builtin(self, event: Transition) -> bool:
        """Whether there is nothing to convert and nothing wrong."""
        return (
            type(event) is Transition
            and type(event.kind) is str
            and event.kind in KINDS
            and type(event.surface) is int
            and 0 <= event.surface < self.surfaces
            and self._is_builtin_mode(event.from_mode)
            and self._is_builtin_mode(event.to_mode)
            and type(event.time) is float
            and type(event.time_low) is float
            and math.isfinite(event.time)
            and math.isfinite(event.time_low)
            and type(event.state) is tuple
            and len(event.state) == self.states
            and set(map(type, event.state)) == {float}
            and type(event.landing) is str
            and event.landing == short_line(event.landing)
        )

    def _is_builtin_mode(self, mode: Mode) -> bool:
        builtin = type(mode) is tuple and len(mode) == self.surfaces and set(map(type, mode)) == {int}
        return builtin and SIGNS.issuperset(mode)

    def transition(self, where: str, event: object) -> Transition:
        """A transition of built-in types."""
        if not isinstance(event, Transition):
            raise wrong(where, event, "a Transition")
        kind = self.word(f"{where}.kind", event.kind, KINDS)
        surface = self.whole(f"{where}.surface", event.surface)
        if not 0 <= surface < self.surfaces:
            raise wrong(f"{where}.surface", surface, f"the index of one of {self.surfaces} surfaces")
        return Transition(
            kind=kind,
            surface=surface,
            from_mode=self.mode(f"{where}.from_mode", event.from_mode),
            to_mode=self.mode(f"{where}.to_mode", event.to_mode),
            time=self.time(f"{where}.time", event.time),
            state=self.state(f"{where}.state", event.state),
            time_low=self.time(f"{where}.time_low", event.time_low),
            landing=self.text(f"{where}.landing", event.landing),
        )

    def mode(self, what: str, value: object) -> Mode:
        """An entry a surface, each -1, 0 or +1."""
        wanted = f"{self.surfaces} entries, each -1, 0 or +1"
        mode = tuple(self.whole(what, entry) for entry in _entries(what, value, self.surfaces, wanted))
        if not SIGNS.issuperset(mode):
            raise wrong(what, value, wanted)
        return mode

    def state(self, what: str, value: object) -> tuple[float, ...]:
        """A number a state."""
        entries = _entries(what, value, self.states, f"{self.states} numbers")
        return tuple(self.number(what, entry) for entry in entries)

    def undecided_after(self, value: object) -> tuple[tuple[int, float], ...]:
        """Pairs of a surface, or -1, and a time."""
        what, wanted = "undecided_after", f"pairs of a surface, or -1, and a time, at most {2 * self.surfaces + 64}"
        if not isinstance(value, Sequence) or isinstance(value, str) or len(value) > 2 * self.surfaces + 64:
            raise wrong(what, value, wanted)
        pairs = [_entries(what, entry, 2, wanted) for entry in value]
        found = tuple((self.whole(what, surface), self.time(what, time)) for surface, time in pairs)
        if not all(-1 <= surface < self.surfaces for surface, _ in found):
            raise wrong(what, value, wanted)
        return found

    def counts(self, value: object) -> Counts:
        """Counts that a file of integers can hold."""
        if not isinstance(value, Counts):
            raise wrong("counts", value, "a Counts")
        return Counts(*(self.count(f"counts.{what}", getattr(value, what)) for what in Counts._fields))

    def count(self, what: str, value: object) -> int:
        """A whole number from 0 on."""
        count = self.whole(what, value)
        if not 0 <= count <= LARGEST_COUNT:
            raise wrong(what, count, "a whole number from 0 to 2**63 - 1")
        return count

    def size(self, what: str, value: object) -> float:
        """A finite number from 0 on, or NaN where it is not known."""
        size = self.number(what, value)
        if size < 0 or math.isinf(size):
            raise wrong(what, size, "a finite number from 0 on, or NaN")
        return size

    def time(self, what: str, value: object) -> float:
        """A finite number."""
        time = self.number(what, value)
        if not math.isfinite(time):
            raise wrong(what, time, "a finite number")
        return time

    def number(self, what: str, value: object) -> float:
        """A number, finite or not."""
        if not isinstance(value, Real) or isinstance(value, bool):
            raise wrong(what, value, "a number")
        return float(value)

    def whole(self, what: str, value: object) -> int:
        """A whole number."""
        if not isinstance(value, Integral) or isinstance(value, bool):
            raise wrong(what, value, "a whole number")
        return int(value)

    def text(self, what: str, value: object) -> str:
        """Words, in one line."""
        if not isinstance(value, str):
            raise wrong(what, value, "a str")
        return short_line(value)

    def word(self, what: str, value: object, allowed: Sequence[Word]) -> Word:
        """One of the words that are allowed."""
        given = str.__str__(value) if isinstance(value, str) else None
        found = next((word for word in allowed if word == given), None)
        if found is None:
            raise wrong(what, value, f"one of {', '.join(allowed)}")
        return found


def _entries(what: str, value: object, count: int, wanted: str) -> tuple[object, ...]:
    if not isinstance(value, Iterable) or isinstance(value, str):
        raise wrong(what, value, wanted)
    entries = tuple(islice(value, count + 1))
    if len(entries) != count:
        raise wrong(what, value, wanted)
    return entries


def wrong(what: str, value: object, wanted: str) -> ContractError:
    """The error that says which part of a trajectory is not what was wanted."""
    return ContractError(f"the solver returned a Trajectory whose {what} is {shown(value)}, wanted {wanted}")


def shown(value: object) -> str:
    """A value and its type, in few words."""
    text = " ".join(repr(value).split())
    return f"{text if len(text) <= 60 else text[:57] + '...'} ({type(value).__name__})"
