"""A point at which there is no problem to solve is a row that says so, whatever is observed and however it is cut."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sweep_systems import assert_same, oscillator, sliding_block

import henon_ref as hr
from henon_ref.errors import HenonRefError
from henon_ref.simulation.system import System

CASES = Path(__file__).parents[2] / "cases"


def powers() -> System:
    """A parameter in an exponent."""
    return System(["x"], {"p": 1}, {"s": "x - 1/2"}, ["-x*2^p*(2+s)"])


def statuses(system: System, initial: Any, grid: Any, **how: Any) -> list[list[str]]:
    """Status and message of each point; the same for every cut."""
    tables = []
    for chunk in (1, 3, 100):
        observed = [hr.observe.status(), hr.observe.final_state(), *how.get("observe", ())]
        given = {"until": 1, "jobs": 1, "chunk": chunk, "grid": grid, **how, "observe": observed}
        tables.append(hr.sweep(system, initial, **given))
        assert_same(tables[-1], tables[0])
    return tables[0][["status", "message"]].to_numpy().tolist()


def test_a_power_that_is_too_large_is_a_row(caplog: pytest.LogCaptureFixture) -> None:
    """It ended the sweep with neither point nor value."""
    found = statuses(powers(), {"x": 1}, {"p": [1, 2, 5000, 1]})
    assert [status for status, _ in found] == ["ok", "ok", "failed", "ok"]
    assert "exponent 5000 is too large" in found[2][1]
    assert caplog.records[0].getMessage().startswith("point 2 (p = 5000): in 'field': a power of 2 with exponent 5000")


def test_it_may_be_the_first_one_and_there_may_be_no_other() -> None:
    assert [status for status, _ in statuses(powers(), {"x": 1}, {"p": [5000, 1]})] == ["failed", "ok"]
    assert [status for status, _ in statuses(powers(), {"x": 1}, {"p": [5000, 6000]})] == ["failed", "failed"]


def test_horizons_at_or_before_the_start() -> None:
    found = statuses(sliding_block(), {"x": 0, "v": 1}, {"F": [1, 2, 4]}, until="2-F", start=0)
    assert [status for status, _ in found] == ["ok", "failed", "failed"]
    assert all("must be later than the start" in message for _, message in found[1:])
    found = statuses(sliding_block(), {"x": 0, "v": 1}, {"F": [1, 2, 4]}, until=3, start="F")
    assert [status for status, _ in found] == ["ok", "ok", "failed"]


def test_horizons_that_double_precision_does_not_tell_from_the_start() -> None:
    found = statuses(sliding_block(), {"x": 0, "v": 1}, {"F": [1, 1e-17]}, until="1+F", start=1)
    assert [status for status, _ in found] == ["ok", "failed"]
    assert found[1][1].startswith("the horizon 1 is not later than the start 1")


def test_numbers_that_are_not_finite() -> None:
    follows = System(["x", "v"], {"F": 1, "G": "1/F"}, {"s": "v"}, ["v", "-G*s"])
    found = statuses(follows, {"x": 0, "v": 1}, {"F": [1, 0, 2]})
    assert [status for status, _ in found] == ["ok", "failed", "ok"]
    assert "G" in found[1][1]
    found = statuses(follows, {"x": "1/(F-1)", "v": "sqrt(F-2)"}, {"F": [3, 1, 1.5]})
    assert [status for status, _ in found] == ["ok", "failed", "failed"]
    found = statuses(sliding_block(), {"x": 0, "v": 1}, {"F": [1, 3]}, until="1/(F-3)^2")
    assert [status for status, _ in found] == ["ok", "failed"]


def test_a_scene_does_not_allow_every_value() -> None:
    scene = System.from_case(CASES / "stribeck_belt.yaml")
    found = statuses(scene, {"x1": 1, "x2": 0}, {"m": [1, -1, 0, 2]})
    assert [status for status, _ in found] == ["ok", "failed", "failed", "ok"]
    for message in (found[1][1], found[2][1]):
        assert "larger than 0" in message


def test_a_start_beyond_a_stop_or_moving_into_it() -> None:
    """The sweep, and every simulation but the first of a system, let the body fall through the stop."""
    scene = hr.Scene({"gap": 0})
    body = scene.body("a", 1)
    scene.stop(body, scene.wall, gap="gap", restitution=0.8)
    scene.force(body, -10)
    system = scene.system()
    for name, values in {"x_a": [1, -1, 0], "gap": [0, 2, 0.5]}.items():
        found = statuses(system, {"x_a": 1, "v_a": 0}, {name: values})
        assert [status for status, _ in found] == ["ok", "failed", "ok"]
        assert "the start is beyond the stop g_a_wall" in found[1][1]
    for start, words in (((-1, 0), "beyond the stop"), ((0, -1), "moves into it")) * 2:
        with pytest.raises(HenonRefError, match=words):
            hr.simulate(system, start, until=1)
    count = hr.observe.function(lambda run: len(run.transitions), name="n")
    for speeds in ([-1, 1], [1, -1]):
        table = hr.sweep(system, {"x_a": 0, "v_a": 0}, until=1, grid={"v_a": speeds}, observe=[count], jobs=1)
        assert np.isnan(table["n"].to_numpy()).tolist() == [speed < 0 for speed in speeds]


def test_a_mode_that_the_start_contradicts() -> None:
    found = statuses(sliding_block(), {"x": 0, "v": "F-1"}, {"F": [1, 2]}, mode={"s": 1})
    assert [status for status, _ in found][1] == "ok"
    found = statuses(sliding_block(), {"x": 0, "v": 0}, {"v": [0, -1]}, mode={"s": 1})
    assert found[1] == ["invalid", "the start is off the surface of s: its mode is -1"]


def test_a_chain_starts_anew_behind_it() -> None:
    points = hr.points.continuation({"p": [1, 5000, 2]}, directions=["up"])
    table = hr.sweep(powers(), {"x": 1}, until=1, grid=points, observe=[hr.observe.final_state()], jobs=1)
    assert table["status"].tolist() == ["ok", "failed", "ok"]
    alone = hr.sweep(powers(), {"x": 1}, until=1, grid={"p": [2]}, observe=[hr.observe.final_state()], jobs=1)
    assert table["final_x"].tolist()[2] == alone["final_x"].tolist()[0]


def test_a_run_that_ends_at_its_start_is_observed_there() -> None:
    """The model does not hold at the second start; ``simulate`` returns such a run, too."""
    system = System(["x"], {"a": 1}, {"s": "x"}, ["-a*s"], valid=["a - x"])
    own = hr.observe.function(lambda run: {"how": run.status, "kept": len(run.t)})
    observed = [own, hr.observe.extremes("x"), hr.observe.final_state(), hr.observe.section("x"), hr.observe.sticks()]
    table = hr.sweep(system, {"x": 1}, until=3, grid={"a": [2, 0.5]}, observe=observed, jobs=1)
    columns = ["status", "how", "kept", "min_x", "max_x", "final_x", "stick_count"]
    assert table[columns].to_numpy().tolist()[1] == ["invalid", "invalid", 1, 1, 1, 1, 0]
    assert table["final_mode"].isna().tolist() == [False, True]
    assert set(table.frames["section"]["point"]) == {0}
    run = hr.simulate(system, {"x": 1}, until=3, parameters={"a": 0.5})
    assert (run.status, run.t.tolist(), run.y.tolist()) == ("invalid", [0], [[1]])


def test_nothing_is_observed_of_it() -> None:
    observed = [
        hr.observe.sticks(each=True), hr.observe.section("x"), hr.observe.extremes("v", name="v"),
        hr.observe.period("x"), hr.observe.lyapunov(1), hr.observe.function(lambda run: run.status, "how"),
        hr.observe.final_state(),
    ]  # fmt: skip
    how: dict[str, Any] = {"until": "2-F", "observe": observed, "jobs": 1}
    table = hr.sweep(sliding_block(), {"x": -0.25, "v": 1}, grid={"F": [3, 1, 2]}, **how)
    assert table["status"].tolist() == ["failed", "ok", "failed"]
    for bad in (0, 2):
        row = table.loc[bad]
        assert row["stick_count"] == 0
        assert row[["last_stick_duration", "period", "period_returns", "how", "final_mode"]].isna().all()
    assert table["how"].tolist()[1] == "ok"
    assert set(table.frames["section"]["point"]) == {1}
    none = hr.sweep(sliding_block(), {"x": -0.25, "v": 1}, grid={"F": [3, 2]}, **how)
    assert none["status"].tolist() == ["failed", "failed"]
    assert none.dtypes["how"] == np.float64


def test_what_no_point_can_mean_is_refused(tmp_path: Path) -> None:
    for change in ({"until": 0}, {"until": "0*F"}, {"start": 2}, {"mode": {"q": 1}}, {"initial": {"x": 0}}):
        given: dict[str, Any] = {"initial": {"x": 0, "v": 1}, "until": 1, **change}
        with pytest.raises(HenonRefError):
            hr.sweep(sliding_block(), given.pop("initial"), grid={"F": [1, 2]}, jobs=1, out=tmp_path / "out", **given)
        assert not (tmp_path / "out").exists()


def test_the_systems_own_values_need_not_be_meant() -> None:
    """The horizon is 0 at the system's own F = 1, which is no point of the sweep."""
    for values, wanted in (([2, 3], ["ok", "ok"]), ([0.5, 1, 2], ["failed", "failed", "ok"])):
        table = hr.sweep(sliding_block(), {"x": 0, "v": 1}, until="F-1", grid={"F": values}, jobs=1)
        assert table["status"].tolist() == wanted


