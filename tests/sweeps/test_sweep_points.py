"""Points: order, what is refused, the same draws for the same seed."""

from __future__ import annotations

import os
import re
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from henon_ref.errors import ArgumentError
from henon_ref.sweeps import table_files
from henon_ref.sweeps.points import Points, continuation, grid, points_of, random, table
from henon_ref.sweeps.table_files import MOST_NUMBERS


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
        ({"a": [1j, 2]}, "numbers"),
        ({"a": np.ma.array([0.1, 0.2], mask=[False, True])}, "numbers"),
        ({"a": np.array(["2026-11-27"], dtype="datetime64[D]")}, "numbers"),
        ({"a": {"from": 0, "to": 1}}, "from, to and count"),
        ({"a": {"from": 0, "to": 1, "count": 0}}, "count"),
        ({"a": {"from": 0, "to": float("nan"), "count": 3}}, "nan"),
        ({"a": {"from": "x", "to": 1, "count": 3}}, r"\[from, to\] of 'a'.* is \['x', 1\]"),
    ],
)
def test_what_is_no_grid_is_refused(axes: dict[str, object], words: str) -> None:
    with pytest.raises(ArgumentError, match=words):
        grid(axes)


def test_a_table_is_a_data_frame_a_csv_or_a_parquet_file(tmp_path) -> None:
    pytest.importorskip("pyarrow")
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


@pytest.mark.parametrize("given", [np.ones((2, 2)), pd.Series({"x": 1.0}), [1.0], 3, None])
def test_what_has_no_columns_by_name_is_no_table(given: object) -> None:
    with pytest.raises(ArgumentError, match=r"^a table is a .*; wanted a data frame, columns by name, or a file"):
        table(given)


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


def test_directions_of_a_continuation_may_be_an_array() -> None:
    points = continuation({"F": [1, 2]}, directions=np.array(["down", "up"]))
    assert points.values.ravel().tolist() == [2, 1, 1, 2]
    assert points.written["continuation"]["directions"] == ["down", "up"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"along": {"F": [1], "x": [2]}}, "'along' must have one parameter"),
        ({"along": [1]}, "'along' is of type list; wanted a mapping"),
        ({"axes": [1]}, "'axes' is of type list; wanted a mapping"),
        ({"axes": {"x": []}}, "'x' of 'axes' is empty"),
        ({"axes": {"F": [1]}}, "'F' is the parameter of 'along' and also an axis of its grid"),
        ({"directions": ["left"]}, "'directions' is ['left']; wanted a list"),
        ({"directions": "up"}, "'directions' is 'up'; wanted a list"),
        ({"directions": []}, "'directions' is []; wanted a list"),
        ({"directions": ["up", "up"]}, "'directions' is ['up', 'up']; wanted a list"),
        ({"directions": np.array([1.0, 2.0])}, "'directions' is array([1., 2.]); wanted a list"),
    ],
)
def test_a_refused_continuation_names_the_argument(arguments: dict[str, Any], words: str) -> None:
    with pytest.raises(ArgumentError) as refused:
        continuation(**{"along": {"F": [1, 2]}, **arguments})
    assert str(refused.value).startswith(words)


def test_a_grid_of_many_names_is_one() -> None:
    points = grid({f"a{k}": [k, k + 0.5] if k in (3, 77) else [k] for k in range(90)})
    assert points.values.shape == (4, 90)
    assert points.values[:, [3, 77]].tolist() == [[3, 77], [3, 77.5], [3.5, 77], [3.5, 77.5]]


