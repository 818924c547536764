"""The function: its table, and what it refuses before anything is written."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
import pandas as pd
import pytest
from sweep_systems import belt, sliding_block

import henon_ref as hr
from henon_ref.errors import HenonRefError
from henon_ref.simulation.simulate import simulate
from henon_ref.simulation.system import System
from henon_ref.sweeps.plan import planned
from henon_ref.sweeps.sweep import sweep
from henon_ref.sweeps.sweep_file import load_sweep


def test_the_table_has_a_row_a_point_in_the_grids_order() -> None:
    grid = {"vb": np.linspace(0.05, 1, 4), "x": [0, 1, 2]}
    observed = [hr.observe.sticks(after=30), hr.observe.final_state()]
    table = hr.sweep(belt(), {"x": 1.5, "v": 0}, until=50, grid=grid, observe=observed, rtol=1e-9, jobs=1)
    assert list(table.columns) == [
        "vb", "x", "status", "stick_count", "last_stick_duration", "final_x", "final_v", "final_mode",
    ]  # fmt: skip
    assert isinstance(table, pd.DataFrame)
    assert table[["vb", "x"]].to_numpy().tolist() == [[vb, x] for vb in grid["vb"] for x in grid["x"]]
    assert type(table[["vb"]]) is pd.DataFrame


def test_a_row_is_what_simulate_says() -> None:
    grid = {"vb": [0.3, 0.7], "x": [0.25, 1.5]}
    table = hr.sweep(
        belt(), {"x": 9, "v": 0}, until=30, grid=grid, observe=[hr.observe.final_state()], rtol=1e-9, jobs=1
    )
    for row in table.itertuples():
        run = simulate(belt(), {"x": row.x, "v": 0}, until=30, rtol=1e-9, parameters={"vb": row.vb})
        assert run.y[:, -1] == pytest.approx([row.final_x, row.final_v], abs=1e-7)
        assert run.final_mode == row.final_mode
        assert run.status == row.status


def test_numbers_may_be_fractions_and_text() -> None:
    table = hr.sweep(
        sliding_block(),
        {"x": Fraction(1, 3), "v": "1/2"},
        start="1/4",
        until="9 + 1/4",
        grid={"F": [Fraction(1, 2), 1]},
        observe=[hr.observe.final_state(), hr.observe.status()],
        jobs=1,
    )
    assert table["final_x"].to_numpy() == pytest.approx([1 / 3 + 0.25, 1 / 3 + 0.125], rel=1e-12)
    assert table["end_time"].tolist() == [9.25, 9.25]


@pytest.mark.parametrize("mode", [None, {"s": 0}])
@pytest.mark.parametrize("grid", [{"x": [0, 0.5]}, {"vb": [0.1, 0.5]}])
def test_a_start_on_a_surface_may_be_an_irrational_number(grid: dict[str, Any], mode: dict[str, int] | None) -> None:
    """v = pi*vb is on the surface for every vb; a pair of doubles would be beside it."""
    system = System(["x", "v"], {"vb": 0.3}, {"s": "v - pi*vb"}, ["v", "-s"])
    observed = [hr.observe.final_state()]
    table = hr.sweep(system, {"x": 0.5, "v": "pi*vb"}, until=2, grid=grid, observe=observed, mode=mode, jobs=1)
    assert table["status"].tolist() == ["ok", "ok"]
    assert table["final_mode"].tolist() == ["s=0", "s=0"]
    speed = np.pi * np.array(grid.get("vb", [0.3, 0.3]))
    assert table["final_x"].to_numpy() == pytest.approx(2 * speed + grid.get("x", [0.5, 0.5]), rel=1e-14)


def test_without_observations_there_is_the_status() -> None:
    table = hr.sweep(sliding_block(), {"x": 0, "v": 1}, until=2, grid={"F": [1, 2]}, jobs=1)
    assert table["status"].tolist() == ["ok", "ok"]


@pytest.mark.parametrize(
    "change",
    [
        {"grid": {"speed": [1]}},
        {"grid": {"vb": [0.5, float("nan")]}},
        {"grid": {"vb": []}},
        {"grid": 3},
        {"grid": {"t": [0]}},
        {"grid": hr.points.continuation({"x": [0, 1]})},
        {"grid": hr.points.continuation({"x": [0]}, directions=["up"])},
        {"grid": hr.points.Points(("x", "vb"), np.array([[0, 0.1], [1, 0.1]]), chain=2)},
        {"initial": {"x": 1}},
        {"initial": {"x": 1}, "grid": {"v": [0, 1]}},
        {"initial": {"x": 1, "v": 0, "w": 0}},
        {"initial": {"x": 1, "v": float("inf")}},
        {"initial": 3},
        {"until": 0},
        {"until": -1},
        {"until": float("nan")},
        {"until": "soon"},
        {"start": 5},
        {"rtol": 0},
        {"rtol": float("nan")},
        {"rtol": 2},
        {"observe": ["sticks"]},
        {"observe": "sticks"},
        {"mode": {"q": 1}},
        {"system": 3},
    ],
)
def test_what_cannot_be_meant_is_refused_before_anything_is_written(change: dict[str, Any], tmp_path) -> None:
    given = {
        "system": belt(), "initial": {"x": 1.5, "v": 0}, "until": 5, "grid": {"vb": [0.5]},
        "observe": [hr.observe.final_state()], "rtol": 1e-9, "jobs": 1, "out": tmp_path / "out", **change,
    }  # fmt: skip
    with pytest.raises(HenonRefError) as caught:
        sweep(given.pop("system"), given.pop("initial"), **given)
    assert len(str(caught.value)) < 400
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("count", "chunk"), [(10, 16), (300, 16), (2000, 32), (10_000, 157), (10**6, 2000)])
def test_a_sweep_of_few_points_has_few_chunks(count: int, chunk: int) -> None:
    points = hr.points.grid({"F": {"from": 1, "to": 2, "count": count}})
    assert planned(sliding_block(), {"x": 0, "v": 1}, until=1, grid=points, observe=[]).chunk == chunk


def test_a_state_called_as_a_column_of_the_result_is_refused() -> None:
    odd = System(["status"], {"F": 1}, {"s": "status"}, ["-F*s"])
    with pytest.raises(HenonRefError, match="status"):
        sweep(odd, {"status": 1}, until=5, grid={"status": [1]}, jobs=1)


def test_a_system_without_surfaces_has_modes_without_names(tmp_path) -> None:
    """x' = p: no mode to name, no stick to count; sweep.yaml is read back."""
    drift = System(["x"], {"p": 1}, {}, ["p"])
    observed = [hr.observe.final_state(), hr.observe.sticks(each=True)]
    given = {"until": 2, "grid": {"p": [1, 2, 3]}, "observe": observed, "jobs": 1}
    table = sweep(drift, {"x": 1}, out=tmp_path / "out", **given)
    assert table["final_x"].tolist() == [3, 5, 7]
    assert table["final_mode"].tolist() == ["", "", ""]
    assert table["stick_count"].tolist() == [0, 0, 0]
    assert list(table.frames["sticks"].columns) == ["point", "start_s", "duration_s", "surface"]
    assert sweep(drift, {"x": 1}, out=tmp_path / "out", resume=True, **given).equals(table)
    assert list(load_sweep(tmp_path / "out" / "sweep.yaml").tables) == ["points", "sticks"]
