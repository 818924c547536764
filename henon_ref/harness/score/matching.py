"""Matching of a run's transitions with the reference's by order and mode, before any error is computed.

The alignment has the fewest edits (transitions missed or spurious) among those that keep the order and pair only
transitions of the same kind, surface, mode before and mode after. Times only break ties and bound the pairs. Up to the
first edit the bound is half the longest distance between reference transitions of that kind, so that a plausible error
is measured as an error, and crowded transitions are matched by order alone. From the first edit on, a pair must agree
to a thousandth of the distance to its neighbours, or to ten times the median error before the edit. A run that went
wrong half way is therefore not credited with transitions that agree by chance, or because both follow the same drive.

Touches (``graze``) change no mode, and few solvers report them. They are matched separately, and a missed or spurious
touch is not counted as a missed or spurious transition.

Transitions of several surfaces at one instant may have any order. The exception is an instant at which a reset is
applied several times: its transitions follow from each other.

A transition of a run just before the horizon may be after it in the exact run, and vice versa: neither counts against
the run. The number of such transitions is limited to the largest number that the exact run has in an equally short
time, or to one pair per surface.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from henon_ref.harness.score.alignment import Keyed, align
from henon_ref.trajectory import Event


@dataclass(frozen=True)
class Matching:
    """Pairs of a run's and the reference's transitions, as indices into the two sequences."""

    pairs: tuple[tuple[int, int], ...]
    """(reference, found), increasing in both except for transitions at one instant; touches excluded."""
    missed: tuple[int, ...]
    """Reference transitions without a partner in the run."""
    spurious: tuple[int, ...]
    """Transitions of the run without a partner in the reference."""
    touch_pairs: tuple[tuple[int, int], ...] = ()
    """Matched touches (``graze``)."""
    missed_touches: tuple[int, ...] = ()
    """Touches of the reference that the run does not report; not counted as errors."""
    spurious_touches: tuple[int, ...] = ()
    """Touches of the run that the reference does not have; not counted as errors."""
    cut_reference: tuple[int, ...] = ()
    """Unmatched reference transitions so near the horizon that the run may have them after it."""
    cut_found: tuple[int, ...] = ()
    """Unmatched transitions of the run so near the horizon that the reference may have them after it."""

    @property
    def exact(self) -> bool:
        """Whether no transition is missed or spurious."""
        return not self.missed and not self.spurious


Events = Mapping[int, Event]
"""Transitions in order of time; the keys are their indices in the full sequence."""


def match(
    reference: Events,
    found: Events,
    *,
    start: float,
    until: float,
    radius: float = 0.0,
    reached_horizon: bool = True,
    end_slack: float = 0.0,
    accumulating: bool = False,
) -> Matching:
    """Match a run's transitions with the reference's, both in order of time; the matching contains their keys.

    ``start`` and ``until`` are the reading's initial time and horizon [s], and ``radius`` that of the reference's times
    [s]: transitions of different surfaces closer than this are one instant. If the run ended early (``reached_horizon``
    is False), transitions after its end are missed, not cut off by the horizon. Unmatched transitions within
    ``end_slack`` before the horizon [s] are cut off, regardless of the run's error. ``accumulating``: whether
    transitions accumulate at the horizon, so that a run may have any number of them there.
    """
    span = max(until - start, np.finfo(float).tiny)
    (ref, ref_touches), (run, run_touches) = _without_touches(reference), _without_touches(found)
    ref = _simultaneous_in_run_order(ref, run, radius)
    pairs = _align(ref, run, span, radius)
    missed = sorted(set(ref) - {i for i, _ in pairs})
    spurious = sorted(set(run) - {j for _, j in pairs})
    cut_reference: list[int] = []
    cut_found: list[int] = []
    if reached_horizon:
        margin = _horizon_margin(ref, run, pairs, span, until)
        bounds = (until - margin, until - end_slack if end_slack > 0 else math.inf)
        last_ref, last_run = (max((pair[side] for pair in pairs), default=-1) for side in (0, 1))
        missed, cut_reference = _cut_off(ref, missed, last_ref, bounds)
        spurious, cut_found = _cut_off(run, spurious, last_run, bounds)
        if not accumulating:
            latest = max((run[j].time for j in cut_found), default=until)
            most = _most_past_horizon(ref, run, latest - min(bounds))
            spurious, cut_found = sorted(spurious + cut_found[most:]), cut_found[:most]
    touches = _align(ref_touches, run_touches, span, radius)
    return Matching(
        pairs=tuple(pairs),
        missed=tuple(missed),
        spurious=tuple(spurious),
        touch_pairs=tuple(touches),
        missed_touches=tuple(sorted(set(ref_touches) - {i for i, _ in touches})),
        spurious_touches=tuple(sorted(set(run_touches) - {j for _, j in touches})),
        cut_reference=tuple(cut_reference),
        cut_found=tuple(cut_found),
    )


def _without_touches(events: Events) -> tuple[Events, Events]:
    """Split transitions into those that change a mode and touches."""
    touches = {i: event for i, event in events.items() if event.kind == "graze"}
    return {i: event for i, event in events.items() if i not in touches}, touches


def _key(event: Event) -> tuple[object, ...]:
    return (event.kind, event.surface, tuple(event.from_mode), tuple(event.to_mode))


def _own_key(event: Event) -> tuple[object, ...]:
    """Key of a transition by its own surface alone, without the other surfaces at that instant."""
    s = event.surface
    return (event.kind, s, event.from_mode[s], event.to_mode[s])


def _align(reference: Events, found: Events, span: float, radius: float) -> list[tuple[int, int]]:
    """Pairs (reference, found): with loose bounds up to the first edit, with tight bounds from there on."""
    if not reference or not found:
        return []
    ref, run = _keyed(reference, found, radius)
    loose, gaps = _bounds(ref.times, ref.keys[:, 0], span)
    first = align(ref, run, loose)
    # Number of pairs before the first missed or spurious transition.
    edit = int(np.argmax(np.append((first != np.arange(len(first))[:, None]).any(axis=1), True)))
    if edit < max(len(reference), len(found)):
        head = first[:edit]
        slips = np.abs(ref.times[head[:, 0]] - run.times[head[:, 1]])
        tight = np.maximum(1e-3 * gaps, 10.0 * np.median(slips)) if edit >= 3 else 0.05 * gaps  # too few for a median
        bound = np.minimum(loose, tight)[edit:]
        first = np.concatenate([head, align(ref.since(edit), run.since(edit), bound) + edit])
    places, slots = list(reference), list(found)
    return [(places[i], slots[j]) for i, j in first.tolist()]


def _keyed(reference: Events, found: Events, radius: float) -> tuple[Keyed, Keyed]:
    """Times and integer keys: the full key, and the own-surface key (of the reference only in groups)."""
    table: dict[tuple[object, ...], int] = {}

    def code(key: tuple[object, ...]) -> int:
        return table.setdefault(key, len(table))

    grouped = set().union(*_groups(reference, radius))
    ref_keys = [(code(_key(e)), code(_own_key(e)) if i in grouped else -1) for i, e in reference.items()]
    run_keys = [(code(_key(e)), code(_own_key(e))) for e in found.values()]
    return (
        Keyed(np.array(ref_keys, dtype=np.int64), np.array([event.time for event in reference.values()])),
        Keyed(np.array(run_keys, dtype=np.int64), np.array([event.time for event in found.values()])),
    )


def _bounds(times: NDArray[np.float64], keys: NDArray[np.int64], span: float) -> tuple[NDArray[np.float64], ...]:
    """Bound of a pair's time difference before the first edit, and distance to the nearest of its kind [s]."""
    loose = np.full(times.size, span / 2)
    nearest = np.full(times.size, span)
    for key in np.unique(keys):
        where = np.nonzero(keys == key)[0]
        instants, own = np.unique(times[where], return_inverse=True)  # one instant may have several resets
        gaps = np.diff(instants)
        if gaps.size:
            loose[where] = gaps.max() / 2
            nearest[where] = np.minimum(np.append(gaps, np.inf), np.insert(gaps, 0, np.inf))[own]
    return loose, nearest