def test_runs_beside_it_have_the_same_bits() -> None:
    how: dict[str, Any] = {"until": "w", "jobs": 1, "observe": [hr.observe.final_state()]}
    alone = hr.sweep(oscillator(), {"x": 1, "v": 0}, grid={"w": [1, 2]}, **how)
    both = hr.sweep(oscillator(), {"x": 1, "v": 0}, grid={"w": [1, -1, 2]}, **how)
    assert both.drop(index=1)[["final_x", "final_v"]].values.tolist() == alone[["final_x", "final_v"]].values.tolist()


@pytest.mark.parametrize(
    ("surfaces", "field", "points"),
    [
        ({}, "piecewise(-k*(x - 2), x > 0, abs(log(v - 5)))", [2.5, -0.2, 1.5, 2.0]),
        ({}, "piecewise(-k*(x - 2), x > 0, max(sqrt(v - 5), x) + abs(1/(x - 3)))", [2.5, -0.2, 3.0]),
        ({}, "piecewise(-k*x, x > 0, abs(sqrt(-2*x - 1) - v))", [0.5, -0.2, -0.6]),
        ({}, "piecewise(-k*(x - 2), x > 0, max(sqrt(x - 5/2), 1) + log(v))", [2.5, -0.2, 3.0]),
        ({"s": "1/x - k"}, "-k + 0*s", [1.5, 0.0, -0.5]),
    ],
)
def test_a_start_without_value_is_what_simulate_makes_of_it(
    surfaces: dict[str, str], field: str, points: list[float]
) -> None:
    system = hr.System(["x", "v"], {"k": 1}, surfaces, ["v", field])
    observed = [hr.observe.status(), hr.observe.final_state()]
    table = hr.sweep(system, {"x": 1, "v": 0.25}, until=1, grid={"x": points}, observe=observed, jobs=1)
    found = table[["status", "message", "final_x", "final_v"]].values.tolist()
    assert found == [by_itself(system, x) for x in points]


def by_itself(system: hr.System, x: float) -> list[object]:
    try:
        run = hr.simulate(system, {"x": x, "v": 0.25}, until=1)
    except hr.HenonRefError as error:
        return ["failed", str(error), x, 0.25]
    return [run.status, run.message, *run.y[:, -1].tolist()]
