"""What a solver is given and what it returns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from henon_ref.modes.kinks import HiddenKinks, visible
from henon_ref.modes.mode import Mode
from henon_ref.modes.system import FilippovSystem

Kind = Literal["stick", "release", "crossing", "graze", "reset"]
Status = Literal["ok", "wrong", "diverged", "nonunique", "invalid", "timeout", "failed", "unsupported", "unavailable"]


@dataclass(frozen=True, slots=True)
class Transition:
    """One change of mode (or a touch) at one instant.

    When several surfaces change at the same instant there is one ``Transition`` a surface, in the
    order of the surfaces, each with the joint modes before and after.
    """

    kind: Kind
    """``stick`` (slip to sliding), ``release`` (sliding to slip), ``crossing``, ``graze`` (touch and go),
    ``reset`` (the state jumps)."""
    surface: int
    """Index of the surface that changes."""
    from_mode: Mode
    """Mode of all surfaces just before."""
    to_mode: Mode
    """Mode of all surfaces just after."""
    time: float
    """Time [s], rounded to double."""
    state: tuple[float, ...]
    """State at the transition; after the jump, where several surfaces change and one of them resets it too."""
    time_low: float = 0.0
    """What rounding ``time`` lost [s]: the time is ``time + time_low`` (0 where a solver does not know it)."""
    landing: str = ""
    """How the event was put on the surface: ``henon``, ``newton``, ``brent``, ``bracket``, or the library's way."""

    def _replace(self, **changes: Any) -> Transition:
        """A copy with other values, as :class:`Trajectory` and :class:`Counts` have it."""
        return replace(self, **changes)


class Decisions(NamedTuple):
    """How often a run of the reference has gone from its compiled loop to Python, by what it needed there."""

    new_modes: int = 0
    """Modes that were compiled on the way."""
    mode_selections: int = 0
    """Modes after an event that normal velocities do not clearly settle."""
    event_locations: int = 0
    """Steps with an event that double precision does not decide, located in multiprecision."""
    jumps: int = 0
    """Jumps of the state at which something is not clear, several maps at one instant, and limits of impacts."""
    branch_points: int = 0
    """Branch points of a guard that were passed."""
    ranges: int = 0
    """Steps on which an overflow or an underflow might count."""


class _Work(NamedTuple):
    steps: int = 0
    rhs_evaluations: int = 0
    event_evaluations: int = 0


class Counts(_Work):
    """Work done by one run: ``steps``, ``rhs_evaluations``, ``event_evaluations``; the solver's docstring says of what.

    Attributes
    ----------
    decisions : Decisions
        Of the reference. It depends on what was compiled before, and is no part of a comparison.
    """

    decisions: Decisions = Decisions()


class Trajectory(NamedTuple):
    """What a run returns: every transition so far, and how it ended (a tuple: quick to make).

    A run that stops early (``diverged``, ``nonunique``, ``invalid``, ``timeout``, ``failed``) still holds
    all transitions up to there. A solver never says ``wrong``: scoring does.
    """

    status: Status
    transitions: Sequence[Transition]
    """In order of time; may be a view of arrays that makes each ``Transition`` when it is looked at."""
    end_time: float
    end_state: tuple[float, ...]
    end_mode: Mode
    reason: str = ""
    """Why the status is not ``ok``: one sentence."""
    counts: Counts = Counts()
    max_surface_drift: float = 0.0
    """Largest abs(h_i) seen on a surface the run claims to be on (at transitions and at the end of sticks)."""
    samples: NDArray[np.float64] | None = None
    """(k, n) states at the sample times asked for (NaN past an early end), or None."""
    sample_modes: tuple[Mode, ...] | None = None
    """Mode at each sample time, or None."""
    undecided_after: tuple[tuple[int, float], ...] = ()
    """Surfaces (-1: an expression of the model's end) that the solver decides nothing of from a time on [s], being
    below their own rounding: of those it reports no later transition."""


class Event(Protocol):
    """A transition, a run's or the truth's: what matching, time errors, sticks and figures need to know of it."""

    @property
    def kind(self) -> str: ...
    @property
    def surface(self) -> int: ...
    @property
    def from_mode(self) -> Mode: ...
    @property
    def to_mode(self) -> Mode: ...
    @property
    def time(self) -> float: ...
    @property
    def time_low(self) -> float: ...
    @property
    def state(self) -> Sequence[object]: ...


@dataclass(frozen=True)
class Stick:
    """One whole stick on one surface."""

    surface: int
    """Index of the surface."""
    begin: int | None
    """Index of the transition that starts it; None for a run that starts in it."""
    end: int
    """Index of the transition that ends it."""
    start: float
    """Time at which it starts [s]."""
    duration: float
    """How long it lasts [s]."""


def sticks(transitions: Sequence[Event], *, start: float, after: float) -> tuple[Stick, ...]:
    """The whole sticks of a sequence that do not end before ``after``, in order of their ends.

    A stick that the horizon cuts off has no end and is left out; one that the run starts in begins at ``start``.

    Parameters
    ----------
    transitions : sequence of Event
        In order of time.
    start : float
        Initial time [s].
    after : float
        Start of the measured window [s].
    """
    found: list[Stick] = []
    open_since: dict[int, int] = {}
    left_once: set[int] = set()
    for k, event in enumerate(transitions):
        s = event.surface
        before, after_it = event.from_mode[s], event.to_mode[s]
        if before == 0 and after_it != 0:
            begin = open_since.pop(s, None)
            if (begin is not None or s not in left_once) and event.time >= after:
                since, low = (start, 0.0) if begin is None else (transitions[begin].time, transitions[begin].time_low)
                duration = (event.time - since) + (event.time_low - low)
                found.append(Stick(s, begin, k, since, duration))
        elif before != 0 and after_it == 0:
            open_since[s] = k
        left_once.add(s)
    return tuple(found)


def without_hidden_kinks(found: Trajectory, system: FilippovSystem) -> Trajectory:
    """A run without transitions on kinks that another branch hides (see :mod:`henon_ref.modes.kinks`)."""
    if not system.kinks:
        return found
    end_mode = HiddenKinks(system).shown(found.end_mode)
    return found._replace(transitions=visible(system, found.transitions), end_mode=end_mode)


@dataclass(frozen=True)
class Samples:
    """A trajectory on a grid of times, for figures."""

    times: NDArray[np.float64]
    """(k,) [s]."""
    states: NDArray[np.float64]
    """(k, n)."""
    modes: tuple[Mode, ...] | None
    """Mode at each time."""
