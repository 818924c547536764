"""Cost of each effect of a scene: operations and time a step with it, and with it compiled in at zero."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from henon_ref.baselines.henon import HENON_SOLVER
from henon_ref.casefile.case import parse_case
from henon_ref.harness.campaign.timing import interleaved
from henon_ref.harness.rows import Row
from henon_ref.harness.table import Table
from henon_ref.modes.problem import Problem
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.tape import build_tape

RTOL = 1e-12
ROUNDS = 60
"""Rounds run in turn: medians of 60 tell apart steps that differ by some percent."""
UNTIL = 600
"""Horizon of all runs [s]."""
SCENE = """\
schema: 1
name: effects
title: Effects
scene:
  parameters: {parameters}
  bodies: {bodies}
  connections:
{connections}
initial: {initial}
until: {until}
"""
_COEFFICIENT = "VALUE"
_SPRING = "spring: {between: [block, wall], stiffness: 1}"
_FALLING = "friction: {between: [block, belt], law: stribeck, force: 0.4, slope: VALUE, name: s}"


@dataclass(frozen=True)
class Added:
    """An effect that is added to those before it."""

    name: str
    connection: str
    """As in a case file, with :data:`_COEFFICIENT` for what may be zero; it replaces one of the same ``key``."""
    value: str
    zero: str
    """A parameter that happens to be zero: with it the effect is compiled in, and does nothing."""
    key: str = ""


@dataclass(frozen=True)
class Body:
    """Bodies between which effects are added one by one."""

    name: str
    bodies: str
    """On a belt of the velocity :data:`_COEFFICIENT`: one that the block never sticks to, and one that it does."""
    parameters: str
    initial: str
    first: tuple[str, Mapping[str, str]]
    """What no scene can do without: its name, and the connections by key."""
    added: tuple[Added, ...]
    stuck: tuple[str, ...]
    """Connections of a motion that sticks."""


OSCILLATOR = Body(
    name="belt oscillator",
    bodies="{block: {mass: m, states: [x1, x2]}, belt: {velocity: VALUE}, wall: fixed}",
    parameters="{m: 1, z: 0}",
    initial="{t: 0, x1: 1, x2: 0}",
    first=(
        "spring, Coulomb friction",
        {"spring": _SPRING, "friction": "friction: {between: [block, belt], law: coulomb, force: 0.4, name: s}"},
    ),
    added=(
        Added("friction that falls (Stribeck)", _FALLING, "3", "z", "friction"),
        Added("cubic spring", _SPRING.replace("1}", "1, cubic: VALUE}"), "0.3", "z", "spring"),
        Added("damper", "damper: {between: [block, wall], coefficient: VALUE}", "0.05", "z"),
        Added("force", "force: {on: block, value: VALUE*sin(1.7*t)}", "0.2", "z"),
    ),
    stuck=(_SPRING, _FALLING.replace(_COEFFICIENT, "3")),
)
_COUPLING = "spring: {between: [block, follower], stiffness: VALUE}"
TWO_BLOCKS = Body(
    name="two blocks",
    bodies="{block: {mass: m, states: [x1, x2]}, follower: {mass: M, states: [x3, x4]}, belt: {velocity: VALUE}, "
    "wall: fixed}",
    parameters="{m: 1, M: 2, k: 0.5, kf: 2, c: 0.01, z: 0, y: 0, w: 0}",
    initial="{t: 0, x1: 0, x2: 0.4, x3: 0.1, x4: 0}",
    first=("spring, friction", {"spring": _SPRING, "friction": _FALLING.replace(_COEFFICIENT, "3")}),
    added=(
        Added("spring between the blocks", _COUPLING, "k", "z"),
        Added("spring of the follower", "spring: {between: [follower, wall], stiffness: VALUE}", "kf", "y"),
        Added("damper between the blocks", "damper: {between: [block, follower], coefficient: VALUE}", "c", "w"),
    ),
    stuck=(_SPRING, _COUPLING.replace(_COEFFICIENT, "k"), _FALLING.replace(_COEFFICIENT, "3")),
)
BODIES = (OSCILLATOR, TWO_BLOCKS)


@dataclass(frozen=True)
class Step(Row):
    """A scene with the effects up to one of them."""

    body: str
    effect: str
    """The effect that was added last; empty for the motion that sticks."""
    operations: int
    """Operations on the slip tape."""
    carried: int | None
    """Operations with all other effects compiled in at zero; None for the motion that sticks."""
    transitions: int
    per_step_s: float
    """Wall time of one Taylor step of a whole run [s]."""
    carried_per_step_s: float | None
    to_carried: float | None
    """Time of a run over that with all other effects at zero, median over the rounds."""


def scene(body: Body, connections: Iterable[str], *, belt: str = "9") -> Problem:
    """A body with these connections."""
    text = SCENE.format(
        bodies=body.bodies.replace(_COEFFICIENT, belt),
        parameters=body.parameters,
        connections="\n".join(f"    - {connection}" for connection in connections),
        initial=body.initial,
        until=UNTIL,
    )
    return parse_case(text).readings[0].problem


def sticking(body: Body) -> Problem:
    """A body whose motion sticks."""
    return scene(body, body.stuck, belt="0.3")


def additions(body: Body) -> Iterator[tuple[str, Problem, Problem]]:
    """Effect added; the scene up to it, and with all others carried at zero."""
    name, first = body.first
    given = dict(first)
    for count in range(len(body.added) + 1):
        if count:
            added = body.added[count - 1]
            name = added.name
            given[added.key or name] = added.connection.replace(_COEFFICIENT, added.value)
        off = {own.key or own.name: own.connection.replace(_COEFFICIENT, own.zero) for own in body.added[count:]}
        yield name, scene(body, given.values()), scene(body, {**given, **off}.values())


def operations(system: FilippovSystem) -> int:
    """Operations on the tape of a system's slip modes, without what is only read."""
    equations = system.shared_equations(frozenset())
    tape = build_tape(system.states, equations.field, [guard.expression for guard in equations.guards])
    return sum(number for name, number in tape.counts.items() if name not in ("state", "constant"))


