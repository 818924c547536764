"""What a function of one's own returns: the same table however the points are cut, or one error with the point."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from sweep_systems import assert_same, sliding_block

import henon_ref as hr
from henon_ref.errors import HenonRefError
from henon_ref.simulation.solution import Solution
from henon_ref.simulation.system import System
from henon_ref.sweeps.work import Observation

F = [0.5, 1.0, 2.0, 4.0]


def swept(of: Callable[[Solution], Any], *more: Observation, name: str = "value", **how: Any) -> Any:
    observed = [hr.observe.function(of, name), *more]
    given: dict[str, Any] = {"until": 9, "grid": {"F": F}, "observe": observed, "jobs": 1, **how}
    return hr.sweep(sliding_block(), {"x": 0, "v": 1}, **given)


def by_point(values: list[Any]) -> Callable[[Solution], Any]:
    """A function that returns the value of each point of ``F``."""
    return lambda run: values[F.index(float(run.system.parameters["F"]))]


@pytest.mark.parametrize(
    ("values", "columns"),
    [
        ([1, 2.5, True, Fraction(1, 4)], {"value": [1, 2.5, 1, 0.25]}),
        ([np.float32(1), np.int8(2), np.array(3.0), np.bool_(False)], {"value": [1, 2, 3, 0]}),
        ([None, 2, None, 3], {"value": [np.nan, 2, np.nan, 3]}),
        ([None, "b", float("nan"), "d"], {"value": [None, "b", None, "d"]}),
        ([float("nan"), "b", None, "d"], {"value": [None, "b", None, "d"]}),
        ([None, None, None, None], {"value": [np.nan] * 4}),
        ([{"a": 1, "b": "x"}, {"b": "y"}, {}, None], {"a": [1, np.nan, np.nan, np.nan], "b": ["x", "y", None, None]}),
        ([{}, None, {"a": None, "b": 2}, {"a": "x"}], {"a": [None, None, None, "x"], "b": [np.nan, np.nan, 2, np.nan]}),
        ([{1: 1, "two": 2}, {"1": 3}, {}, {}], {"1": [1, 3, np.nan, np.nan], "two": [2, np.nan, np.nan, np.nan]}),
    ],
)  # fmt: skip
def test_the_table_is_the_same_however_it_is_cut(values: list[Any], columns: dict[str, Any], tmp_path: Path) -> None:
    whole = swept(by_point(values), chunk=4)
    assert list(whole.columns) == ["F", "status", *columns]
    pd.testing.assert_frame_equal(
        pd.DataFrame(whole[list(columns)]), pd.DataFrame(columns, index=whole.index), check_dtype=False
    )
    assert_same(swept(by_point(values), chunk=3), whole)
    for resume in (False, True):
        assert_same(swept(by_point(values), chunk=1, out=tmp_path, resume=resume), whole)
    read = pd.read_parquet(tmp_path / "points")
    assert read[list(columns)].equals(pd.DataFrame(whole)[list(columns)].reset_index(drop=True))


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ([1, "two", 3, 4], r"'two' at point 1 \(F = 1\); 'value' is a column of numbers"),
        (["one", 2, "three", 4], r"2.0 at point 1 \(F = 1\); 'value' is a column of text"),
        ([{"a": 1}, {"b": 1}, {"a": 1}, {}], r"a column 'b' at point 1 \(F = 1\); its columns are \['a'\]"),
        ([{"a": 1}, 2, 3, 4], r"a column 'value' at point 1 \(F = 1\)"),
        ([1, {"a": 1}, 3, 4], r"a column 'a' at point 1"),
        ([None, 1, [2], 3], r"\[2\] at point 2 \(F = 2\); wanted a number, text, None"),
        ([1, 2, 3, 1j], r"1j at point 3 \(F = 4\); wanted a number"),
        ([1, 10**400, 3, 4], r"at point 1 \(F = 1\); wanted a number"),
        ([1, np.array([1.0]), 3, 4], "at point 1"),
        ([1, np.ones((2, 1)), 3, 4], r"array\(\[\[1.\], \[1.\]\]\) at point 1"),  # on one line
        (["a", "\ud800", "c", "d"], "at point 1"),
        ([b"a", "b", "c", "d"], "at point 0"),
        ([{"a": {"b": 1}}, None, None, None], "at point 0"),
        ([{1: 1, "1": 2}, None, None, None], "at point 0.*keys that differ as text"),
        ([{"\ud800": 1}, None, None, None], "at point 0.*keys"),
    ],
)
@pytest.mark.parametrize("chunk", [1, 4])
def test_or_there_is_one_error_that_names_the_point(values: list[Any], words: str, chunk: int) -> None:
    with pytest.raises(HenonRefError, match=words):
        swept(by_point(values), chunk=chunk)


def test_what_a_function_raises_names_the_point() -> None:
    with pytest.raises(ZeroDivisionError) as caught:
        swept(lambda run: 1 / (run.system.parameters["F"] - 2))
    assert "at point 2 (F = 2)" in caught.value.__notes__[0]


class UnsentError(Exception):
    """Cannot be pickled."""

    def __init__(self) -> None:
        super().__init__("own words")
        self.later = lambda: None


def unsent(run: Solution) -> float:
    if run.system.parameters["F"] == 2:
        raise UnsentError
    return 1.0


def test_so_does_what_a_worker_cannot_send() -> None:
    with pytest.raises(HenonRefError, match="UnsentError in a worker: own words") as caught:
        swept(unsent, jobs=2, chunk=1, grid={"F": [1.0] * 100 + [2.0]})
    first, second = caught.value.__notes__
    assert first == "in the function 'value' of a sweep, at point 100 (F = 2)"
    assert "raise UnsentError" in second


@pytest.mark.parametrize("name", ["status", "point", "direction", "F", "final_x", "stick_count"])
def test_a_name_that_collides_is_refused_before_anything_runs(name: str, tmp_path: Path) -> None:
    def never(run: Solution) -> None:
        raise AssertionError("it has been called")

    with pytest.raises(HenonRefError, match=f"column '{name}'"):
        swept(never, hr.observe.final_state(), hr.observe.sticks(), name=name, out=tmp_path / "out")
    with pytest.raises(HenonRefError, match=f"column '{name}'"):
        swept(lambda run: {name: 1}, hr.observe.final_state(), hr.observe.sticks(), out=tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_two_functions_of_one_name() -> None:
    one, two = hr.observe.function(lambda run: 1), hr.observe.function(lambda run: {"b": 2})
    for pair in ([one, one], [hr.observe.function(lambda run: 1, "b"), two]):
        with pytest.raises(HenonRefError, match=r"column '(value|b)'"):
            hr.sweep(sliding_block(), {"x": 0, "v": 1}, until=9, grid={"F": F}, observe=pair, jobs=1)
    assert list(swept(lambda run: {"a": 1}, two).columns) == ["F", "status", "a", "b"]


def test_tables_and_their_columns_have_names_of_their_own() -> None:
    for observed in (
        [hr.observe.section("x"), hr.observe.section("v")],
        [hr.observe.section("x", name="points")],
        [hr.observe.section("x", name="figures")],
        [hr.observe.section("x", name="sticks"), hr.observe.sticks(each=True)],
    ):
        with pytest.raises(HenonRefError, match="the table"):
            hr.sweep(sliding_block(), {"x": 0, "v": 1}, until=9, grid={"F": F}, observe=observed, jobs=1)
    odd = System(["point", "v"], {"F": 1}, {"s": "v"}, ["v", "-F*s"])
    with pytest.raises(HenonRefError, match="column 'point'"):
        hr.sweep(odd, {"point": 0, "v": 1}, until=9, grid={"F": F}, observe=[hr.observe.section("point")], jobs=1)
    with pytest.raises(HenonRefError, match="column 'direction'"):
        swept(lambda run: 1, name="direction", grid=hr.points.continuation({"F": F}))
    with pytest.raises(HenonRefError, match="60 at most"):
        hr.observe.section("x", name="x" * 61)


def test_another_function_of_that_name_is_another_sweep(tmp_path: Path) -> None:
    """A resumption gave the values of the one before."""
    for factor, function in ((1, lambda run: 1 * run.t[-1]), (2, lambda run: 2 * run.t[-1])):
        if factor == 2:
            with pytest.raises(HenonRefError, match="a different sweep"):
                swept(function, out=tmp_path / "out", resume=True)
        for resume in (False, True):
            table = swept(function, out=tmp_path / "out", resume=resume)
            assert table["value"].tolist() == [9.0 * factor] * 4


def test_workers_give_the_same_table() -> None:
    values = [None, {"a": 1}, {"a": 2}, {}]
    assert_same(swept(by_point(values), chunk=1, jobs=2), swept(by_point(values)))
