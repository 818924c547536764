"""Transitions as they come: those of a whole run, and none of them kept."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import pytest

import henon_ref as hr

CASES = Path(__file__).parents[2] / "cases"
OSCILLATOR = hr.System(["x", "v"], {}, {"s": "x"}, ["v", "-x"])


def test_it_is_the_table_of_the_run() -> None:
    system = hr.System.from_case(CASES / "two_blocks.yaml")
    given = {"until": system.until, "start": system.start, "mode": system.mode}
    table = hr.simulate(system, system.initial, **given).transitions
    rows = list(hr.stream(system, system.initial, **given))
    assert len(rows) > 5
    assert rows[0]._fields == tuple(table.columns)
    assert rows == list(table.itertuples(index=False, name=None))


def test_it_goes_no_further_than_it_must() -> None:
    events = hr.stream(OSCILLATOR, {"x": 1, "v": 0}, until=10**12)
    assert [next(events).to_mode for _ in range(3)] == ["s=-1", "s=+1", "s=-1"]
    assert events.outcome is None


def test_how_it_ended_is_known_at_the_end() -> None:
    events = hr.stream(hr.System(["x"], {}, {"s": "x"}, ["x^2"]), {"x": 1}, until=2)
    assert list(events) == []
    assert (events.outcome.status, events.outcome.success) == ("diverged", False)
    assert list(events) == []


def test_several_go_on_side_by_side() -> None:
    first, second = (hr.stream(OSCILLATOR, {"x": x, "v": 0}, until=20_000) for x in (1, -1))
    pairs = list(zip(first, second, strict=True))
    assert len(pairs) == 6366
    assert all(a.time_s == b.time_s and (a.x, a.v) == (-b.x, -b.v) for a, b in pairs)


@pytest.mark.parametrize("until", [1_000_000])
def test_memory_does_not_grow(until: int) -> None:
    events = hr.stream(OSCILLATOR, {"x": 1, "v": 0}, until=until)
    for _ in range(5_000):
        next(events)
    tracemalloc.start()
    try:
        count = sum(1 for _ in events)
        grown = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert count > 300_000
    assert grown < 1_000_000