def effect_costs() -> list[Step]:
    """Add one effect after the other, for both bodies; time all ways in turn."""
    found = []
    for body in BODIES:
        for effect, own, carried in additions(body):
            found.append(_timed(body.name, effect, {"own": own, "carried": carried}))
        found.append(_timed(body.name, "", {"own": sticking(body)}))
    return found


def _timed(body: str, effect: str, problems: Mapping[str, Problem]) -> Step:
    runs = {key: HENON_SOLVER.prepare(problem, rtol=RTOL) for key, problem in problems.items()}
    ends = {key: run() for key, run in runs.items()}
    times = interleaved(runs, rounds=ROUNDS)
    operated = {key: operations(problem.system) for key, problem in problems.items()}
    per_step = {key: times.median(key) / end.counts.steps for key, end in ends.items()}
    return Step(
        body=body,
        effect=effect,
        operations=operated["own"],
        carried=operated.get("carried"),
        transitions=len(ends["own"].transitions),
        per_step_s=per_step["own"],
        carried_per_step_s=per_step.get("carried"),
        to_carried=times.ratio("own", "carried") if "carried" in problems else None,
    )


def effect_table(steps: Sequence[Step]) -> Table:
    """Operations and times of every effect, and of the scene with all others compiled in at zero."""
    headings = (
        "body", "effect added", "operations", "time a step", "more than before", "operations, all carried",
        "time a step, all carried", "run over one with all carried",
    )  # fmt: skip
    lines: list[tuple[str, ...]] = []
    for before, step in zip((None, *steps), steps, strict=False):
        more = before and before.body == step.body and step.effect
        lines.append(
            (
                step.body,
                step.effect or "*a motion that sticks*",
                f"{step.operations}",
                f"{1e9 * step.per_step_s:.0f} ns",
                f"{1e9 * (step.per_step_s - before.per_step_s):+.0f} ns" if before and more else "",
                "" if step.carried is None else f"{step.carried}",
                "" if step.carried_per_step_s is None else f"{1e9 * step.carried_per_step_s:.0f} ns",
                "" if step.to_carried is None else f"{step.to_carried:.2f}",
            )
        )
    return Table(headings, "llrrrrrr", lines)
