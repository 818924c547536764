"""Jumps that compiled code decides: they are closed forms', multiprecision's, and the same however a run is cut up."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp

from henon_ref.casefile.case import load_case
from henon_ref.errors import ModelError
from henon_ref.harness.registry import solver
from henon_ref.integrator import mode_changes
from henon_ref.integrator.integrator import Integrator
from henon_ref.integrator.mode_code import jump_code
from henon_ref.integrator.points import Keep, PointRuns
from henon_ref.integrator.run import Run
from henon_ref.integrator.run_result import KINDS
from henon_ref.modes.problem import Problem
from henon_ref.modes.resets import with_resting
from henon_ref.modes.switched_field import Reset
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.tape import TIME
from henon_ref.trajectory import Trajectory, Transition
from tests.support.resets import ball, ball_impacts, impact_oscillator, oscillator_impacts

SCENES = Path(__file__).parents[2] / "cases" / "scenes"
X, V, W = sp.symbols("x v w", real=True)
S, U = sp.symbols("s u", real=True)
HALF = sp.Rational(1, 2)
BOUNCES = {0: Reset({V: -HALF * V})}


def run(problem: Problem, rtol: float = 1e-13) -> Trajectory:
    return solver("henon").prepare(problem, rtol=rtol)()


def ints(*values: int) -> tuple[sp.Expr, ...]:
    return tuple(map(sp.Integer, values))


@pytest.fixture
def jumps_in_python(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, ...]]:
    """Surfaces of each jump that Python makes."""
    made: list[tuple[int, ...]] = []
    jump = mode_changes.jump

    def counted(run: Run, surfaces: tuple[int, ...], hits: Any) -> Any:
        made.append(surfaces)
        return jump(run, surfaces, hits)

    monkeypatch.setattr(mode_changes, "jump", counted)
    return made


def test_clear_impacts_are_compiled_code_s(jumps_in_python: list[tuple[int, ...]]) -> None:
    falls = run(ball(sp.Rational(4024865, 1000000), sp.Rational(4, 5)))
    assert [t.time for t in falls.transitions] == pytest.approx(ball_impacts(50, 0.8), abs=1e-13, rel=0)
    swings = run(impact_oscillator(HALF, HALF, 30))
    assert [t.time for t in swings.transitions] == pytest.approx(oscillator_impacts(0.5, 0.5, 30.0), abs=1e-12, rel=0)
    assert jumps_in_python == []


def test_a_rest_at_once_is_compiled_code_s(jumps_in_python: list[tuple[int, ...]]) -> None:
    # x'' = t - 2 on a floor that takes all speed: at rest from t = 1, until the acceleration is upwards.
    free = FilippovSystem((X, V), (S,), (X,), (V, TIME - 2), resets={0: Reset({V: sp.Integer(0)})})
    problem = Problem(with_resting(free), sp.Integer(0), (sp.Rational(5, 6), sp.Integer(0)), sp.Integer(4))
    for _ in range(2):  # first into a mode that is not compiled
        found = run(problem)
        assert [(t.kind, t.from_mode, t.to_mode) for t in found.transitions] == [
            ("reset", (1,), (1,)),
            ("stick", (1,), (0,)),
            ("release", (0,), (1,)),
        ]
        assert [t.time for t in found.transitions] == pytest.approx([1.0, 1.0, 2.0], abs=1e-13)
        assert found.transitions[1].state == pytest.approx((0.0, 0.0), abs=1e-15)
    assert jumps_in_python == []


@pytest.mark.parametrize("restitution", [sp.Rational(4, 5), HALF, sp.Rational(1, 20)])
def test_the_limit_of_impacts_is_compiled_code_s(
    jumps_in_python: list[tuple[int, ...]], restitution: sp.Rational
) -> None:
    """Flights last r, r^2, ... times as long as twice the first fall: the ball rests from T (1 + r)/(1 - r) on."""
    found = run(ball(sp.Integer(5), restitution))
    assert jumps_in_python == []
    assert found.transitions[-1].kind == "stick"
    limit = np.sqrt(1 / 5) * float((1 + restitution) / (1 - restitution))
    assert found.transitions[-1].time == pytest.approx(limit, abs=1e-12, rel=0)
    assert found.end_state == pytest.approx((0.0, 0.0), abs=1e-14)


def test_an_impact_that_the_acceleration_ends_is_compiled_code_s(jumps_in_python: list[tuple[int, ...]]) -> None:
    """x = 1 - 2 t + t^2/2 comes down on a floor that takes all speed, and is lifted off at once."""
    lifted = FilippovSystem((X, V), (S,), (X,), (V, sp.Integer(1)), resets={0: Reset({V: sp.Integer(0)})})
    found = run(Problem(with_resting(lifted), sp.Integer(0), ints(1, -2), sp.Integer(2)))
    assert jumps_in_python == []
    assert [(t.kind, t.from_mode, t.to_mode) for t in found.transitions] == [("reset", (1,), (1,))]
    assert found.transitions[0].time == pytest.approx(2 - np.sqrt(2), abs=1e-14)
    assert found.end_state == pytest.approx((1.0, np.sqrt(2)), abs=1e-14)


# What a jump is, where compiled code leaves it to Python, and what follows.
UNPRESSED = FilippovSystem((X, V), (S,), (X,), (V, V), resets={0: Reset({V: sp.Integer(0)})})
OUTSIDE = FilippovSystem((X, V), (S,), (X,), (V, sp.Integer(-1)), valid=(V + 2,), resets={0: Reset({V: V - 2})})
THROUGH = FilippovSystem((X, V), (S,), (X,), (V, sp.Integer(-1)), resets={0: Reset({V: V / 2})})
CARRIED = FilippovSystem(
    (X, V, W), (S, U), (X, HALF - W), (V, sp.Integer(-1), sp.Integer(0)),
    resets={0: Reset({X: sp.Integer(1), V: sp.Integer(0), W: sp.Integer(1)}), 1: Reset({W: sp.Integer(0)})},
)  # fmt: skip
TO_A_SURFACE = FilippovSystem(
    (X, V, W), (S, U), (X, W), (V, sp.Integer(-1), sp.Integer(0)), resets={0: Reset({V: -HALF * V, W: sp.Integer(0)})}
)
BESIDE = FilippovSystem((X, V, W), (S, U), (X, W), (V, sp.Integer(-1), -U), resets=BOUNCES)


@pytest.mark.parametrize(
    ("system", "start", "status", "kinds"),
    [
        (UNPRESSED, (1, -1), "ok", ["reset"]),
        (OUTSIDE, (1, 0), "invalid", []),
        (CARRIED, (1, 0, 0), "ok", ["reset", "reset"]),
        (TO_A_SURFACE, (1, 0, 1), "ok", ["reset"]),
        (BESIDE, (1, 0, 0), "ok", ["reset"]),
    ],
    ids=["nothing presses", "invalid", "cascade", "never left", "beside a slide"],
)
def test_what_is_not_clear_is_python_s(
    jumps_in_python: list[tuple[int, ...]],
    system: FilippovSystem,
    start: tuple[int, ...],
    status: str,
    kinds: list[str],
) -> None:
    found = run(Problem(with_resting(system), sp.Integer(0), ints(*start), sp.Rational(3, 2)))
    assert jumps_in_python == [(0,)]
    assert (found.status, [t.kind for t in found.transitions]) == (status, kinds)


COUNTED = FilippovSystem((X, V, W), (S,), (HALF - X,), (V, -X, sp.Integer(0)), resets={0: Reset({W: W + 1})})


@pytest.mark.parametrize("system", [THROUGH, COUNTED], ids=["slower", "counted"])
def test_a_surface_that_goes_on_falling_is_compiled_code_s(
    jumps_in_python: list[tuple[int, ...]], monkeypatch: pytest.MonkeyPatch, system: FilippovSystem
) -> None:
    """The state goes on through the surface, at once below it; the bits are those of the way through Python."""
    start = ints(1, 0) if system is THROUGH else ints(0, 1, 0)
    problem = Problem(with_resting(system), sp.Integer(0), start, sp.Integer(20))
    for _ in range(2):  # first into a mode that is not compiled
        compiled = run(problem)
    assert jumps_in_python == []
    below = [t for t in compiled.transitions if t.kind == "reset"]
    assert below
    assert {(t.from_mode, t.to_mode) for t in below} == {((1,), (-1,))}
    monkeypatch.setattr("henon_ref.integrator.mode_table.jump_code", lambda _: None)
    precise = run(problem)
    assert len(jumps_in_python) == len(below)
    assert [(t.time, t.state) for t in compiled.transitions] == [(t.time, t.state) for t in precise.transitions]
    if system is COUNTED:  # x = sin t rises through 1/2 at pi/6 and falls back at 5 pi/6, again and again
        assert [t.time for t in below] == pytest.approx([np.pi / 6 + 2 * np.pi * k for k in range(4)], abs=1e-12)
        assert compiled.end_state[2] == 4.0


@pytest.mark.parametrize(
    ("force", "speed", "modes"),
    [(sp.Integer(1), 0.7, {(1, 1)}), (sp.Integer(-1), -0.7, {(1, -1)}), (sp.Rational(1, 10), 0.0, {(1, 0)})],
    ids=["left where it was", "crossed", "slides"],
)
def test_a_surface_on_which_the_map_puts_the_state_is_compiled_code_s(
    jumps_in_python: list[tuple[int, ...]],
    monkeypatch: pytest.MonkeyPatch,
    force: sp.Expr,
    speed: float,
    modes: set[tuple[int, ...]],
) -> None:
    """A ball loses its sliding velocity w at an impact; then w' = force - 3/10 sign(w), from zero."""
    field = (V, sp.Integer(-10), force - sp.Rational(3, 10) * U)
    resets = {0: Reset({V: -V, W: sp.Integer(0)})}
    system = with_resting(FilippovSystem((X, V, W), (S, U), (X, W), field, resets=resets))
    problem = Problem(system, sp.Integer(0), ints(1, 0, 1), sp.Integer(5))
    for _ in range(2):  # first into a mode that is not compiled
        compiled = run(problem)
    assert jumps_in_python == []
    jumps = [t for t in compiled.transitions if t.kind == "reset"]
    assert [t.time for t in jumps] == pytest.approx(ball_impacts(len(jumps), 1.0), abs=1e-13)
    assert {t.to_mode for t in jumps} == modes
    assert compiled.end_state[2] == pytest.approx(speed * (compiled.end_time - jumps[-1].time), abs=1e-13)
    monkeypatch.setattr("henon_ref.integrator.mode_table.jump_code", lambda _: None)
    precise = run(problem)
    assert len(jumps_in_python) == len(jumps)
    assert told(compiled) == told(precise)


