"""Points: order, what is refused, the same draws for the same seed."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from henon_ref.errors import ArgumentError
from henon_ref.sweeps.draws import random
from henon_ref.sweeps.points import continuation, grid, points_of, table


def test_the_last_name_of_a_grid_changes_fastest() -> None:
    points = grid({"a": [1, 2], "b": [3, 4, 5]})
    assert points.names == ("a", "b")
    assert points.values.tolist() == [[a, b] for a in (1, 2) for b in (3, 4, 5)]


def test_a_range_has_both_its_ends() -> None:
    assert grid({"a": {"from": 0.05, "to": 1, "count": 200}}).values[[0, -1], 0].tolist() == [0.05, 1.0]


@pytest.mark.parametrize(
    ("axes", "words"),
    [
        ({"a": [1, float("nan")]}, "nan at place 2"),
        ({"a": [1, float("inf")]}, "inf"),
        ({"a": []}, "empty"),
        ({}, "mapping"),
        ({"a": "1"}, "numbers"),
        ({"a": [True, False]}, "numbers"),
        ({"a": [[1, 2]]}, "shape"),
        ({"a": ["x"]}, "numbers"),
        ({"a": {"from": 0, "to": 1}}, "from, to and count"),
        ({"a": {"from": 0, "to": 1, "count": 0}}, "count"),
        ({"a": {"from": 0, "to": float("nan"), "count": 3}}, "nan"),
    ],
)
def test_what_is_no_grid_is_refused(axes: dict[str, object], words: str) -> None:
    with pytest.raises(ArgumentError, match=words):
        grid(axes)


def test_a_table_is_a_data_frame_a_csv_or_a_parquet_file(tmp_path) -> None:
    frame = pd.DataFrame({"vb": [0.1, 0.30000000000000004], "x": [1.0, 2.0]})
    frame.to_csv(tmp_path / "points.csv", index=False)
    frame.to_parquet(tmp_path / "points.parquet")
    for given in (frame, tmp_path / "points.csv", str(tmp_path / "points.parquet")):
        points = points_of(given)
        assert points.names == ("vb", "x")
        assert points.values.tolist() == frame.to_numpy().tolist()


@pytest.mark.parametrize("given", ["missing.csv", pd.DataFrame(), pd.DataFrame({"x": [1.0, np.nan]}), 3, None])
def test_what_is_no_table_is_refused(given: object) -> None:
    with pytest.raises(ArgumentError):
        points_of(given)


def test_a_file_that_is_no_table_is_refused(tmp_path) -> None:
    (tmp_path / "x.parquet").write_bytes(b"PAR1 nothing")
    (tmp_path / "x.csv").write_text("a,b\nx,1\n")
    for name in ("x.parquet", "x.csv"):
        with pytest.raises(ArgumentError):
            table(tmp_path / name)


def test_draws_are_those_of_their_seed() -> None:
    draws = {"x": {"uniform": [-2, 2]}, "v": {"normal": [1, 0.5]}}
    for method in ("independent", "sobol"):
        one, same, other = (random(draws, count=1000, seed=s, method=method).values for s in (7, 7, 8))
        assert np.array_equal(one, same)
        assert not np.array_equal(one, other)
        assert np.abs(one[:, 0]).max() <= 2
        assert abs(one[:, 1].mean() - 1) < 0.1
        assert abs(one[:, 1].std() - 0.5) < 0.05


def test_a_sobol_sequence_fills_every_box() -> None:
    values = random({"x": {"uniform": [0, 1]}, "y": {"uniform": [0, 1]}}, count=64, method="sobol").values
    boxes = set(map(tuple, np.floor(values * 8).astype(int).tolist()))
    assert len(boxes) == 64


@pytest.mark.parametrize(
    "arguments",
    [
        {"draws": {}, "count": 3},
        {"draws": {"x": {"uniform": [1, 0]}}, "count": 3},
        {"draws": {"x": {"cauchy": [1, 0]}}, "count": 3},
        {"draws": {"x": {"normal": [0, -1]}}, "count": 3},
        {"draws": {"x": {"uniform": [0, 1]}}, "count": 0},
        {"draws": {"x": {"uniform": [0, 1]}}, "count": 3, "seed": -1},
        {"draws": {"x": {"uniform": [0, 1]}}, "count": 3, "method": "halton"},
    ],
)
def test_what_cannot_be_drawn_is_refused(arguments: dict[str, object]) -> None:
    with pytest.raises(ArgumentError):
        random(**arguments)


def test_a_continuation_goes_up_and_back() -> None:
    points = continuation({"F": [1, 2, 3]}, {"x": [0, 5]})
    assert points.names == ("x", "F")
    assert points.values.tolist() == [[x, f] for x in (0, 5) for f in (1, 2, 3, 3, 2, 1)]
    assert points.chain == 6
    for arguments in ({"along": {"F": [1], "x": [2]}}, {"along": {"F": [1]}, "directions": ["left"]}):
        with pytest.raises(ArgumentError):
            continuation(**arguments)
