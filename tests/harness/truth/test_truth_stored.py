"""The stored truths: complete, and against the numbers of Fig. 8's listing and equations, and elliptic integrals."""

from __future__ import annotations

from pathlib import Path

import mpmath
import pytest

from henon_ref.casefile.case import load_case
from henon_ref.harness.truth import compute, store
from henon_ref.harness.truth.reference import Truth, with_short_state

CASES = Path(__file__).parents[3] / "cases"
FILE = CASES / "fig8.yaml"
PERIOD = 1.64853333333333333


def stored(reading: str, file: Path = FILE) -> Truth:
    case = load_case(file)
    truth = compute.stored_truth(case, case.reading(reading), store.folder_of(file))
    assert truth is not None, f"run henon-ref truth {file}"
    return truth


def durations(truth: Truth) -> list[float]:
    starts = [t for t in truth.transitions if t.kind == "stick"]
    ends = [t for t in truth.transitions if t.kind == "release"]
    ends = ends[len(ends) - len(starts) :] if ends[-1].time > starts[-1].time else ends[-len(starts) + 1 :]
    pairs = zip(starts, ends, strict=False)
    return [(b.time - a.time) + (b.time_low - a.time_low) for a, b in pairs]


def test_every_truth_beside_the_cases_is_as_it_was_written() -> None:
    files = sorted((CASES / "truth").glob("*/*.json"))
    assert files
    for file in files:
        truth = store.load(CASES / "truth", file.parent.name, file.stem)
        assert truth is not None
        assert store.dumps(truth) == file.read_text(encoding="utf-8")
        assert truth.transitions == tuple(map(with_short_state, truth.transitions)), file


@pytest.mark.parametrize(("reading", "count"), [("listing", 114), ("listing_limit", 126), ("equations", 85)])
def test_fig8_is_certified_over_the_whole_run(reading: str, count: int) -> None:
    truth = stored(reading)
    assert truth.status == "ok"
    assert truth.certified
    assert truth.proven == len(truth.transitions) == count
    assert truth.radius <= 1e-30


def test_sticks_of_the_listings_limit_tend_to_those_of_its_orbit() -> None:
    """The multiplier is 0.4005 a period: at t = 70 the run is still some 1e-9 away from the orbit."""
    last = sorted(durations(stored("listing_limit"))[-2:])
    assert last == pytest.approx([0.4164164369, 1.1743004676], abs=1e-8)


def test_crossings_of_the_equations_tend_to_the_period_one_orbit() -> None:
    truth = stored("equations")
    assert not [t for t in truth.transitions if t.kind == "stick" and t.time > 60]
    up, down = ([t for t in truth.transitions if t.to_mode == (s,)][-1] for s in (1, -1))
    assert up.time % PERIOD == pytest.approx(0.3500047649, abs=1e-7)
    assert down.time % PERIOD == pytest.approx(0.9327451920, abs=1e-7)
    assert float(up.state[0]) == pytest.approx(-0.2115827055, abs=1e-7)
    assert float(down.state[0]) == pytest.approx(0.2488513875, abs=1e-7)


def test_a_pendulum_passes_an_angle_at_times_of_elliptic_integrals() -> None:
    """sin(x / 2) = k sn(K - t), k^2 = 1/2: from a right angle at rest, the times at which x = -1."""
    truth = stored("default", CASES / "hard" / "symmetric_start.yaml")
    assert truth.certified
    with mpmath.workdps(50):
        half = mpmath.mpf(1) / 2
        quarter = mpmath.ellipk(half)
        beyond = mpmath.ellipf(mpmath.asin(mpmath.sqrt(2) * mpmath.sin(half)), half)
        exact = [(4 * k + 2) * quarter + sign * (quarter - beyond) for k in range(3) for sign in (-1, 1)]
        assert exact[-1] < 20 < exact[0] + 12 * quarter
        for transition, time in zip(truth.transitions, exact, strict=True):
            assert abs(mpmath.mpf(transition.time_digits) - time) <= transition.radius <= 1e-38
