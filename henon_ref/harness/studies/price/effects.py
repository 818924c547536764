"""Cost of each effect of a scene: operations and time a step with it, and with it compiled in at zero."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from henon_ref.baselines.henon import HENON_SOLVER
from henon_ref.casefile.case import parse_case
from henon_ref.filippov.problem import Problem
from henon_ref.filippov.system import FilippovSystem
from henon_ref.harness.campaign.interleaved import interleaved
from henon_ref.taylor.tape import Tape, build_tape

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
WRITTEN = """\
schema: 1
name: by_hand
title: Written out by hand
system: {{state: [{states}], parameters: {parameters}, surfaces: {{s: {surface}}}, field: [{field}]}}
initial: {initial}
until: {until}
"""
Effects = Mapping[str, str]
"""By what it is called a connection as in a case file, or ``name = body`` for a body whose motion is given."""


@dataclass(frozen=True)
class Added:
    """An effect that is added to those before it."""

    name: str
    given: Effects
    """It and its parameters; the first row has what no scene can do without."""
    off: Effects
    """The same, compiled in with a coefficient ``z`` that happens to be zero."""
    by_hand: str
    """The field with all effects up to this one, written out without the others."""


@dataclass(frozen=True)
class Body:
    """Bodies between which effects are added one by one."""

    name: str
    bodies: Mapping[str, str]
    parameters: str
    initial: str
    states: str
    surface: str
    """Written out by hand: the block against a belt that it never sticks to."""
    added: tuple[Added, ...]
    stuck: Effects
    """Effects of a motion that sticks."""
    stuck_by_hand: tuple[str, str]
    """Surface and field of that."""


_FRICTION = "friction: {between: [block, belt], law: stribeck, force: 0.4, slope: SLOPE, name: s}"
_RUBBING = "0.4*s/(1 + 3*s*(x2 - 9))"
OSCILLATOR = Body(
    name="belt oscillator",
    bodies={"block": "{mass: m, states: [x1, x2]}", "belt": "{velocity: 9}", "wall": "fixed"},
    parameters="{m: 1, z: 0}",
    initial="{t: 0, x1: 1, x2: 0}",
    states="x1, x2",
    surface="x2 - 9",
    added=(
        Added(
            "spring, Coulomb friction",
            {
                "spring": "spring: {between: [block, wall], stiffness: 1}",
                "friction": "friction: {between: [block, belt], law: coulomb, force: 0.4, name: s}",
            },
            {},
            "x2, (-x1 - 0.4*s)/m",
        ),
        Added(
            "friction that falls (Stribeck)",
            {"friction": _FRICTION.replace("SLOPE", "3")},
            {"friction": _FRICTION.replace("SLOPE", "z")},
            f"x2, (-x1 - {_RUBBING})/m",
        ),
        Added(
            "cubic spring",
            {"spring": "spring: {between: [block, wall], stiffness: 1, cubic: 0.3}"},
            {"spring": "spring: {between: [block, wall], stiffness: 1, cubic: z}"},
            f"x2, (-x1 - 0.3*x1^3 - {_RUBBING})/m",
        ),
        Added(
            "damper",
            {"damper": "damper: {between: [block, wall], coefficient: 0.05}"},
            {"damper": "damper: {between: [block, wall], coefficient: z}"},
            f"x2, (-x1 - 0.3*x1^3 - 0.05*x2 - {_RUBBING})/m",
        ),
        Added(
            "force",
            {"force": "force: {on: block, value: 0.2*sin(1.7*t)}"},
            {"force": "force: {on: block, value: z*sin(1.7*t)}"},
            f"x2, (-x1 - 0.3*x1^3 - 0.05*x2 + 0.2*sin(1.7*t) - {_RUBBING})/m",
        ),
    ),
    stuck={
        "spring": "spring: {between: [block, wall], stiffness: 1}",
        "belt": "belt = {velocity: 0.3}",
        "friction": _FRICTION.replace("SLOPE", "3"),
    },
    stuck_by_hand=("x2 - 0.3", "x2, (-x1 - s*0.4/(1 + 3*s*(x2 - 0.3)))/m"),
)
TWO_BLOCKS = Body(
    name="two blocks",
    bodies={
        "block": "{mass: m, states: [x1, x2]}",
        "follower": "{mass: M, states: [x3, x4]}",
        "belt": "{velocity: 9}",
        "wall": "fixed",
    },
    parameters="{m: 1, M: 2, k: 0.5, kf: 2, c: 0.01, z: 0, y: 0, w: 0}",
    initial="{t: 0, x1: 0, x2: 0.4, x3: 0.1, x4: 0}",
    states="x1, x2, x3, x4",
    surface="x2 - 9",
    added=(
        Added(
            "spring, friction",
            {
                "own spring": "spring: {between: [block, wall], stiffness: 1}",
                "friction": _FRICTION.replace("SLOPE", "3"),
            },
            {},
            f"x2, (-x1 - {_RUBBING})/m, x4, 0",
        ),
        Added(
            "spring between the blocks",
            {"coupling": "spring: {between: [block, follower], stiffness: k}"},
            {"coupling": "spring: {between: [block, follower], stiffness: z}"},
            f"x2, (-x1 - k*(x1 - x3) - {_RUBBING})/m, x4, k*(x1 - x3)/M",
        ),
        Added(
            "spring of the follower",
            {"follower": "spring: {between: [follower, wall], stiffness: kf}"},
            {"follower": "spring: {between: [follower, wall], stiffness: y}"},
            f"x2, (-x1 - k*(x1 - x3) - {_RUBBING})/m, x4, (k*(x1 - x3) - kf*x3)/M",
        ),
        Added(
            "damper between the blocks",
            {"damper": "damper: {between: [block, follower], coefficient: c}"},
            {"damper": "damper: {between: [block, follower], coefficient: w}"},
            f"x2, (-x1 - k*(x1 - x3) - c*(x2 - x4) - {_RUBBING})/m, x4, (k*(x1 - x3) + c*(x2 - x4) - kf*x3)/M",
        ),
    ),
    stuck={
        "own spring": "spring: {between: [block, wall], stiffness: 1}",
        "coupling": "spring: {between: [block, follower], stiffness: k}",
        "belt": "belt = {velocity: 0.3}",
        "friction": _FRICTION.replace("SLOPE", "3"),
    },
    stuck_by_hand=("x2 - 0.3", "x2, (-x1 - k*(x1 - x3) - s*0.4/(1 + 3*s*(x2 - 0.3)))/m, x4, k*(x1 - x3)/M"),
)
BODIES = (OSCILLATOR, TWO_BLOCKS)


@dataclass(frozen=True)
class Step:
    """A scene with the effects up to one of them."""

    body: str
    effect: str
    """The effect that was added last; empty for the motion that sticks."""
    operations: int
    """Operations on the slip tape."""
    by_hand: int
    """The same of the field written out by hand."""
    carried: int | None
    """Operations with all other effects compiled in at zero; None for the motion that sticks."""
    transitions: int
    per_step_s: float
    """Wall time of one Taylor step of a whole run [s]."""
    carried_per_step_s: float | None
    to_carried: float | None
    """Time of a run over that with all other effects at zero, median over the rounds."""
    to_written: float
    """The same over the field written out by hand."""


def scene(body: Body, effects: Effects) -> Problem:
    """A body with these effects; ``z`` is a parameter that is zero."""
    connections = [effect for effect in effects.values() if " = " not in effect]
    moved = dict(effect.split(" = ") for effect in effects.values() if " = " in effect)
    bodies = ", ".join(f"{name}: {what}" for name, what in {**body.bodies, **moved}.items())
    text = SCENE.format(
        bodies=f"{{{bodies}}}",
        parameters=body.parameters,
        connections="\n".join(f"    - {connection}" for connection in connections),
        initial=body.initial,
        until=UNTIL,
    )
    return parse_case(text).readings[0].problem


def written(body: Body, surface: str, field: str) -> Problem:
    """The same body written out by hand."""
    text = WRITTEN.format(
        states=body.states,
        parameters=body.parameters,
        surface=surface,
        field=field,
        initial=body.initial,
        until=UNTIL,
    )
    return parse_case(text).readings[0].problem


def additions(body: Body) -> Iterator[tuple[str, Problem, Problem, Problem]]:
    """Effect added; the scene up to it, with all others carried at zero, and by hand."""
    given: dict[str, str] = {}
    for number, added in enumerate(body.added, start=1):
        given |= added.given
        carried = {**given, **{name: value for later in body.added[number:] for name, value in later.off.items()}}
        by_hand = written(body, body.surface, added.by_hand)
        yield added.name, scene(body, given), scene(body, carried), by_hand


def slip_tape(system: FilippovSystem) -> Tape:
    """The tape of a system's slip modes: field and guards."""
    equations = system.shared_equations(frozenset())
    return build_tape(system.states, equations.field, [guard.expression for guard in equations.guards])


