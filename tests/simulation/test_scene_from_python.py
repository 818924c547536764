"""A scene from Python: the system of the same scene in a case file, and errors that name the declaration."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from pathlib import Path

import matplotlib.pyplot as plt
import pytest
import sympy as sp
from PIL import Image

import henon_ref as hr
from henon_ref.casefile.case import reading_sources
from henon_ref.casefile.files import read_yaml
from henon_ref.system import scene as scene_module
from henon_ref.system.connections import KINDS
from henon_ref.system.source import Source
from henon_ref.system.tree import child, to_python

CASES = Path(__file__).parents[2] / "cases" / "scenes"
SCENES = sorted(path for path in CASES.glob("*.yaml") if "scene:\n" in path.read_text())


def rebuilt(written: dict) -> hr.Scene:
    """The scene that a case file writes, declared by calls."""
    scene = hr.Scene(written.get("parameters"))
    for name, body in written["bodies"].items():
        keys = {"fixed": 0} if body == "fixed" else dict(body)
        if "mass" in keys:
            scene.body(name, **keys)
        elif "inertia" in keys:
            scene.rotor(name, **keys)
        elif "fixed" in keys:
            scene.fixed(name, keys["fixed"])
        else:
            scene.prescribed(name, **keys)
    for connection in written["connections"]:
        ((kind, keys),) = connection.items()
        ends = [keys["on"]] if "on" in keys else keys["between"]
        getattr(scene, kind)(*ends, **{key: value for key, value in keys.items() if key not in ("on", "between")})
    return scene


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_every_shipped_scene_declared_by_calls_is_the_system_of_its_file(path: Path) -> None:
    sources = reading_sources(Source(read_yaml(path)))
    reading, scene = next((name, found) for name, source in sources.items() if (found := child(source.tree, ["scene"])))
    written = to_python(scene)
    if path.stem != "burridge_knopoff":  # 64 blocks of one kind, see three of them
        assert rebuilt(written).system() == hr.System.from_case(path, reading)
    else:
        few = ["b1", "b2", "b3", "plate", "floor"]
        kept = [c for c in written["connections"] if all(b in few for v in c.values() for b in v["between"])]
        assert len(kept) == 8
        some = {**written, "bodies": {n: b for n, b in written["bodies"].items() if n in few}, "connections": kept}
        assert rebuilt(some).system().state == tuple(f"{x}_b{k}" for k in (1, 2, 3) for x in "xv")


def test_every_connection_of_a_file_has_a_method_with_the_same_keys() -> None:
    for name, kind in KINDS.items():
        parameters = inspect.signature(getattr(hr.Scene, name)).parameters
        ends = {"self", "body"} if kind.on else {"self", "p", "q"}
        assert set(parameters) - ends == {*(key.name for key in kind.keys), "name"}, name
        for key in kind.keys:
            assert (parameters[key.name].default is inspect.Parameter.empty) == (not key.optional), (name, key.name)


def test_a_block_on_a_belt_sticks_until_the_spring_pulls_with_its_static_friction() -> None:
    """It rides with the belt from x = 0: k vb t = static at t = 1.4 / 0.2 = 7."""
    scene = hr.Scene(parameters={"k": 1, "vb": 0.2})
    block = scene.body("block", mass=1)
    belt = scene.prescribed("belt", velocity=sp.Symbol("vb"))
    scene.spring(block, scene.wall, stiffness="k")
    scene.friction(block, belt, law="coulomb", force=1, static=1.4, name="s")
    assert block.states == ("x_block", "v_block")
    run = hr.simulate(scene.system(), {"x_block": 0, "v_block": 0.2}, until=8)
    assert list(run.transitions["kind"]) == ["release"]
    assert run.transitions["time_s"][0] == pytest.approx(7, rel=1e-15)


def test_a_scene_may_grow_after_its_system_was_taken() -> None:
    scene = hr.Scene()
    block = scene.body("block", mass=2, states=("x", "v"))
    free = scene.system()
    scene.spring(block, scene.wall, stiffness=8)
    scene.spring(block, scene.wall, stiffness=8)
    assert scene.system() != free
    end = hr.simulate(scene.system(), {"x": 1, "v": 0}, until=3)
    assert end.y[0, -1] == pytest.approx(float(sp.cos(sp.sqrt(8) * 3)), abs=1e-9)


WRONG: dict[str, tuple[Callable[[hr.Scene], object], str]] = {
    "word": (
        lambda s: s.friction("a", "belt", law="coulomp", force=1),
        r"friction between 'a' and 'belt': .*'coulomb'",
    ),
    "range": (lambda s: s.friction("a", "belt", law="coulomb", force=-1), r"between 'a' and 'belt': 'force' \[N\]"),
    "name": (lambda s: s.spring("b", "belt", stiffness=1), r"spring between 'b' and 'belt': unknown body 'b'"),
    "expression": (lambda s: s.damper("a", "wall", coefficient="k*q"), r"damper between 'a' and 'wall': .*name 'q'"),
    "missing": (lambda s: s.spring("a", "wall"), r"spring between 'a' and 'wall': a spring requires 'stiffness'"),
    "on": (lambda s: s.force("belt", 1), r"force on 'belt': a force acts on a mass"),
    "mass": (lambda s: s.body("c", mass=0), r"body 'c': 'mass' \[kg\] of 'c' must be larger than 0"),
    "motion": (lambda s: s.prescribed("c"), r"body 'c': 'c' has no key that defines the body"),
    "twice": (lambda s: s.body("a", mass=1), r"a body 'a' exists already"),
    "states": (lambda s: s.body("c", mass=1, states=["x"]), r"'states' of 'c' must be two names"),
    "no number": (lambda s: s.damper("a", "wall", coefficient=float("nan")), r"'coefficient' of .* must be finite"),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_what_cannot_be_meant_names_the_declaration(wrong: str) -> None:
    scene = hr.Scene(parameters={"k": 1})
    scene.body("a", mass="k")
    scene.prescribed("belt", velocity=1)
    assert scene.wall == scene.wall
    declare, message = WRONG[wrong]

    def system() -> hr.System:
        declare(scene)
        return scene.system()

    with pytest.raises(hr.ArgumentError, match=message):
        system()


def test_a_scene_without_a_free_body_or_with_other_parameters_is_refused() -> None:
    scene = hr.Scene()
    with pytest.raises(hr.ArgumentError, match="'bodies' in 'scene': must have at least one entry"):
        scene.system()
    assert scene.wall.name == "wall"
    with pytest.raises(hr.ArgumentError, match="no body moves freely"):
        scene.system()
    with pytest.raises(hr.ArgumentError, match="'parameters' must be a mapping"):
        hr.Scene(parameters=[1])  # type: ignore[arg-type]


def belt_scene() -> hr.Scene:
    scene = hr.Scene(parameters={"vb": 0.2})
    block, disc, belt = scene.body("block", 1), scene.rotor("disc", 1), scene.prescribed("belt", velocity="vb")
    scene.spring(block, scene.wall, stiffness=1)
    scene.friction(block, belt, law="coulomb", force=1, name="rub")
    scene.torque(disc, "cos(t)")
    return scene


def test_a_scene_is_drawn_and_moves(tmp_path: Path) -> None:
    scene = belt_scene()
    axes = scene.plot(facecolor="gold")
    assert {"block", "friction rub"} <= {text.get_text() for text in axes.texts}
    system = scene.system()
    run = hr.simulate(system, dict.fromkeys(system.state, 0), until=10)
    moving = scene.animate(run, times=[0, 5, 10])
    moving.save(tmp_path / "belt.gif")
    with Image.open(tmp_path / "belt.gif") as picture:
        assert picture.n_frames == 3
    assert moving._fig.axes[0].get_title(loc="left") == "t = 10.00 s   rub: slip"
    assert "<script" in moving._repr_html_()
    plt.close("all")


def test_what_cannot_be_drawn_is_said() -> None:
    scene, other = belt_scene(), hr.System(["x"], {}, {}, ["1"])
    with pytest.raises(hr.HenonRefError, match="the run has the states x; wanted a run of this scene's system"):
        scene.animate(hr.simulate(other, {"x": 0}, until=1))
    system = scene.system()
    with pytest.raises(hr.HenonRefError, match="dense_output=True"):
        scene.animate(hr.simulate(system, dict.fromkeys(system.state, 0), until=1, dense_output=False))
    for k in range(12):
        scene.body(f"b{k}", mass=1)
    with pytest.raises(hr.HenonRefError, match="16 bodies; a picture shows at most 12"):
        scene.plot()


def test_the_scene_of_a_case_is_built_once(monkeypatch: pytest.MonkeyPatch) -> None:
    built, build = list[Source](), scene_module.build_scene
    monkeypatch.setattr(scene_module, "build_scene", lambda source: built.append(source) or build(source))
    hr.load_case(SCENES[0])
    alone = len(built)
    hr.System.from_case(SCENES[0])
    assert len(built) == 2 * alone > 0