@pytest.mark.parametrize(
    "make",
    [
        lambda: grid({"F": {"from": 0.5, "to": 2, "count": 200_000_000}}),
        lambda: grid({"F": {"from": 0, "to": 1, "count": 10**30}}),
        lambda: grid({f"a{k}": {"from": 0, "to": 1, "count": 20_000_000} for k in range(20)}),
        lambda: grid({"a": [1, 2], "b": {"from": 0, "to": 1, "count": MOST_NUMBERS // 4 + 1}}),
        lambda: continuation({"F": {"from": 0, "to": 1, "count": MOST_NUMBERS // 2 + 1}}),
        lambda: random({"F": {"uniform": [0, 1]}}, count=2**39),
        lambda: random({"F": {"uniform": [0, 1]}, "x": {"uniform": [0, 1]}}, count=MOST_NUMBERS, method="sobol"),
    ],
)
def test_points_beyond_measure_are_refused_before_they_are_made(make: Callable[[], object]) -> None:
    tracemalloc.start()
    try:
        with pytest.raises(ArgumentError, match=r"allowed|wanted a whole number"):
            make()
        assert tracemalloc.get_traced_memory()[1] < 2**29
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("kind", ["fifo", "device", "folder"])
def test_a_table_is_a_regular_file(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "points.csv"
    if kind == "fifo":
        os.mkfifo(path)
    elif kind == "device":
        path.symlink_to("/dev/zero")
    else:
        path.mkdir()
    with pytest.raises(ArgumentError, match="not a regular file"):
        table(path)


def test_a_table_of_too_many_rows_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a Parquet file by what it says of itself: of one number a billion times it has some kB."""
    pytest.importorskip("pyarrow")
    monkeypatch.setattr(table_files, "MOST_NUMBERS", 1000)
    frame = pd.DataFrame({"a": np.ones(501), "b": np.ones(501)})
    frame.to_parquet(tmp_path / "points.parquet")
    frame.to_csv(tmp_path / "points.csv", index=False)
    for name in ("points.parquet", "points.csv"):
        with pytest.raises(ArgumentError, match="501 points of 2 names; at most 500"):
            table(tmp_path / name)
        assert len(table_of(frame[:500], tmp_path / name).values) == 500


def table_of(frame: pd.DataFrame, path: Path) -> Points:
    if path.suffix == ".csv":
        frame.to_csv(path, index=False)
    else:
        frame.to_parquet(path)
    return table(path)


@pytest.mark.parametrize(
    "content",
    ["a,a\n1,2\n", "a\n" + "1" * 2_000_000, "", "a\n", "a,b\n1\n", "a\n1,2\n", "a\n\n", "a\nnan\n", "a\n1e999\n", "\0"],
)
def test_a_csv_file_that_is_no_table_is_refused(tmp_path: Path, content: str) -> None:
    (tmp_path / "points.csv").write_bytes(content.encode("latin-1"))
    with pytest.raises(ArgumentError):
        table(tmp_path / "points.csv")


@pytest.mark.parametrize(
    "given", [["1_0"], ["0.5", "1"], [0.5, "1"], np.array(["2"], dtype=object), pd.Series(["0.5"]), [b"1"]]
)
def test_text_is_no_number(given: object) -> None:
    # float("1_0") is 10; in a case file as in Python, a grid is a list of numbers.
    for read in (grid, table):
        with pytest.raises(ArgumentError, match="wanted a list or array of numbers"):
            read({"F": given})
    with pytest.raises(ArgumentError, match="wanted a list or array of numbers"):
        grid({"F": {"from": "1_0", "to": 20, "count": 2}})


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("a,b\n1,2\n3,x\n", "the column 'b' has 'x' in row 2; wanted numbers"),
        ("a,b\n1,\n", "the column 'b' has '' in row 1"),
        ("a;b\n1;2\n", "the column 'a;b' has '1;2' in row 1"),
        ("a\n+1\n1_0\n", "the column 'a' has '1_0' in row 2"),
    ],
)
def test_what_is_no_number_in_a_csv_file_has_its_place(tmp_path: Path, content: str, words: str) -> None:
    (tmp_path / "points.csv").write_text(content)
    with pytest.raises(ArgumentError, match=re.escape(words)):
        table(tmp_path / "points.csv")


def test_numbers_of_a_csv_file_are_read_to_the_last_bit(tmp_path: Path) -> None:
    words = [
        "2.2250738585072011e-308", "9007199254740993", "1.7976931348623157e308", "4.9406564584124654e-324", "-0.0",
        "0.500000000000000166533453693773481063544750213623046875", "8.5E-1", "123456789012345678901234567890",
    ]  # fmt: skip
    words += [repr(value) for value in np.random.default_rng(2).integers(0, 2**62, 500).view(np.float64).tolist()]
    for more in ([], ["+1.5"], [" 2.5"]):
        (tmp_path / "points.csv").write_text("\n".join(["a", *words, *more, ""]))
        found = table(tmp_path / "points.csv").values[:, 0]
        assert found.tobytes() == np.array([float(word) for word in [*words, *more]]).tobytes()


def test_a_parquet_files_index_is_none_of_its_columns(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    frame = pd.DataFrame({"a": [1, 2], "b": [0.5, 1.5]}, index=pd.Index(["one", "two"], name="run"))
    frame.to_parquet(tmp_path / "points.parquet")
    assert table(tmp_path / "points.parquet").values.tolist() == [[1, 0.5], [2, 1.5]]
    frame.assign(a=["x" * 10, "y"]).to_parquet(tmp_path / "points.parquet")
    with pytest.raises(ArgumentError, match="'a' holds"):
        table(tmp_path / "points.parquet")


@pytest.mark.parametrize("draw", [{"normal": [1e308, 1e308]}, {"normal": [0, 1.7e308]}, {"normal": [-1.7e308, 1e307]}])
def test_draws_that_are_not_finite_are_refused(draw: dict[str, list[float]]) -> None:
    with pytest.raises(ArgumentError, match=r"'x'.*not finite"):
        random({"x": draw}, count=1000)


@pytest.mark.parametrize("ends", [(-1.7976931348623157e308, 1.7976931348623157e308), (1, 1 + 2**-52), (5, 5)])
def test_uniform_draws_lie_in_their_range(ends: tuple[float, float]) -> None:
    for method in ("independent", "sobol"):
        values = random({"x": {"uniform": list(ends)}}, count=4096, method=method).values
        assert np.isfinite(values).all()
        assert ends[0] <= values.min() <= values.max() <= ends[1]


@pytest.mark.parametrize(
    "points",
    [
        Points(("F",), np.array([[np.nan]])),
        Points(("F",), np.array([[1.0, 2.0]])),
        Points(("F", "F"), np.array([[1.0, 2.0]])),
        Points(("F",), np.array([1.0])),
        Points(("F",), np.array([[1]])),
        Points(("F",), np.zeros((0, 1))),
        Points(("F",), np.zeros((3, 1)), chain=2),
        Points(("F",), np.zeros((3, 1)), labels={"direction": np.array(["up"])}),
    ],
)
def test_points_that_do_not_fit_together_are_refused(points: Points) -> None:
    with pytest.raises(ArgumentError):
        points_of(points)


def test_a_name_stands_once() -> None:
    for given in (grid, table):
        with pytest.raises(ArgumentError, match="'1' twice"):
            given({1: [1.0], "1": [2.0]})


def test_a_long_grid_beside_a_line_is_written_down() -> None:
    points = continuation({"F": [1, 2]}, {"x": np.linspace(0, 1, 5001)})
    assert len(points.written["continuation"]["grid"]["x"]) == 5001
