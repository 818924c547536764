"""What a solver hands back, checked in the worker: what breaks the contract is its own failed row.

What passes is made of plain numbers and tuples: NumPy's own are what a solver naturally has, and what neither a
journal nor a comparison of modes takes.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from numbers import Integral, Real
from typing import get_args

from henon_ref.henon.blocks import TransitionBlock
from henon_ref.model.modes import Mode
from henon_ref.model.system import FilippovSystem
from henon_ref.solver import ContractError
from henon_ref.trajectory import Counts, Kind, Trajectory, Transition

ENDS = ("ok", "diverged", "nonunique", "invalid", "timeout", "failed")
"""Statuses that a run may end with."""
KINDS = get_args(Kind)
SIGNS = frozenset((-1, 0, 1))
"""Entries of a mode."""


def check_prepared(run: object, *, landing: object, version: object) -> None:
    """Refuse a run that cannot be called, and words that are none.

    Raises
    ------
    ContractError
    """
    if not callable(run):
        raise ContractError(f"the solver's prepare() returned {_shown(run)}, wanted a function that runs it")
    for what, value in (("landing", landing), ("version", version)):
        if not isinstance(value, str):
            raise ContractError(f"the solver's {what} is {_shown(value)}, wanted a str")


def check_returned(returned: object, system: FilippovSystem) -> Trajectory:
    """What a run returned, in plain numbers; samples, which no run that is scored was asked for, left out.

    Parameters
    ----------
    returned : object
    system : FilippovSystem
        Says how many states and surfaces there are.

    Raises
    ------
    ContractError
        Where it is no trajectory that can be scored.
    """
    if not isinstance(returned, Trajectory):
        raise ContractError(f"the solver returned {_shown(returned)}, wanted a Trajectory")
    if returned.status not in ENDS:
        raise _wrong("status", returned.status, f"one of {', '.join(ENDS)}")
    if not isinstance(returned.transitions, Sequence):
        raise _wrong("transitions", returned.transitions, "a sequence of Transition")
    if not isinstance(returned.reason, str):
        raise _wrong("reason", returned.reason, "a str")
    if not isinstance(returned.counts, Counts):
        raise _wrong("counts", returned.counts, "a Counts")
    plain = _Plain(len(system.states), len(system.surfaces))
    return Trajectory(
        status=returned.status,
        transitions=plain.transitions(returned.transitions),
        end_time=plain.time("end_time", returned.end_time),
        end_state=plain.state("end_state", returned.end_state),
        end_mode=plain.mode("end_mode", returned.end_mode),
        reason=returned.reason,
        counts=Counts(*(plain.whole(f"counts.{what}", n) for what, n in returned.counts._asdict().items())),
        max_surface_drift=plain.number("max_surface_drift", returned.max_surface_drift),
    )


class _Plain:
    """Makes values plain, or says what is wrong with them.

    Parameters
    ----------
    states, surfaces : int
        How many of them the system has.
    """

    def __init__(self, states: int, surfaces: int) -> None:
        self.states = states
        self.surfaces = surfaces

    def transitions(self, found: Sequence[Transition]) -> Sequence[Transition]:
        """The same sequence where each transition is plain: it may be a view of an array, smaller than a tuple."""
        # A block is rows of an array: plain by its making, and a million long where the fastest solver made it.
        if isinstance(found, TransitionBlock) or all(map(self.is_plain, found)):
            return found
        return tuple(self.transition(f"transitions[{k}]", event) for k, event in enumerate(found))

    def is_plain(self, event: Transition) -> bool:
        """Whether there is nothing to convert and nothing wrong."""
        return (
            type(event) is Transition
            and event.kind in KINDS
            and type(event.surface) is int
            and 0 <= event.surface < self.surfaces
            and self._is_plain_mode(event.from_mode)
            and self._is_plain_mode(event.to_mode)
            and type(event.time) is float
            and type(event.time_low) is float
            and math.isfinite(event.time + event.time_low)
            and type(event.state) is tuple
            and len(event.state) == self.states
            and set(map(type, event.state)) == {float}
            and type(event.landing) is str
        )

    def _is_plain_mode(self, mode: Mode) -> bool:
        plain = type(mode) is tuple and len(mode) == self.surfaces and set(map(type, mode)) == {int}
        return plain and SIGNS.issuperset(mode)

    def transition(self, where: str, event: object) -> Transition:
        """A transition of plain values."""
        if not isinstance(event, Transition):
            raise _wrong(where, event, "a Transition")
        if event.kind not in KINDS:
            raise _wrong(f"{where}.kind", event.kind, f"one of {', '.join(KINDS)}")
        if not isinstance(event.landing, str):
            raise _wrong(f"{where}.landing", event.landing, "a str")
        surface = self.whole(f"{where}.surface", event.surface)
        if not 0 <= surface < self.surfaces:
            raise _wrong(f"{where}.surface", surface, f"the index of one of {self.surfaces} surfaces")
        return Transition(
            kind=event.kind,
            surface=surface,
            from_mode=self.mode(f"{where}.from_mode", event.from_mode),
            to_mode=self.mode(f"{where}.to_mode", event.to_mode),
            time=self.time(f"{where}.time", event.time),
            state=self.state(f"{where}.state", event.state),
            time_low=self.time(f"{where}.time_low", event.time_low),
            landing=event.landing,
        )

    def mode(self, what: str, value: object) -> Mode:
        """An entry a surface, each -1, 0 or +1."""
        wanted = f"{self.surfaces} entries, each -1, 0 or +1"
        mode = tuple(self.whole(what, entry) for entry in _entries(what, value, self.surfaces, wanted))
        if not SIGNS.issuperset(mode):
            raise _wrong(what, value, wanted)
        return mode

    def state(self, what: str, value: object) -> tuple[float, ...]:
        """A number a state."""
        entries = _entries(what, value, self.states, f"{self.states} numbers")
        return tuple(self.number(what, entry) for entry in entries)

    def time(self, what: str, value: object) -> float:
        """A finite number."""
        time = self.number(what, value)
        if not math.isfinite(time):
            raise _wrong(what, time, "a finite number")
        return time

    def number(self, what: str, value: object) -> float:
        """A number, finite or not."""
        if not isinstance(value, Real) or isinstance(value, bool):
            raise _wrong(what, value, "a number")
        return float(value)

    def whole(self, what: str, value: object) -> int:
        """A whole number."""
        if not isinstance(value, Integral) or isinstance(value, bool):
            raise _wrong(what, value, "a whole number")
        return int(value)


def _entries(what: str, value: object, count: int, wanted: str) -> tuple[object, ...]:
    if not isinstance(value, Iterable) or isinstance(value, str):
        raise _wrong(what, value, wanted)
    entries = tuple(value)
    if len(entries) != count:
        raise _wrong(what, value, wanted)
    return entries


def _wrong(what: str, value: object, wanted: str) -> ContractError:
    return ContractError(f"the solver returned a Trajectory whose {what} is {_shown(value)}, wanted {wanted}")


def _shown(value: object) -> str:
    """A value and its type, in few words."""
    text = " ".join(repr(value).split())
    return f"{text if len(text) <= 60 else text[:57] + '...'} ({type(value).__name__})"
