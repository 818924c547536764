"""``explain`` and ``compare --check``: the contents of a case file, without a run."""

from __future__ import annotations

from pathlib import Path

import pytest
from commands import run
from problems import LEAVING_SLIDE

from henon_ref.casefile.case import load_case, parse_case
from henon_ref.harness.cli.explain_cases import explanation
from henon_ref.harness.cli.main import program

CASES = Path(__file__).parents[3] / "cases"
BELT = """
schema: 1
name: belt
title: A belt
scene:
  parameters: {m: 2, mu: 1/4}
  bodies: {block: {mass: m, states: [x1, x2]}, belt: {velocity: 1/2}, wall: fixed}
  connections:
    - spring: {between: [block, wall], stiffness: 3}
    - friction: {between: [block, belt], law: coulomb, force: mu}
initial: {x1: 0, x2: 0}
until: 5
readings:
  one: {}
  two: {until: 6}
"""


def test_a_system_is_explained_mode_by_mode():
    """By hand: x' = t - s slides with s = t on [-1, 1], and leaves at t = 1."""
    lines = [line.strip() for line in explanation(parse_case(LEAVING_SLIDE))]
    assert "from t = 0 to t = 3 s, start x = 0" in lines
    assert lines[lines.index("1 state: x") :] == [
        "1 state: x",
        "effects: none named, the system is written out",
        "1 surface:",
        "s = sign of x",
        "3 modes (-1 and +1: slip, 0: sliding)",
        "slip, s=-1",
        "x' = t + 1",
        "sliding, s=0",
        "x' = 0",
        "equivalent sign s = t",
        "released to s = +1 where 1 - t falls through 0",
        "released to s = -1 where t + 1 falls through 0",
        "slip, s=+1",
        "x' = t - 1",
    ]


def test_a_scene_is_explained_with_its_effects_and_readings_share_their_equations():
    lines = [line.strip() for line in explanation(parse_case(BELT))]
    assert lines[0] == "belt: A belt, 2 readings"
    assert lines.count("effects: spring (block, wall), friction (block, belt)") == 1
    assert "parameters: m = 2, mu = 1/4" in lines
    assert "x2' = (mu - 3*x1)/m" in lines
    assert "from t = 0 to t = 6 s, start x1 = 0, x2 = 0" in lines
    assert lines[-1] == "equations as in one"
    assert lines.count("solvers: the default solvers") == 2


def test_jumps_are_explained():
    ball = """
schema: 1
name: ball
title: A ball
system:
  state: [x, v]
  parameters: {r: 1/2}
  surfaces: {s: x, u: "x - 3"}
  field: [v, "-1"]
resets:
  s: {map: {v: "-r*v"}}
  u: {map: {x: 2, v: 0}, priority: 2}
initial: {x: 1, v: 0}
until: 5
readings:
  one: {}
  two: {resets: {s: {map: {v: "-v"}}}}
"""
    lines = [line.strip() for line in explanation(parse_case(ball))]
    at = lines.index("u = sign of x - 3")
    assert lines[at + 1] == "where the surface of s falls through 0, jump: v -> -r*v"
    assert lines[at + 2] == "where the surface of u falls through 0, jump: x -> 2, v -> 0 (priority 2)"
    assert "where the surface of s falls through 0, jump: v -> -v" in lines


def test_many_surfaces_are_explained_in_part():
    lines = [line.strip() for line in explanation(load_case(CASES / "classic" / "block_chain.yaml"))]
    assert "6561 modes (-1 and +1: slip, 0: sliding), 9 of them below" in lines
    assert len([line for line in lines if line.startswith(("slip,", "sliding,"))]) == 9
    assert "and 8 more" in lines


def test_a_mode_without_equations_says_why():
    text = LEAVING_SLIDE.replace("state: [x]", "state: [x, y]").replace('{s: "x"}', '{s: "x", u: "y"}')
    text = text.replace('["t - s"]', '["-s*u", "-s - u"]').replace("{x: 0}", "{x: 1, y: 1}")
    text = text.replace('exact: {transition_times: ["1"]}', "")
    lines = [line.strip() for line in explanation(parse_case(text))]
    at = lines.index("sliding, s=0 u=0")
    assert "'" not in lines[at + 1].split()[0]
    assert "s" in lines[at + 1]
    assert not lines[at + 1].startswith("x' =")


def test_equations_too_long_are_not_derived():
    terms = " + ".join(f"sin({k}*x)*s" for k in range(2, 200))
    text = LEAVING_SLIDE.replace("[x]", "[x, y, z]").replace("{x: 0}", "{x: 0, y: 0, z: 0}")
    text = text.replace('"t - s"', f'"t - s - ({terms})", "{terms}", "{terms}"')
    lines = [line.strip() for line in explanation(parse_case(text))]
    assert lines[-1] == "3 modes, whose equations are too long to be printed"


@pytest.mark.parametrize("words", [["explain", "own.yaml"], ["compare", "own.yaml", "--check"]])
def test_an_explanation_runs_nothing_and_writes_nothing(tmp_path, monkeypatch, capsys, words):
    monkeypatch.chdir(tmp_path)
    Path("own.yaml").write_text(LEAVING_SLIDE)
    assert program(words) == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    assert captured.out.startswith("leaving_slide: Leaving a slide (own.yaml), 1 reading\n  reading default: ")
    assert [path.name for path in tmp_path.iterdir()] == ["own.yaml"]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [("until: 3", "until: soon", "own.yaml:9:8"), ("state: [x]", "state: x", "own.yaml:"), ("until: 3", "", "until")],
)
def test_check_of_a_bad_file_is_one_message(tmp_path, monkeypatch, capsys, old, new, words):
    monkeypatch.chdir(tmp_path)
    Path("own.yaml").write_text(LEAVING_SLIDE.lstrip().replace(old, new))
    assert run("own.yaml", "--check") == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert words in captured.err


@pytest.mark.parametrize("option", [["--json"], ["--gate"], ["--require", "henon"]])
def test_check_is_refused_with_an_option_that_needs_results(tmp_path, capsys, option):
    (tmp_path / "own.yaml").write_text(LEAVING_SLIDE)
    assert run(tmp_path / "own.yaml", "--check", *option) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert f"--check: it runs no solver and has no result for {option[0]} " in captured.err


def test_a_strangers_title_is_text_in_one_line(tmp_path, capsys):
    text = LEAVING_SLIDE.replace("title: Leaving a slide", "title: '[red]hot[/red] \u202e\u2066'")
    (tmp_path / "own.yaml").write_text(text, encoding="utf-8")
    assert run(tmp_path / "own.yaml", "--check") == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("leaving_slide: [red]hot[/red] (")
    assert all(line.isprintable() for line in lines)
