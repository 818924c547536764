"""Short chunks go together in one task: what comes out is each chunk's own."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import henon_ref as hr
from henon_ref.sweeps import sweep as sweeps
from henon_ref.sweeps.chunk import execute
from henon_ref.sweeps.plan import planned

BELT = hr.System(
    ["x", "v"], {"F": 1, "vb": 0.2, "c": "F/10"}, {"s": "v - vb"}, ["v", "-x - c*v - F*s/(1 + 3*s*(v - vb))"]
)


def plan(chunk: int, count: int = 23) -> Any:
    grid = {"F": [0.5, *np.linspace(0.3, 2, count - 2), float(10**300)]}
    observed = [hr.observe.sticks(after=1, each=True), hr.observe.section("x"), hr.observe.final_state()]
    return planned(BELT, {"x": 1, "v": 0}, until=15, grid=grid, observe=observed, chunk=chunk)


def told(found: Any) -> list[Any]:
    parts = [found.points, *found.ragged.values()]
    return [found.refused, *([(k, list(map(repr, column.tolist()))) for k, column in part.items()] for part in parts)]


def test_chunks_done_together_are_those_done_one_by_one() -> None:
    whole = plan(5)
    pickled = whole.work.pickled()
    together, _ = execute(pickled, 0, whole.points.values, 5)
    alone = [execute(*whole.task([number], pickled)[1])[0][0] for number in range(len(whole.chunks))]
    assert [told(one) for one in together] == [told(one) for one in alone]
    assert [len(one.points["status"]) for one in together] == [5, 5, 5, 5, 3]


def test_tasks_grow_while_they_are_short_and_follow_gaps() -> None:
    size = 1
    groups = sweeps._groups([0, 1, 2, 5, 6, 7, 8, 9, 10, 11], lambda: size)
    assert next(groups) == [0]
    size = sweeps._group_size(1, 1e-4, most=6)
    assert next(groups) == [1, 2]
    assert next(groups) == [5, 6, 7, 8, 9, 10]
    size = sweeps._group_size(6, 10.0, most=6)
    assert list(groups) == [[11]]


@pytest.mark.parametrize("chunk", [1, 4])
def test_a_sweep_is_the_same_whatever_its_tasks(chunk: int, monkeypatch: pytest.MonkeyPatch, tmp_path: Any) -> None:
    def done(folder: str) -> Any:
        table = hr.sweep(
            BELT, {"x": 1, "v": 0}, until=15, grid={"F": np.linspace(0.3, 2, 19)}, chunk=chunk, jobs=1,
            observe=[hr.observe.sticks(each=True)], out=tmp_path / folder,
        )  # fmt: skip
        files = sorted((tmp_path / folder).rglob("*.parquet"))
        return table.to_numpy().tolist(), [(f.name, f.read_bytes()) for f in files]

    grown = done("grown")
    monkeypatch.setattr(sweeps, "TASK_SECONDS", 0.0)
    assert done("single") == grown
