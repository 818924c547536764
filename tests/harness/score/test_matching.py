"""Sequences are matched by order and mode before any error is computed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from fakes import Reference
from hypothesis import given, settings
from hypothesis import strategies as st

from henon_ref.harness.score import matching
from henon_ref.harness.score.matching import Matching


def match(reference: list[Reference], found: list[Reference], **options: float | bool) -> Matching:
    """The same of sequences: a transition's place is its number."""
    return matching.match(dict(enumerate(reference)), dict(enumerate(found)), **options)


def belt(n: int, period: float = 1.0, start: float = 0.3) -> list[Reference]:
    """A stick-slip pattern of n transitions: crossing up, stick, release, crossing down, ..."""
    pattern = [
        ("crossing", (-1,), (1,)),
        ("stick", (1,), (0,)),
        ("release", (0,), (-1,)),
        ("crossing", (-1,), (1,)),
        ("crossing", (1,), (-1,)),
    ]
    return [Reference(k, 0, a, b, start + period * i) for i in range(n) for k, a, b in [pattern[i % len(pattern)]]]


def run(reference: list[Reference], found: list[Reference], **options: float | bool):
    until = max([e.time for e in reference + found if np.isfinite(e.time)], default=0.0) + 0.5
    return match(reference, found, start=0.0, until=until, **options)


KEYS = st.sampled_from(
    [("stick", (1,), (0,)), ("release", (0,), (1,)), ("crossing", (1,), (-1,)), ("crossing", (-1,), (1,))]
)


@st.composite
def sequences(draw, least: int = 1) -> list[Reference]:
    keys = draw(st.lists(KEYS, min_size=least, max_size=30))
    gaps = draw(st.lists(st.floats(0.01, 3.0), min_size=len(keys), max_size=len(keys)))
    return [Reference(k[0], 0, k[1], k[2], float(t)) for k, t in zip(keys, np.cumsum(gaps), strict=True)]


@given(sequences())
def test_an_identical_run_is_matched_in_full(reference):
    result = run(reference, reference)
    assert result.pairs == tuple((i, i) for i in range(len(reference)))
    assert result.exact


@given(sequences(least=2), st.data())
def test_one_missed_transition_is_one_missed_transition(reference, data):
    k = data.draw(st.integers(0, len(reference) - 1))
    result = run(reference, reference[:k] + reference[k + 1 :])
    assert len(result.missed) + len(result.cut_reference) == 1
    assert result.spurious == ()
    assert len(result.pairs) == len(reference) - 1


@given(sequences(), st.data())
def test_one_spurious_transition_is_one_spurious_transition(reference, data):
    k = data.draw(st.integers(0, len(reference)))
    before = reference[k - 1].time if k else 0.0
    after = reference[k].time if k < len(reference) else reference[-1].time + 0.4
    extra = data.draw(KEYS)
    found = [*reference[:k], Reference(extra[0], 0, extra[1], extra[2], (before + after) / 2), *reference[k:]]
    result = run(reference, found)
    assert len(result.spurious) + len(result.cut_found) == 1
    assert result.missed == ()
    assert all(reference[i].time == found[j].time for i, j in result.pairs)


@given(sequences(least=3), st.data())
def test_jitter_below_the_gaps_does_not_change_what_is_missed(reference, data):
    k = data.draw(st.integers(0, len(reference) - 2))
    slips = data.draw(st.lists(st.floats(-4e-6, 4e-6), min_size=len(reference), max_size=len(reference)))
    moved = [replace(e, time=e.time + d) for e, d in zip(reference, slips, strict=True)]
    assert run(reference, moved).exact
    result = run(reference, moved[:k] + moved[k + 1 :])
    assert (len(result.missed), len(result.spurious)) == (1, 0)


def test_a_swap_of_two_kinds_touches_only_the_two():
    reference = belt(10)
    found = list(reference)
    found[4], found[5] = replace(found[5], time=found[4].time), replace(found[4], time=found[5].time)
    result = run(reference, found)
    assert (result.missed, result.spurious, len(result.pairs)) == ((4, 5), (4, 5), 8)


def test_a_large_error_in_step_is_an_error_not_a_miss():
    reference = belt(50)
    found = [replace(e, time=e.time * 1.004) for e in reference]
    assert run(reference, found).exact


def test_a_missed_cycle_does_not_shift_all_that_follow():
    reference = belt(40)
    result = run(reference, reference[:10] + reference[15:])
    assert result.missed == (10, 11, 12, 13, 14)
    assert result.spurious == ()


