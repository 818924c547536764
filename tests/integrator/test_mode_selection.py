"""Transitions of several surfaces: the compiled decision is the Python one, and stands back where it is not clear."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from often import daily
from problems import read_problem

import henon_ref as hr
from henon_ref.baselines.henon import HENON_SOLVER
from henon_ref.casefile.case import load_case
from henon_ref.integrator import mode_changes
from henon_ref.integrator.integrator import Integrator
from henon_ref.integrator.run import Run
from henon_ref.modes.mode import Mode
from henon_ref.modes.problem import Problem
from henon_ref.trajectory import Decisions, Trajectory

CASES = Path(__file__).parents[2] / "cases"


def runs(problem: Problem, monkeypatch: pytest.MonkeyPatch) -> tuple[Trajectory, Trajectory, int]:
    """A run decided in machine code and one decided in Python, and how often the first asked Python."""
    asked = 0
    plain = mode_changes.select_mode

    def counted(run: Run) -> object:
        nonlocal asked
        asked += 1
        return plain(run)

    def run(integrator: Integrator) -> Trajectory:
        return Run(integrator, integrator.start(problem, tolerance=1e-15)).to_horizon()

    integrator = Integrator(problem.system, 18)
    run(integrator)  # modes are compiled on first sight
    with monkeypatch.context() as patch:
        patch.setattr(mode_changes, "select_mode", counted)
        ours = run(integrator)
    return ours, run(slow_integrator(problem)), asked


def slow_integrator(problem: Problem) -> Integrator:
    """An integrator whose every event of several surfaces is decided in Python."""
    system = replace(problem.system)
    vars(system)["switched"] = None  # else contacts that do not act on each other are decided each by itself
    integrator = Integrator(system, 18)
    vars(integrator.mode_table)["normals"] = None
    return integrator


def same_transitions(ours: Trajectory, theirs: Trajectory) -> None:
    assert ours.status == theirs.status
    assert [(t.kind, t.surface, t.from_mode, t.to_mode) for t in ours.transitions] == [
        (t.kind, t.surface, t.from_mode, t.to_mode) for t in theirs.transitions
    ]
    for t, u in zip(ours.transitions, theirs.transitions, strict=True):
        assert t.time == pytest.approx(u.time, rel=1e-13)


@pytest.mark.parametrize(
    ("path", "reading"),
    [
        ("two_blocks.yaml", "default"),
        ("classic/three_blocks.yaml", "default"),
        ("hard/simultaneous_events.yaml", None),
        ("hard/two_contacts.yaml", None),
    ],
)
def test_clear_decisions_are_those_of_python(path: str, reading: str | None, monkeypatch: pytest.MonkeyPatch) -> None:
    case = load_case(CASES / path)
    for each in case.readings if reading is None else [case.reading(reading)]:
        ours, theirs, asked = runs(each.problem, monkeypatch)
        same_transitions(ours, theirs)
        assert asked == 0, each.name


def problem(field: str, start: str = "{x: -1, y: -1}") -> Problem:
    text = f"""
system: {{state: [x, y], surfaces: {{s: x, u: y}}, field: {field}}}
initial: {start}
until: 3
"""
    return read_problem(text)


@pytest.mark.parametrize(
    ("field", "clear"),
    [
        ('["1.5 - s - 0.25*u", "1.5 - u + 0.25*s"]', True),  # coupled
        ('["0.5 - s", "0.5 - u"]', True),  # both held
        ('["1 - s*u/2", "1 - s*u/2"]', False),  # signs that multiply each other
        ('["1 + s*(1 + u)/8", "1"]', True),  # they do, but no sign is in the speed of u, which is crossed
        ('["1 - s", "0.5 - u"]', False),  # an equivalent sign of exactly one
    ],
)
def test_what_is_not_clear_is_left_to_python(field: str, clear: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    ours, theirs, asked = runs(problem(field), monkeypatch)
    assert (asked == 0) == clear
    assert [(t.kind, t.to_mode) for t in ours.transitions] == [(t.kind, t.to_mode) for t in theirs.transitions]
    assert ours.status == theirs.status


def decoupled_problem(seed: int, surfaces: int, *, shared: bool = False, until: float = 2) -> Problem:
    """Straight arrivals at x_i = 0 from both sides, at t = 1/2, 1 or 3/2, that go through or stay there.

    ``shared``: the signs also drive a state of their own, so the modes share no machine code.
    """
    random = np.random.default_rng(seed)
    field, start = [], []
    for i in range(surfaces):
        side, here, time = random.choice([-1, 1]), random.integers(1, 9), random.choice([1, 2, 2, 3])
        beyond = random.choice([-1, 1]) * random.integers(1, 9)
        below, above = (here, beyond) if side < 0 else (-beyond, -here)
        field.append(f"({below + above} + ({above - below})*s{i})/2")
        start.append(f"x{i}: {side * here * time}/2")
    names = [f"x{i}" for i in range(surfaces)]
    if shared:
        names.append("z")
        field.append("+".join(f"s{i}" for i in range(surfaces)))
        start.append("z: 0")
    return straight(names, field, start, surfaces, until)


def straight(names: Sequence[str], field: Sequence[str], start: Sequence[str], surfaces: int, until: float) -> Problem:
    quoted = ", ".join(f'"{f}"' for f in field)
    text = f"""