def operations(system: FilippovSystem) -> int:
    """Operations on the slip tape, without what is only read."""
    return sum(number for name, number in slip_tape(system).counts.items() if name not in ("state", "constant"))


def effect_costs() -> list[Step]:
    """Add one effect after the other, for both bodies; time all ways in turn."""
    found = []
    for body in BODIES:
        for effect, own, carried, by_hand in additions(body):
            found.append(_timed(body.name, effect, {"own": own, "carried": carried, "written": by_hand}))
        stuck = {"own": scene(body, body.stuck), "written": written(body, *body.stuck_by_hand)}
        found.append(_timed(body.name, "", stuck))
    return found


def _timed(body: str, effect: str, problems: Mapping[str, Problem]) -> Step:
    runs = {key: HENON_SOLVER.prepare(problem, rtol=RTOL) for key, problem in problems.items()}
    ends = {key: run() for key, run in runs.items()}
    times = interleaved(runs, rounds=ROUNDS)
    a_step: Callable[[str], float] = lambda key: times.median(key) / ends[key].counts.steps  # noqa: E731
    there = "carried" in problems
    return Step(
        body=body,
        effect=effect,
        operations=operations(problems["own"].system),
        by_hand=operations(problems["written"].system),
        carried=operations(problems["carried"].system) if there else None,
        transitions=len(ends["own"].transitions),
        per_step_s=a_step("own"),
        carried_per_step_s=a_step("carried") if there else None,
        to_carried=times.ratio("own", "carried") if there else None,
        to_written=times.ratio("own", "written"),
    )


def rows(steps: Sequence[Step]) -> list[tuple[str, ...]]:
    """Rows of text."""
    found: list[tuple[str, ...]] = []
    for number, step in enumerate(steps):
        before = steps[number - 1] if number and steps[number - 1].body == step.body and step.effect else None
        more = "" if before is None else f"{1e9 * (step.per_step_s - before.per_step_s):+.0f} ns"
        found.append(
            (
                step.body,
                step.effect or "*a motion that sticks*",
                f"{step.operations}",
                f"{step.by_hand}",
                f"{1e9 * step.per_step_s:.0f} ns",
                more,
                f"{step.to_written:.2f}",
                "" if step.carried is None else f"{step.carried}",
                "" if step.carried_per_step_s is None else f"{1e9 * step.carried_per_step_s:.0f} ns",
                "" if step.to_carried is None else f"{step.to_carried:.2f}",
            )
        )
    return found
