"""Surfaces on which the state rests: their guards are not evaluated until the surface function changes.

From https://github.com/sys-bio/roadrunner/issues/1358, where an event's timer stops at zero.
"""

from __future__ import annotations

import pytest
from problems import read_problem

from henon_ref.errors import UnsupportedError
from henon_ref.harness.registry import solver
from henon_ref.harness.truth.multiprecision.route import multiprecision
from henon_ref.modes.problem import Problem

LIBRARIES = (
    "heyoka", "cvode-adams", "cvode-bdf", "ida", "scipy-rk45", "scipy-dop853", "scipy-radau", "scipy-bdf",
    "scipy-lsoda",
)  # fmt: skip

# A surface that stays at zero beside one that is crossed.
DEAD_CROSS = """\
system:
  state: [x, r]
  surfaces: {s: "1 - x", b: r}
  field: ["1 + s/2", "-(1 + b)/2"]
initial: {t: 0, x: 0, r: 0, mode: {b: -1}}
until: 3/2
"""
# A timer that stops.
COUNTDOWN = """\
system: {state: [d, q, y], surfaces: {due: d}, field: ["-q", "0", "1"]}
resets: {due: {map: MAP}}
initial: {t: 0, d: START, q: RATE, y: 0}
until: 2
"""
# A surface at zero that another one's crossing moves.
MOVED = """\
system:
  state: [d, x]
  surfaces: {s: d, u: "x - 1"}
  field: ["(1 + u)*WAY/2", "1"]
initial: {t: 0, d: 0, x: 0, mode: {s: 1}}
until: 3
"""


def countdown(written: str, start: int = 1) -> Problem:
    return read_problem(COUNTDOWN.replace("MAP", written).replace("START", str(start)).replace("RATE", str(start)))


@pytest.mark.parametrize("name", ["henon", *LIBRARIES])
def test_a_guard_that_is_identically_zero_is_nobody_s_event(name: str) -> None:
    found = solver(name).prepare(read_problem(DEAD_CROSS), rtol=1e-9)()
    told = [(t.kind, t.surface, t.from_mode, t.to_mode) for t in found.transitions]
    assert (found.status, told) == ("ok", [("crossing", 0, (1, -1), (-1, -1))])
    assert found.transitions[0].time == pytest.approx(2 / 3, abs=1e-9)
    assert found.end_state[1] == 0.0


@pytest.mark.parametrize("name", ["henon", *LIBRARIES])
def test_a_timer_that_stops_at_zero_stays_there(name: str) -> None:
    found = solver(name).prepare(countdown("{q: '0', y: '5'}"), rtol=1e-9)()
    assert (found.status, [t.kind for t in found.transitions]) == ("ok", ["reset"])
    assert found.transitions[0].time == pytest.approx(1.0, abs=1e-9)
    assert found.end_state == pytest.approx((0.0, 0.0, 6.0), abs=1e-8)


@pytest.mark.parametrize(
    "written", ["{q: '0', y: '5'}", "{q: '0'}", "{d: '0', q: '0'}", "{q: q - 1}", "{q: y - 1}", "{q: 'q*0', y: y}"]
)
def test_the_label_of_its_mode_is_the_same_however_the_map_is_written(written: str) -> None:
    problem, at_once = countdown(written), countdown(written, start=0)
    # y - 1 is zero only where y is exactly 1: the y of a library is rounded, and the next mode depends on its last bit.
    for name in ("henon",) if "y - 1" in written else ("henon", "heyoka", "scipy-dop853"):
        found = solver(name).prepare(problem, rtol=1e-9)()
        told = [(t.kind, t.from_mode, t.to_mode) for t in found.transitions]
        assert (found.status, told, found.end_mode) == ("ok", [("reset", (1,), (1,))], (1,))
        still = solver(name).prepare(at_once, rtol=1e-9)()
        assert (still.status, len(still.transitions), still.end_mode) == ("ok", 0, (1,))
    truth = multiprecision(problem)
    assert [(t.kind, t.from_mode, t.to_mode) for t in truth.transitions] == [("reset", (1,), (1,))]


@pytest.mark.parametrize("name", ["henon", *LIBRARIES])
@pytest.mark.parametrize("way", [1, -1])
def test_something_moves_it(name: str, way: int) -> None:
    found = solver(name).prepare(read_problem(MOVED.replace("WAY", str(way))), rtol=1e-9)()
    told = [(t.kind, t.surface) for t in found.transitions]
    assert (found.status, told) == ("ok", [("crossing", 1)] if way > 0 else [("crossing", 1), ("crossing", 0)])
    assert [t.time for t in found.transitions] == pytest.approx([1.0] * len(told), abs=1e-6)
    assert found.end_state[0] == pytest.approx(2.0 * way, abs=1e-6)


@pytest.mark.parametrize("name", ["scipy-smoothed", "scipy-sign"])
def test_a_sign_that_is_zero_on_a_surface_cannot_begin_beside_it(name: str) -> None:
    with pytest.raises(UnsupportedError, match="cannot begin there on a given side"):
        solver(name).prepare(read_problem(DEAD_CROSS), rtol=1e-9)