system:
  state: [{", ".join(names)}]
  surfaces: {{{", ".join(f"s{i}: x{i}" for i in range(surfaces))}}}
  field: [{quoted}]
initial: {{{", ".join(start)}}}
until: {until}
"""
    return read_problem(text)


@pytest.mark.parametrize("shared", [False, True])
@pytest.mark.parametrize("surfaces", [2, 3, 4, 5, 6])
@pytest.mark.parametrize("seed", daily([0, 1], some=[0]))
def test_decoupled_surfaces_are_decided_without_python(
    seed: int, surfaces: int, shared: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem = decoupled_problem(10 * surfaces + seed, surfaces, shared=shared)
    ours, theirs, asked = runs(problem, monkeypatch)
    assert asked == 0
    assert len(ours.transitions) == surfaces
    same_transitions(ours, theirs)


@pytest.mark.parametrize("seed", daily([1, 2, 4], some=[1]))
def test_equal_blocks_stick_and_slip_together(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Forced blocks, some of them equal: they meet their surfaces together, again and again, while others slide."""
    random = np.random.default_rng(seed)
    kinds = [(random.integers(5, 9), random.integers(2, 8), random.integers(1, 5)) for _ in range(2)]
    blocks = [kinds[k] for k in (0, 1, 0, 1, 0)]
    field = [f"{force}*cos(t)/4 - {friction}*s{i}/8" for i, (force, friction, _) in enumerate(blocks)]
    start = [f"x{i}: -{at}/4" for i, (_, _, at) in enumerate(blocks)]
    ours, theirs, asked = runs(straight([f"x{i}" for i in range(5)], field, start, 5, 12), monkeypatch)
    same_transitions(ours, theirs)
    let_go = {round(t.time, 9) for t in ours.transitions if t.kind == "release"}
    assert len(let_go) > 0  # several at once
    assert asked == 0


@pytest.mark.parametrize(
    ("change", "clear"),
    [
        ({}, True),
        ({4: ("1/2 - s4/2", "x4: -1")}, True),  # it stays with nothing that holds it from above
        ({4: ("1/2 - s4/2 - 10^(-10)", "x4: -1 + 10^(-10)")}, False),  # or hardly anything
        ({0: ("t/2 - s0/2 - 10^(-9)", "x0: 0")}, True),  # it slides, and is about to be let go: no affair of the others
        ({0: ("1 + s0/2 + (s1 + s2 + s3 + s4 + 4)/8", "x0: -1/2")}, False),  # five that act on each other
    ],
)
def test_five_surfaces_that_are_not_clear_are_left_to_python(
    change: dict[int, tuple[str, str]], clear: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    field, start = ["3/2 + s{0}/2"] * 4 + ["1/4 - 3*s{0}/4"], ["x{0}: -1"] * 5
    field, start = ([line.format(i) for i, line in enumerate(lines)] for lines in (field, start))
    for i, lines in change.items():
        field[i], start[i] = lines
    ours, theirs, asked = runs(straight([f"x{i}" for i in range(5)], field, start, 5, 2), monkeypatch)
    assert (asked == 0) == clear
    same_transitions(ours, theirs)


def after_first_event(integrator: Integrator, problem: Problem, transitions: int) -> tuple[Mode, list[int]]:
    """Mode and known zeros right after an event with so many transitions."""
    run = Run(integrator, integrator.start(problem, tolerance=1e-15), block=transitions)
    while not run.blocks and run.scalars.transitions < transitions:
        assert run._advance() is None
    places = integrator.mode_table.places(run.mode)
    zeros = sorted(pair for pair in zip(places, run.known_zeros.tolist(), strict=False) if pair[0] >= 0)
    return run.mode, [zero for _, zero in zeros]


@pytest.mark.parametrize("name", ["five", "three", "coupled", "stick_and_cross", "duplicate"])
def test_surfaces_just_left_are_known_to_be_at_zero(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    problem = load_case(CASES / "hard" / "simultaneous_events.yaml").reading(name).problem
    integrator, count = Integrator(problem.system, 18), len(problem.system.surfaces)
    expected = after_first_event(slow_integrator(problem), problem, count)
    assert after_first_event(integrator, problem, count) == expected
    monkeypatch.delattr(mode_changes, "select_mode")  # all modes are compiled now
    assert after_first_event(integrator, problem, count) == expected


@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-15])
def test_ever_shorter_slides_end_with_a_word(rtol: float) -> None:
    """Transitions that accumulate at (A + B)/(1 - q): told up to where doubles end, never an endless loop."""
    case = load_case(CASES / "hard" / "shrinking_slides.yaml")
    problem = replace(case.readings[0].problem, until=sp.Integer(4))
    run = HENON_SOLVER.prepare(problem, rtol=rtol, deadline=20)()
    assert run.status == "failed"
    assert "accumulate" in run.reason
    assert run.end_time == pytest.approx(3.2320508075688776, rel=1e-13)
    cycle = [(1, -1, 1), (1, -1, 0), (-1, -1, -1), (-1, -1, -1), (-1, 1, -1), (-1, 1, 0), (1, 1, 1), (1, 1, 1)]
    assert [t.to_mode for t in run.transitions[:96]] == cycle * 12
    gaps = [b.time - a.time for a, b in pairwise(run.transitions[3:80:4])]
    assert all(after / before == pytest.approx(3**-0.5, rel=1e-4) for before, after in pairwise(gaps))