def _groups(events: Events, radius: float) -> list[set[int]]:
    """Sets of reference keys whose transitions are at one instant, on different surfaces."""
    groups: list[set[int]] = []
    instant: list[int] = list(events)[:1]
    repeated: set[int] = set()
    for before, after in pairwise(events):
        first, second = events[before], events[after]
        together = second.time - first.time <= max(2 * radius, 4 * float(np.spacing(abs(first.time))))
        instant = [*instant, after] if together else [after]
        if second.kind == "reset" and any(_key(events[i]) == _key(second) for i in instant[:-1]):
            repeated.update(instant)
        if not together or first.surface == second.surface:
            continue
        if groups and before in groups[-1]:
            if second.surface not in {events[i].surface for i in groups[-1]}:
                groups[-1].add(after)
        else:
            groups.append({before, after})
    return [group for group in groups if not group & repeated]


def _simultaneous_in_run_order(reference: Events, found: Events, radius: float) -> Events:
    """The reference's transitions, with those at one instant reordered as in the run."""
    groups, none = _groups(reference, radius), max(found, default=-1) + 1
    if not groups or not found:
        return reference
    places: dict[tuple[object, ...], list[tuple[float, int]]] = {}
    for j, event in found.items():
        if math.isfinite(event.time):
            places.setdefault(_own_key(event), []).append((event.time, j))
    for candidates in places.values():
        candidates.sort()
    order = list(reference)
    position = {slot: k for k, slot in enumerate(reference)}
    for group in groups:
        members = sorted(group, key=position.__getitem__)
        nearest = {i: _nearest(places.get(_own_key(reference[i]), []), reference[i].time, none) for i in members}
        first = position[members[0]]
        order[first : first + len(members)] = sorted(members, key=nearest.__getitem__)
    return {i: reference[i] for i in order}


