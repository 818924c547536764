"""A contact that holds at the end of one point of a continuation holds at the start of the next one."""

from __future__ import annotations

import pytest

import henon_ref as hr


def test_a_contact_that_holds_goes_along_a_chain() -> None:
    """A ball at rest on a floor is off it by rounding, a block in a stick still moves by rounding."""
    scene = hr.Scene({"g": 1})
    ball = scene.body("a", 1)
    scene.stop(ball, scene.wall, gap=0, restitution=0.5)
    scene.force(ball, "-g")
    final = [hr.observe.final_state()]
    for height in (0.5, 0.77, 1, 1.3, 1.9):
        grid = hr.points.continuation({"g": [1, 2, 3]})
        table = hr.sweep(scene.system(), {"x_a": height, "v_a": 0}, until=20, observe=final, grid=grid, jobs=1)
        assert table["final_x_a"].tolist() == pytest.approx([0] * 6, abs=1e-12)
        assert set(table["final_mode"]) == {"g_a_wall=0"}

    scene = hr.Scene({"p": 0})
    block = scene.body("b", 1)
    scene.friction(block, scene.wall, law="coulomb", force=1, static=2)
    scene.spring(block, scene.wall, stiffness=1)
    scene.force(block, "p")
    grid = hr.points.continuation({"p": [0, 1, 2]}, directions=["up"])
    table = hr.sweep(scene.system(), {"x_b": 0.48, "v_b": -1.18}, until=40, observe=final, grid=grid, jobs=1)
    rest = table["final_x_b"].tolist()
    assert rest[1] == rest[0] == pytest.approx(-0.28949603, abs=1e-8)  # the load 1 - x is below 2
    assert rest[2] == pytest.approx(2 - rest[0], abs=1e-8)  # 2 - x is not: half a swing about x = 1


@pytest.mark.parametrize("carrier", [False, True])
def test_a_contact_that_no_doubles_are_on_goes_along_a_chain(carrier: bool) -> None:
    """A body rests at a gap of 1/7, on a wall or on a carrier with a spring, and on a table of prescribed velocity."""
    scene = hr.Scene({"g": 1})
    body, table = scene.body("a", 1), scene.prescribed("table", velocity="0.3*cos(t)")
    block = scene.body("b", 1)
    scene.friction(block, table, law="coulomb", force=1, static=2)
    below = scene.body("c", 2) if carrier else scene.wall
    if carrier:
        scene.spring(below, scene.wall, stiffness=20)
        scene.damper(below, scene.wall, coefficient=1)
    scene.stop(body, below, gap="1/7", restitution=0.5)
    scene.force(body, "-g")
    start = dict.fromkeys(scene.system().state, 0) | {"x_a": 1, "v_b": 0.3}
    observe = [
        hr.observe.final_state(), hr.observe.sticks(), hr.observe.section("x_a - 1/3"), hr.observe.extremes("x_a"),
        hr.observe.function(lambda run: {"x": run.y[0, -1], "changes": len(run.transitions)}, name="x"),
    ]  # fmt: skip
    grid = hr.points.continuation({"g": [1, 2, 3]})
    table = hr.sweep(scene.system(), start, until="8*pi", observe=observe, grid=grid, jobs=1)
    assert table["status"].tolist() == ["ok"] * 6
    assert all("=0 " in mode and mode.endswith("=0") for mode in table["final_mode"])
    assert table["x"].tolist() == pytest.approx(table["final_x_a"].tolist(), abs=1e-12)  # simulate repeats each run
    assert table["changes"].tolist()[1:] == [0] * 5
    assert set(table.frames["section"]["point"]) == {0}
    if not carrier:
        assert table["max_x_a"].tolist()[1:] == pytest.approx([1 / 7] * 5, abs=1e-14)


def test_a_contact_whose_surface_has_moved_does_not_hold_along_a_chain() -> None:
    belt = hr.System(["x", "v"], {"vb": 0.2}, {"s": "v - vb"}, ["v", "-x - s"])
    grid = hr.points.continuation({"vb": [0.2, 0.3]}, directions=["up"])
    first = hr.observe.function(lambda run: {"s": run.mode(0)["s"]}, name="s")
    table = hr.sweep(belt, {"x": 0, "v": 0.2}, until=0.5, observe=[first, hr.observe.final_state()], grid=grid, jobs=1)
    assert table["s"].tolist() == [0, -1]
    assert table["final_mode"].tolist() == ["s=0", "s=0"]
