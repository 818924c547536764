"""Results of solvers: transitions, trajectories, sticks and samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from henon_ref.modes.kinks import shown_mode, visible
from henon_ref.modes.mode import Mode
from henon_ref.modes.system import FilippovSystem

Kind = Literal["stick", "release", "crossing", "graze", "reset"]
Status = Literal["ok", "wrong", "diverged", "nonunique", "invalid", "timeout", "failed", "unsupported", "unavailable"]


@dataclass(frozen=True, slots=True)
class Transition:
    """One change of mode (or a touch) at one instant.

    If several surfaces change at the same instant, there is one ``Transition`` per surface, in the order of the
    surfaces, each with the modes of all surfaces before and after.
    """

    kind: Kind
    """``stick`` (slip to sliding), ``release`` (sliding to slip), ``crossing``, ``graze`` (touch without crossing),
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
    """State at the transition; after the jump if another surface resets the state at the same instant."""
    time_low: float = 0.0
    """Rounding error of ``time`` [s]: the time is ``time + time_low`` (0 if a solver does not provide it)."""
    landing: str = ""
    """Method that located the event: ``henon``, ``newton``, ``brent``, ``bracket``, or the library's method."""

    def _replace(self, **changes: Any) -> Transition:
        """Return a copy with changed values, as the named tuple :class:`Counts` does."""
        return replace(self, **changes)


class Decisions(NamedTuple):
    """Number of decisions of a reference run that its compiled loop left to Python, by kind."""

    new_modes: int = 0
    """Modes that were compiled during the run."""
    mode_selections: int = 0
    """Mode selections after an event that normal velocities do not clearly decide."""
    event_locations: int = 0
    """Steps with an event that double precision does not decide, so that it is located in multiprecision."""
    jumps: int = 0
    """Jumps of the state with an undecided sign, with several maps at one instant, or at a limit of impacts."""
    branch_points: int = 0
    """Branch points of a guard that were passed."""
    ranges: int = 0
    """Steps on which an overflow or underflow may matter."""


class _Work(NamedTuple):
    steps: int = 0
    rhs_evaluations: int = 0
    event_evaluations: int = 0


class Counts(_Work):
    """Work of one run: ``steps``, ``rhs_evaluations``, ``event_evaluations``, as defined by the solver's docstring.

    Attributes
    ----------
    decisions : Decisions
        How often the compiled loop of the reference called Python. This depends on which modes were compiled before,
        and is not compared.
    """

    decisions: Decisions = Decisions()


@dataclass
class Trajectory:
    """Result of a run: every transition so far, and how the run ended.

    A run that stops early (``diverged``, ``nonunique``, ``invalid``, ``timeout``, ``failed``) still has all its
    transitions up to the end. Solvers never return ``wrong``, which is set by scoring.
    """

    status: Status
    transitions: Sequence[Transition]
    """In order of time; may be a view of arrays that creates each ``Transition`` on access."""
    end_time: float
    end_state: tuple[float, ...]
    end_mode: Mode
    reason: str = field(default_factory=str)  # a default in the class would hide what a subclass makes when it is read
    """Why the status is not ``ok``: one sentence."""
    counts: Counts = field(default_factory=Counts)
    max_surface_drift: float = 0.0
    """Largest abs(h_i) on a surface that the run claims to be on (at transitions and at the end of sticks)."""
    samples: NDArray[np.float64] | None = None
    """(k, n) states at the sample times (NaN after an early end), or None."""
    sample_modes: tuple[Mode, ...] | None = None
    """Mode at each sample time, or None."""
    undecided_after: tuple[tuple[int, float], ...] = field(default_factory=tuple)
    """Surfaces (-1: an expression of the model's end) that were below the solver's rounding, with the first time [s]:
    from there on ``transitions`` may lack some of theirs."""

    def _replace(self, **changes: Any) -> Trajectory:
        """Return a copy with changed values."""
        return Trajectory(**{each.name: getattr(self, each.name) for each in fields(Trajectory)} | changes)


class Event(Protocol):
    """A transition of a run or of the truth, as used by matching, time errors, sticks and figures."""

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
    """One complete stick on one surface."""

    surface: int
    begin: int | None
    """Index of the transition that starts the stick; None if the run starts in it."""
    end: int
    """Index of the transition that ends the stick."""
    start: float
    """Start time [s]."""
    duration: float
    """Duration [s]."""


def sticks(transitions: Sequence[Event], *, start: float, after: float) -> tuple[Stick, ...]:
    """Complete sticks of a sequence that end at ``after`` [s] or later, in order of their ends.

    ``transitions`` are in order of time. A stick that the horizon cuts off is left out; a stick that the run starts in
    begins at ``start`` [s], the initial time.
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
    """Remove transitions on kinks that another branch hides (see :mod:`henon_ref.modes.kinks`)."""
    if not system.kinks:
        return found
    end_mode = shown_mode(system, found.end_mode)
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