def test_a_run_that_went_wrong_half_way_is_not_credited_with_chance_matches():
    rng = np.random.default_rng(3)
    reference = belt(200)
    wrong = [replace(e, time=99.0 + rng.uniform(0, 1) + i) for i, e in enumerate(belt(101)[1:])]
    result = run(reference, reference[:100] + wrong)
    assert 100 <= len(result.pairs) <= 103
    for shift in (0.3, 0.07):
        driven = [replace(e, time=e.time + shift) for e in reference[101:]]
        assert len(run(reference, reference[:100] + driven).pairs) == 100


def test_crowded_transitions_are_matched_by_order():
    """Accumulating events: the gaps fall below the time error, the order is still right."""
    q = 0.5
    reference = [Reference("crossing", 0, (s,), (-s,), 2.0 - q**k) for k in range(40) for s in [1 if k % 2 else -1]]
    found = [replace(e, time=e.time + 1e-6) for e in reference]
    assert match(reference, found, start=0.0, until=3.0).exact


def test_one_instant_on_two_surfaces_may_come_in_any_order():
    together = [Reference("stick", 0, (1, 1), (0, 0), 1.0), Reference("stick", 1, (1, 1), (0, 0), 1.0)]
    later = [Reference("release", 1, (0, 0), (0, -1), 2.0)]
    one_by_one = [Reference("stick", 1, (1, 1), (1, 0), 1.0 - 1e-9), Reference("stick", 0, (1, 0), (0, 0), 1.0 + 1e-9)]
    result = match(together + later, one_by_one + later, start=0.0, until=3.0)
    assert set(result.pairs) == {(0, 1), (1, 0), (2, 2)}
    assert result.exact


def test_two_surfaces_apart_in_time_keep_their_order():
    apart = [Reference("stick", 0, (1, 1), (0, 1), 1.0), Reference("stick", 1, (0, 1), (0, 0), 1.5)]
    swapped = [Reference("stick", 1, (1, 1), (1, 0), 1.0), Reference("stick", 0, (1, 0), (0, 0), 1.5)]
    assert not match(apart, swapped, start=0.0, until=3.0).exact


def test_touches_are_counted_apart():
    reference = belt(6)
    touch = Reference("graze", 0, (1,), (1,), 1.8)
    result = run([*reference[:2], touch, *reference[2:]], reference)
    assert result.exact
    assert result.missed_touches == (2,)
    result = run(reference, [*reference[:2], touch, *reference[2:]])
    assert result.exact
    assert result.spurious_touches == (2,)
    assert run([touch], [replace(touch, time=1.801)]).touch_pairs == ((0, 0),)


def test_a_transition_at_the_horizon_may_fall_beyond_it():
    reference = [Reference("crossing", 0, (1,), (-1,), 1.0), Reference("crossing", 0, (-1,), (1,), 2.0)]
    early = match(reference, reference[:1], start=0.0, until=2.0)
    assert (early.missed, early.cut_reference) == ((), (1,))
    assert match(reference, reference[:1], start=0.0, until=2.0, reached_horizon=False).missed == (1,)
    assert match(reference, reference[:1], start=0.0, until=2.1).missed == (1,)
    late = match(reference[:1], reference, start=0.0, until=2.0)
    assert (late.spurious, late.cut_found) == ((), (1,))


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
def test_a_time_that_is_no_number_is_spurious(bad):
    reference = belt(5)
    found = [*reference[:2], replace(reference[2], time=bad), *reference[3:]]
    result = run(reference, found)
    assert (result.missed, result.spurious) == ((2,), (2,))


def test_nothing_found_and_nothing_to_find():
    assert run([], []).exact
    assert run(belt(3), []).missed == (0, 1, 2)
    assert run([], belt(3)).spurious == (0, 1, 2)


@settings(max_examples=5)
@given(st.integers(0, 2**32 - 1))
def test_long_sequences_with_many_edits_are_aligned_in_bounded_memory(seed):
    rng = np.random.default_rng(seed)
    reference = belt(4000)
    drop = set(rng.choice(4000, 60, replace=False).tolist())
    found = [e for i, e in enumerate(reference) if i not in drop]
    result = run(reference, found)
    assert set(result.missed) | set(result.cut_reference) == drop
    assert result.spurious == ()


@pytest.mark.parametrize("late", [-1e-9, 0.0, 1e-9])
@pytest.mark.parametrize("instants", [1, 3])
def test_a_reset_that_is_applied_several_times_at_one_instant_is_matched_in_its_order(late, instants):
    """Impacts among three balls in a row: pair by pair, back and forth, all between the same modes."""
    reference = [Reference("reset", i, (1, 1), (1, 1), 1.0 + 2.0 * k) for k in range(instants) for i in (0, 1, 0, 1, 0)]
    found = [replace(event, time=event.time + late) for event in reference]
    result = run(reference, found)
    assert result.exact
    assert result.pairs == tuple((i, i) for i in range(len(reference)))
    fewer = run(reference, found[:3] + found[4:])
    assert (len(fewer.missed), fewer.spurious) == (1, ())