def told(found: Trajectory) -> list[tuple[Any, ...]]:
    return [(t.kind, t.surface, t.from_mode, t.to_mode) for t in found.transitions]


@pytest.mark.parametrize("rtol", [1e-6, 1e-12])
@pytest.mark.parametrize(
    "name", ["bouncing_table", "impact_pair", "belt_stop", "inelastic_ball", "../classic/rimless_wheel"]
)
def test_jumps_are_those_of_multiprecision(monkeypatch: pytest.MonkeyPatch, name: str, rtol: float) -> None:
    problem = load_case(SCENES / f"{name}.yaml").readings[0].problem
    compiled = run(problem, rtol)
    monkeypatch.setattr("henon_ref.integrator.mode_table.jump_code", lambda _: None)
    precise = run(problem, rtol)
    assert told(compiled) == told(precise)
    # What rounding does at a jump grows on the way, in no case here by more than this.
    for one, other in zip(compiled.transitions, precise.transitions, strict=True):
        assert one.time == pytest.approx(other.time, abs=1e-11, rel=0)
        assert one.state == pytest.approx(other.state, abs=1e-11, rel=0)


def test_a_map_that_swaps_and_shifts_loses_no_digit_of_the_state() -> None:
    # v and w change places: what rounding has lost of v is behind w.
    system = FilippovSystem(
        (X, V, W), (S,), (X,), (sp.Integer(-1), sp.Rational(1, 3), sp.Integer(0)), resets={0: Reset({X: X + 5, W: V})}
    )
    integrator = Integrator(system, 8)
    start = integrator.start(
        Problem(system, sp.Integer(0), (sp.Integer(1), sp.sqrt(2) / 64, sp.Integer(0)), sp.Integer(2)),
        tolerance=1e-14,
    )
    here = Run(integrator, start, block=1)
    event = here.next_event()
    assert isinstance(event, Transition)
    assert here.x_low[1] != 0.0
    assert (here.x[2], here.x_low[2]) == (here.x[1], here.x_low[1])


