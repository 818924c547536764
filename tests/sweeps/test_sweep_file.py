"""The sweep file: what it says, and where it is wrong."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from sweep_systems import SWEEP, assert_same, belt, collected

from henon_ref.errors import CaseError
from henon_ref.sweeps import observe, sweep_file
from henon_ref.sweeps.sweep import sweep
from henon_ref.sweeps.sweep_file import load_sweep


def written(folder: Path, text: str) -> Path:
    path = folder / "belts.yaml"
    path.write_text(text)
    return path


def test_a_file_says_what_arguments_say(tmp_path: Path) -> None:
    plan = load_sweep(written(tmp_path, SWEEP))
    assert (plan.name, plan.source) == ("belts", "my notebook")
    assert plan.chunk == 4
    assert [len(chunk) for chunk in plan.chunks] == [4, 4, 4, 3]
    table = sweep(
        belt(),
        {"x": 1.5, "v": 0},
        until=50,
        grid={"vb": {"from": 0.05, "to": 1, "count": 5}, "x": [-1, 0, 1.5]},
        observe=[observe.sticks(after=20), observe.final_state(), observe.section("x", after=20, direction="rising")],
        rtol=1e-9,
        jobs=1,
    )
    assert_same(collected(plan), table)


def test_its_system_is_built_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    built, build = [], sweep_file.build_problem
    monkeypatch.setattr(sweep_file, "build_problem", lambda source: built.append(build(source)) or built[0])
    assert load_sweep(written(tmp_path, SWEEP)).work.system.model is built[0].system


POINTS = SWEEP[SWEEP.index("points:") : SWEEP.index("observe:")]


@pytest.mark.parametrize(
    ("points", "count"),
    [
        ("points: {random: {draws: {vb: {uniform: [0.1, 1]}, x: {normal: [0, 1]}}, count: 8, seed: 3}}\n", 8),
        ("points: {random: {draws: {vb: {uniform: [0.1, 1]}}, count: 8, method: sobol}}\n", 8),
        ("points: {continuation: {along: {vb: {from: 0.1, to: 1, count: 4}}, grid: {x: [0, 1]}}}\n", 16),
        ("points: {continuation: {along: {vb: [0.1, 0.2]}, directions: [up]}}\n", 2),
        ("points: {table: some.csv}\n", 2),
    ],
)
def test_points_may_be_drawn_continued_or_read(tmp_path: Path, points: str, count: int) -> None:
    (tmp_path / "some.csv").write_text("vb,x\n0.1,0\n0.2,1\n")
    plan = load_sweep(written(tmp_path, SWEEP.replace(POINTS, points)))
    assert len(plan.points) == count
    assert len(collected(plan)) == count


def test_a_scene_may_stand_in_place_of_a_system(tmp_path: Path) -> None:
    """That of the shipped case, whose belt has the speed vp and whose states are x1 and x2."""
    case = (Path(__file__).parents[2] / "cases" / "stribeck_belt.yaml").read_text()
    scene = case[case.index("scene:") : case.index("initial:")]
    text = SWEEP[: SWEEP.index("system:")] + scene + SWEEP[SWEEP.index("initial:") :]
    for old, new in (("x: 1.5, v: 0", "x1: 1.5, x2: 0"), ("vb:", "vp:"), (" x:", " x1:"), ("of: x", "of: x1")):
        text = text.replace(old, new)
    table = collected(load_sweep(written(tmp_path, text)))
    written_out = collected(load_sweep(written(tmp_path, SWEEP)))
    assert table["final_x1"].to_numpy() == pytest.approx(written_out["final_x"].to_numpy(), abs=1e-6)


@pytest.mark.parametrize(
    ("old", "new", "line", "column", "words"),
    [
        ("schema: 1", "schema: 2", 1, 9, "must be 1"),
        ("chunk: 4", "chunks: 4", 20, 1, "did you mean 'chunk'"),
        ("chunk: 4", "chunk: 0", 20, 8, "whole number"),
        ("rtol: 1e-9", "rtol: 0", 19, 7, "tolerance"),
        ("until: 50", "until: -1", 11, 8, "later than the start"),
        ("until: 50", "until: soon", 11, 8, "soon"),
        ("v: 0}", "w: 0}", 10, 25, "'w' is not a state"),
        ("    vb: {from", "    speed: {from", 14, 5, "'speed' is neither a parameter nor a state"),
        ("[-1, 0, 1.5]", "[-1, .nan]", 15, 13, "nan is not a finite number"),
        ("[-1, 0, 1.5]", "[]", 15, 8, "empty"),
        ("count: 5", "count: 5.5", 14, 9, "whole number"),
        ("  grid:", "  grit:", 13, 3, "did you mean 'grid'"),
        ("- sticks:", "- stick:", 17, 5, "did you mean 'sticks'"),
        ("{after: 20}", "{since: 20}", 17, 14, "unknown key 'since'"),
        (
            "sticks: {after: 20}",
            "final_state: {after: 20}",
            17,
            19,
            "unknown key 'after' in 'final_state'; it has no keys",
        ),
        ("sticks: {after: 20}", "sticks: {after: late}", 17, 5, "finite number"),
        ("sticks: {after: 20}", "sticks: {after: 50}", 17, 21, "earlier than the horizon"),
        ("of: x, after", "of: q, after", 19, 5, "q"),
        ("final_state: {}", "sticks: {}", 18, 5, "two results have the column 'stick_count'"),
        ("final_state: {}", "section: {of: v}", 19, 5, "two results have the table 'section'"),
        ("v - vb", "v - v0", 8, 22, "v0"),
        (
            POINTS,
            "points:\n  continuation:\n    along: {vb: [1]}\n    grid: {x: &m {from: 0, to: 1, count: 9999}, v: *m}\n",
            15,
            11,
            "'grid' has 99980001 points of 2 names",
        ),
        (POINTS, "points:\n  continuation:\n    along: {vb: []}\n", 14, 17, "'vb' of 'along' is empty"),
    ],
)
def test_an_error_has_its_place(tmp_path: Path, old: str, new: str, line: int, column: int, words: str) -> None:
    shift = 1 if line == 20 or (line, column) == (19, 7) else 0  # the section's line comes before
    path = written(tmp_path, SWEEP.replace(old, new, 1))
    with pytest.raises(CaseError) as caught:
        load_sweep(path)
    message = str(caught.value)
    assert message.startswith(f"{path}:{line + shift}:{column}: "), message
    assert words in message


@pytest.mark.parametrize("text", ["", "schema: 1\n", "- 1\n", SWEEP.replace("system:", "scene:"), "{"])
def test_what_is_no_sweep_file_is_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(CaseError, match=r"belts\.yaml"):
        load_sweep(written(tmp_path, text))


PAGE = Path(__file__).parents[2] / "docs" / "sweep.md"


def test_the_file_that_the_page_shows_is_read(tmp_path: Path) -> None:
    (shown,) = re.findall(r"```yaml\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    path = tmp_path / "belts.yaml"
    path.write_text(shown)
    plan = load_sweep(path)
    assert (len(plan.points), plan.chunk) == (40_000, 1000)


def test_a_folder_in_place_of_the_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(CaseError, match=r"this is a folder; give a sweep file \(YAML\)"):
        load_sweep(tmp_path)
    with pytest.raises(CaseError, match="the file is empty; a sweep file is a mapping"):
        load_sweep(written(tmp_path, ""))
