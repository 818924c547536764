"""A run has limits of steps and memory, so that it ends and fits into memory; its reason names the limit."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import henon_ref as hr
from henon_ref.errors import HenonRefError
from henon_ref.integrator import state_view
from henon_ref.sweeps.sweep_file import load_sweep

FOREVER: dict[str, Any] = {"until": 1e9}
"""Of the oscillator below: some 1e9 steps."""
WORDS = "stopped after 500 steps, as many as max_steps allows, at t = "


def oscillator() -> hr.System:
    return hr.System(["x", "v"], {"w": 1}, {"s": "x"}, ["v", "-w**2*x"])


def test_simulate_ends_failed() -> None:
    run = hr.simulate(oscillator(), {"x": 1, "v": 0}, max_steps=500, **FOREVER)
    assert (run.status, run.counts.steps) == ("failed", 500)
    assert run.message.startswith(WORDS)
    assert run.t[-1] < 1e9
    again = hr.simulate(oscillator(), {"x": 1, "v": 0}, max_steps=500, **FOREVER)
    assert again.message == run.message
    assert hr.simulate(oscillator(), {"x": 1, "v": 0}, until=10, max_steps=500).success
    assert "stopped after 1 step, as" in hr.simulate(oscillator(), {"x": 1, "v": 0}, max_steps=1, **FOREVER).message


def test_a_stream_ends_failed() -> None:
    rows = hr.stream(oscillator(), {"x": 1, "v": 0}, max_steps=500, **FOREVER)
    assert len(list(rows)) > 3
    assert rows.outcome is not None
    assert rows.outcome.status == "failed"
    assert rows.outcome.message.startswith(WORDS)


@pytest.mark.parametrize("dense", [True, False])
def test_a_run_whose_records_fill_the_memory_ends_failed(monkeypatch: pytest.MonkeyPatch, dense: bool) -> None:
    whole = hr.simulate(oscillator(), {"x": 1, "v": 0}, until=1e4, dense_output=dense)
    size = 8 * (4 + 2) * len(whole.transitions)
    if dense:
        assert whole.sol is not None
        size += 8 * (5 + whole.sol.coefficients[0].size) * whole.counts.steps
    monkeypatch.setattr(state_view, "MOST_KEPT", size // 2)
    run = hr.simulate(oscillator(), {"x": 1, "v": 0}, dense_output=dense, until=2e4)
    assert run.status == "failed"
    assert run.message.startswith("stopped at t = ")
    assert 0.4 < len(run.transitions) / len(whole.transitions) < 0.8
    pd.testing.assert_frame_equal(run.transitions, whole.transitions.head(len(run.transitions)))
    rows = hr.stream(oscillator(), {"x": 1, "v": 0}, until=1e4)
    assert len(list(rows)) == len(whole.transitions)
    if not dense:
        with pytest.raises(HenonRefError, match="run towards the orbit ended failed: stopped at t = "):
            hr.periodic_orbit(oscillator(), {"x": 1, "v": 0}, until=2e4)


@pytest.mark.parametrize("mode", [None, {"s": 1}])
@pytest.mark.parametrize("points", ["grid", "chain"])
def test_a_point_of_a_sweep_ends_failed(mode: dict[str, int] | None, points: str) -> None:
    """At w = 1e-6 the horizon is reached."""
    values = [1, 1e-6, 2]
    observed = [hr.observe.status(), hr.observe.final_state(), hr.observe.function(lambda run: run.status, "alone")]
    table = hr.sweep(
        oscillator(), {"x": 1, "v": 0}, until=1e6, max_steps=500, observe=observed, jobs=1, mode=mode,
        grid={"w": values} if points == "grid" else hr.points.continuation({"w": values}, directions=["up"]),
    )  # fmt: skip
    assert table["status"].tolist() == table["alone"].tolist() == ["failed", "ok", "failed"]
    assert table["steps"].tolist()[::2] == [500, 500]
    assert all(message.startswith(WORDS) for message in table["message"].tolist()[::2])
    alone = hr.simulate(oscillator(), {"x": 1, "v": 0}, until=1e6, max_steps=500, mode=mode)
    assert (alone.message, alone.y[0, -1]) == (table["message"][0], table["final_x"][0])


def test_a_sweep_file_has_it_too(tmp_path: Path) -> None:
    hr.sweep(oscillator(), {"x": 1, "v": 0}, until=1e6, max_steps=7, grid={"w": [1, 2]}, jobs=1, out=tmp_path / "out")
    plan = load_sweep(tmp_path / "out" / "sweep.yaml")
    assert plan.work.max_steps == 7
    text = (tmp_path / "out" / "sweep.yaml").read_text().replace("max_steps: 7", "max_steps: 0")
    (tmp_path / "bad.yaml").write_text(text)
    with pytest.raises(HenonRefError, match="max_steps"):
        load_sweep(tmp_path / "bad.yaml")


@pytest.mark.parametrize("wrong", [0, -1, 1.5, True, "many", None, float("nan")])
def test_what_is_no_number_of_steps_is_refused(wrong: object) -> None:
    for act in (hr.simulate, hr.stream):
        with pytest.raises(HenonRefError, match="max_steps"):
            act(oscillator(), {"x": 1, "v": 0}, until=1, max_steps=wrong)
    with pytest.raises(HenonRefError, match="max_steps"):
        hr.sweep(oscillator(), {"x": 1, "v": 0}, until=1, max_steps=wrong, grid={"w": [1]}, jobs=1)


def test_without_one_it_is_a_hundred_million() -> None:
    run = hr.simulate(oscillator(), {"x": 1, "v": 0}, until=1, max_steps=10**30)
    assert run.success
    assert np.isfinite(run.y).all()
    from henon_ref.simulation.launch import launch

    _, begin = launch(oscillator(), {"x": 1, "v": 0}, 1, 0, 1e-10, None, None, None, 10**8)
    assert begin.scalars.most_steps == 10**8
