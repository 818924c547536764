"""Sticks: how long each lasts, how far the body is carried, and how that compares with truth and source."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from henon_ref.score.reference import Event


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


def published_partners(durations: Sequence[float | None], published: Sequence[float]) -> tuple[float | None, ...]:
    """The published duration that belongs to each stick: the list repeated, started where it fits best.

    Parameters
    ----------
    durations : sequence of float or None
        Durations in order, None for a stick that the run does not have (it keeps its place).
    published : sequence of float
        The source's durations, one period of them [s].
    """
    if not published:
        return (None,) * len(durations)
    known = np.array([k for k, d in enumerate(durations) if d is not None], dtype=np.intp)
    lasting = np.array([d for d in durations if d is not None])
    printed, count = np.array(published), len(published)

    def misfit(shift: int) -> float:
        return float(np.sum(np.abs(lasting - printed[(known + shift) % count])))

    best = min(range(count), key=misfit)
    return tuple(None if d is None else published[(k + best) % count] for k, d in enumerate(durations))