def flipping() -> Problem:
    """A mass with friction before a wall: an impact changes the sign of its velocity, and with it the friction's."""
    system = FilippovSystem((X, V), (S, U), (1 - X, V), (V, 2 - X - U / 4), resets={0: Reset({V: -HALF * V})})
    return Problem(with_resting(system), sp.Integer(0), ints(0, 0), sp.Integer(6))


def test_a_jump_into_a_mode_not_compiled_has_the_bits_of_one_into_a_compiled_mode() -> None:
    problem = flipping()
    integrator = Integrator(problem.system, 18)
    start = integrator.start(problem, tolerance=1e-13)
    first, second = (Run(integrator, start).to_horizon() for _ in range(2))
    assert ("reset", 0, (1, 1), (1, -1)) in told(first)
    assert list(first.transitions) == list(second.transitions)
    assert (first.end_state, first.counts) == (second.end_state, second.counts)


@pytest.mark.parametrize("block", [1, 2, 3])
def test_transitions_in_small_blocks_are_the_same(block: int) -> None:
    problem = flipping()
    integrator = Integrator(problem.system, 18)
    start = integrator.start(problem, tolerance=1e-13)
    whole = Run(integrator, start).to_horizon()
    parts = [t for chunk in Run(integrator, start, block=block).stream() for t in chunk]
    assert parts == list(whole.transitions)