GROUPS = [
    (scene, reading)
    for scene, readings in {"coupled_clutches": ("equal", "peak"), "clutch_pair": ("default",)}.items()
    for reading in readings
]


@pytest.mark.parametrize(("scene", "reading"), daily(GROUPS, some=GROUPS[1:]))
def test_groups_with_static_friction_are_decided_without_python(
    scene: str, reading: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A clutch closed at a given instant, too: a section is crossed beside contacts that hold."""
    problem = load_case(CASES / "scenes" / f"{scene}.yaml").reading(reading).problem
    ours, theirs, asked = runs(problem, monkeypatch)
    same_transitions(ours, theirs)
    assert asked == 0


@pytest.mark.parametrize(
    ("name", "readings"),
    [
        ("two_contacts", ["together"]),
        ("near_ties", ["together"]),
        ("one_contact_twice", ["same", "geared", "turned"]),
        ("g_stays_zero", ["dead"]),
        ("repelling", ["two_fold", "landing"]),
    ],
)
def test_what_happens_at_one_instant_needs_no_python(name: str, readings: list[str]) -> None:
    """Slides that end together, a contact with two laws, a field that is zero beyond, a slide that turns repelling."""
    case = load_case(CASES / "hard" / f"{name}.yaml")
    for reading in readings:
        run = HENON_SOLVER.prepare(case.reading(reading).problem, rtol=1e-9)
        run()  # modes are compiled on first sight
        assert run().counts.decisions == Decisions(), reading


@pytest.mark.parametrize(("rate", "x"), [("1/x - s", 0), ("log(x) - s", 0), ("sqrt(x) - s", -1)])
def test_a_start_without_a_field_names_it(rate: str, x: float) -> None:
    run = hr.simulate(hr.System(["x", "v"], {}, {"s": "v"}, ["v", rate]), {"x": x, "v": 0}, until=1)
    assert run.message == "no mode is consistent at t = 0: the field of v is not finite there"


@pytest.mark.parametrize("surfaces", [{"s": "x"}, {"s": "x", "u": "v"}, {"s": "sqrt(x)"}])
def test_a_section_needs_a_motion_at_the_start(surfaces: dict[str, str]) -> None:
    run = hr.simulate(hr.System(["x", "v"], {}, surfaces, ["1/x", "1"]), {"x": 0, "v": 0}, until=1)
    assert run.message == "no mode is consistent at t = 0: the field of x is not finite there"


@pytest.mark.parametrize("force", ["v^(3/2)", "sqrt(v)", "v*log(v)", "1/v"])
def test_a_given_mode_at_a_singular_start(force: str) -> None:
    """The normal velocities, 1/2 and 3/2, are clear with the first two; no further derivative is finite."""
    system = hr.System(["x", "v"], {}, {"s": "x"}, [f"1 + s/2 + {force}", "1"])
    run = hr.simulate(system, {"x": 0, "v": 0}, until=1, mode={"s": 1})
    assert (run.status, run.message.split(":")[0]) == ("failed", "the step size fell to zero at t = 0")