def _nearest(candidates: list[tuple[float, int]], instant: float, none: int) -> int:
    """Index of the candidate nearest to an instant, from a list sorted by (time, index); ``none`` if it is empty."""
    at = bisect_left(candidates, (instant, -1))
    near = candidates[max(at - 1, 0) : at + 1]
    return min(near, key=lambda entry: abs(entry[0] - instant), default=(instant, none))[1]


def _horizon_margin(reference: Events, found: Events, pairs: list[tuple[int, int]], span: float, until: float) -> float:
    """Distance to the horizon [s] within which the run's time error may move a transition across it."""
    worst = max((abs(reference[i].time - found[j].time) for i, j in pairs), default=0.0)
    return max(min(3.0 * worst, 0.05 * span), rounding(until))


def rounding(until: float) -> float:
    """Largest rounding error [s] of a run's times near its horizon."""
    return 4 * float(np.spacing(abs(until)))


def _cut_off(
    events: Events, unmatched: list[int], last: int, bounds: tuple[float, float]
) -> tuple[list[int], list[int]]:
    """Split unmatched transitions into those that count and those cut off by the horizon.

    ``bounds``: transitions from the second time on are cut off, and after the last pair also from the first time on.
    """
    counting: list[int] = []
    cut: list[int] = []
    for k in unmatched:
        since = min(bounds) if k > last else bounds[1]
        (cut if since <= events[k].time < math.inf else counting).append(k)
    return counting, cut


def _most_past_horizon(reference: Events, found: Events, length: float) -> int:
    """Largest number of cut-off transitions: as many as the reference has in any interval of that length.

    At least a pair per surface may be just past the horizon.
    """
    times = np.sort([event.time for event in reference.values()])
    together = int((np.searchsorted(times, times + length, side="right") - np.arange(times.size)).max(initial=0))
    surfaces = max((len(next(iter(own.values())).from_mode) for own in (reference, found) if own), default=1)
    return max(together, 2 * surfaces)