def test_points_have_the_bits_of_runs_alone() -> None:
    given = flipping()
    f = sp.Symbol("f", real=True)
    field = (given.system.field[0], given.system.field[1] + f)
    system = with_resting(replace(given.system, field=field, overrides={}))
    values = np.linspace(0.0, 0.5, 5)[:, None]
    initial, integrator = np.zeros((5, 2)), Integrator(system, 18)
    runs = PointRuns(integrator, values, initial, until=3.0, tolerance=1e-13, keep=Keep())
    for _ in (1, 2):  # first with modes to compile, then with none
        rows = np.concatenate(list(runs))
        for point in range(5):
            end = Run(integrator, runs.start(point)).to_horizon()
            own = rows[rows["point"] == point]
            assert [(KINDS[r["kind"]], r["time"], r["time_low"], tuple(r["state"].tolist())) for r in own] == [
                (t.kind, t.time, t.time_low, t.state) for t in end.transitions
            ]
        runs = PointRuns(integrator, values, initial, until=3.0, tolerance=1e-13, keep=Keep())
    assert all(status == "ok" for status, _ in map(runs.status, range(5)))


def test_a_run_may_end_on_a_surface_that_resets() -> None:
    problem = impact_oscillator(HALF, HALF, 30)
    integrator = Integrator(problem.system, 18)
    start = integrator.start(problem, tolerance=1e-13, stop_falling=1)
    found = Run(integrator, start).to_horizon()
    assert (found.status, [t.kind for t in found.transitions], found.end_time) == (
        "ok",
        ["reset"],
        pytest.approx(sp.pi.n() / 6),
    )


def test_systems_without_resets_have_no_code_of_jumps() -> None:
    system = FilippovSystem((X,), (S,), (X,), (TIME - S,))
    assert jump_code(system) is None
    table = Integrator(system, 8).mode_table
    assert {len(code.tapes) for code in table.codes} == {2}
    assert not table.compiled.records["guards"]["jump"].any()


def test_a_map_that_is_not_smooth_is_refused() -> None:
    system = FilippovSystem((X, V), (S,), (X,), (V, sp.Integer(-1)), resets={0: Reset({V: sp.Abs(V)})})
    with pytest.raises(ModelError, match="Abs"):
        Integrator(system, 8)
