"""The cases that come with the project: every one reads, and the central ones say what their source says."""

from __future__ import annotations

from pathlib import Path

import pytest
import sympy as sp

from henon_ref.casefile.case import load_case
from henon_ref.harness.registry import fixed_step, names
from henon_ref.modes.mode_evaluation import in_doubles
from henon_ref.modes.selection import initial_mode

CASES = Path(__file__).parents[2] / "cases"
TOP = sorted(CASES.glob("*.yaml"))


@pytest.mark.parametrize("path", TOP, ids=[path.stem for path in TOP])
def test_a_case_reads_and_is_named_after_its_file(path: Path) -> None:
    case = load_case(path, solvers=names(), fixed_step=fixed_step)
    assert case.name == path.stem
    assert case.source
    for reading in case.readings:
        assert reading.story
        assert len(reading.mathematics_hash) == 64


def test_fig_8_has_its_three_readings() -> None:
    case = load_case(CASES / "fig8.yaml")
    listing, limit, equations = case.readings
    assert [r.name for r in case.readings] == ["listing", "listing_limit", "equations"]
    assert (listing.solvers, listing.steps, listing.problem.until) == (("henon-listing",), (1e-4,), sp.Rational("63.3"))
    assert {r.measure_after for r in case.readings} == {60.0}
    assert limit.published is not None
    assert [str(d) for d in limit.published.stick_durations] == ["1.1746", "0.4161"]
    # The listing and its limit differ in the horizon only; slip is three times as fast as in the equations.
    assert {k for k, v in listing.mathematics.items() if v != limit.mathematics[k]} == {"until"}
    fast, slow = limit.problem.system, equations.problem.system
    assert all(sp.simplify(f - 3 * g) == 0 for f, g in zip(fast.field, slow.field, strict=True))
    assert not slow.overrides
    assert slow.effects == ("spring (block, base)", "friction s (block, belt)")


def test_fig_8_starts_at_the_lower_tangent_point_of_eq_24() -> None:
    for name, mode in (("listing_limit", (0,)), ("equations", (1,))):
        problem = load_case(CASES / "fig8.yaml").reading(name).problem
        position, velocity = problem.initial
        assert position == -2 * sp.sqrt(3) / 3 * sp.sin(sp.pi / 18)
        assert velocity == sp.Rational(2, 5)
        mu0 = problem.system.parameters[sp.Symbol("mu0", real=True)]
        assert abs(sp.N(position - position**3 + mu0, 40)) < 1e-38
        decision = initial_mode(in_doubles(problem.system).at_start(problem), problem)
        assert decision.mode == mode
