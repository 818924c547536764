"""A run as a file: what is loaded is what was saved, to the last bit, and the file is open to others."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import henon_ref as hr

CASES = Path(__file__).parents[2] / "cases"
NAMES = ["fig8", "two_blocks", "scenes/bouncing_ball", "leaving_slide", "hard/sawtooth", "hard/roots_at_once"]


def assert_same(run: hr.Solution, loaded: hr.Solution) -> None:
    assert loaded.transitions.equals(run.transitions)
    assert loaded.sticks.equals(run.sticks)
    assert (loaded.t.tolist(), loaded.y.tolist()) == (run.t.tolist(), run.y.tolist())
    assert (loaded.status, loaded.message, loaded.final_mode) == (run.status, run.message, run.final_mode)
    assert (loaded.counts, loaded.counts.decisions) == (run.counts, run.counts.decisions)
    assert list(loaded.trajectory.transitions) == list(run.trajectory.transitions)
    assert loaded.undecided_after == run.undecided_after
    assert loaded.system == run.system
    assert repr(loaded) == repr(run)


@pytest.mark.parametrize("name", NAMES)
def test_what_is_loaded_is_what_was_saved(name: str, tmp_path: Path) -> None:
    run = hr.simulate(hr.System.from_case(CASES / f"{name}.yaml"))
    run.save(tmp_path / "run")
    loaded = hr.load_run(tmp_path / "run")
    assert_same(run, loaded)
    times = np.linspace(run.t[0], run.t[-1], 999)
    assert np.array_equal(loaded.sol(times), run.sol(times))
    assert loaded.mode(times) == run.mode(times)


def test_parameters_of_the_run_and_a_run_without_dense_output(tmp_path: Path) -> None:
    belt = hr.System(["x", "v"], {"F": "1/3", "G": "2*F", "vb": 0.5}, {"s": "v - vb"}, ["v", "-x - G*s"])
    run = hr.simulate(belt, {"x": 1.5, "v": "sqrt(2)"}, until=20, parameters={"F": 0.1}, dense_output=False)
    run.save(tmp_path / "run.npz")
    loaded = hr.load_run(tmp_path / "run.npz")
    assert_same(run, loaded)
    assert loaded.sol is None
    assert str(loaded.system.parameters["G"]) == "1/5"
    again = hr.simulate(loaded.system, {"x": 1.5, "v": "sqrt(2)"}, until=20)
    assert again.transitions.equals(run.transitions)


def test_a_start_that_is_refused_is_saved_too(tmp_path: Path) -> None:
    run = hr.simulate(hr.System(["x"], {}, {"s": "x"}, ["s"]), {"x": 0}, until=1)
    run.save(tmp_path / "run.npz")
    assert_same(run, hr.load_run(tmp_path / "run.npz"))


def test_others_read_the_file(tmp_path: Path) -> None:
    ball = hr.System(["x", "v"], {}, {"s": "x"}, ["v", "-1"], resets={"s": {"when": "falling", "map": {"v": "-v/2"}}})
    run = hr.simulate(ball, {"x": 1, "v": 0}, until=2)
    run.save(tmp_path / "run.npz")
    with np.load(tmp_path / "run.npz", allow_pickle=False) as archive:
        about = json.loads(str(archive["about"]))
        assert about["system"]["system"]["field"] == ["v", "-1"]
        assert archive["transition_kind"].tolist() == ["reset"]
        assert archive["transition_time"] == pytest.approx([2**0.5])
        begin, unit = archive["step_time"][-1], archive["step_unit"][-1]
        height = np.polynomial.polynomial.polyval((2 - begin) / unit, archive["step_coefficients"][-1][0])
    assert height == pytest.approx(run.sol(2.0)[0], abs=1e-15)


def test_what_is_no_such_file_is_said(tmp_path: Path) -> None:
    (tmp_path / "text").write_text("t, x")
    np.savez(tmp_path / "other.npz", x=np.zeros(3))
    np.savez(tmp_path / "later.npz", about=np.array('{"format": 2}'))
    for name, words in (
        ("none", "cannot read"),
        ("text", "not a run written"),
        ("other.npz", "not a run written"),
        ("later.npz", "format 2; this version reads format 1"),
    ):
        with pytest.raises(ValueError, match=words) as refused:
            hr.load_run(tmp_path / name)
        assert name in str(refused.value)
    run = hr.simulate(hr.System(["x"], {}, {}, ["1"]), {"x": 0}, until=1)
    with pytest.raises(ValueError, match="cannot write"):
        run.save(tmp_path / "none" / "run.npz")
