"""Only the effects a scene calls for: what each one costs, and what it costs to carry it at zero."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from henon_ref.henon.solvers import HENON_SOLVER
from henon_ref.model.case import parse_case
from henon_ref.model.system import FilippovSystem
from henon_ref.score.turns import in_turn
from henon_ref.taylor.tape import Tape, build_tape
from henon_ref.trajectory import Problem

RTOL = 1e-12
ROUNDS = 60
FRAME = """\
schema: 1
name: effects
title: Effects
scene:
  body: {body}
  parameters: {parameters}
  effects:
{effects}
initial: {initial}
until: {until}
"""
OSCILLATOR = {
    "linear_spring": "{stiffness: 1}",
    "moving_belt": "{velocity: 0.3}",
    "stribeck_friction": "{force: 0.4, slope: 1}",
    "viscous_damping": "{coefficient: 0.05}",
    "cubic_spring": "{stiffness: 0.3}",
    "harmonic_base": "{amplitude: 0.2, frequency: 1.7}",
}
"""The belt oscillator's effects in the order they are added; the first three are what a stick needs."""
OFF = {
    "viscous_damping": "{coefficient: z}",
    "cubic_spring": "{stiffness: z}",
    "harmonic_base": "{amplitude: z, frequency: 1.7}",
}
"""The same, compiled in with a coefficient that happens to be zero."""
RIG = {
    "block_spring": "{stiffness: 1}",
    "coupling_spring": "{stiffness: 1}",
    "bracket_spring": "{stiffness: 1}",
    "moving_belt": "{velocity: 0.4}",
    "stribeck_friction": "{force: 0.5, slope: 3}",
    "coupling_damper": "{coefficient: 0.01}",
    "bracket_damper": "{coefficient: 0.01}",
    "load_coupling": "{friction: 0.5, stiffness: 1, coefficient: 0.01}",
}
RIG_OFF = {
    "coupling_damper": "{coefficient: z}",
    "bracket_damper": "{coefficient: z}",
    "load_coupling": "{friction: z, stiffness: 1, coefficient: z}",
}
WRITTEN = """\
schema: 1
name: by_hand
title: Written out by hand
system: {{state: [{state}], surfaces: {{s: {surface}}}, field: [{field}]}}
initial: {initial}
until: {until}
"""
BY_HAND = {
    "belt oscillator": WRITTEN.format(
        state="x1, x2",
        surface="x2 - 0.3",
        field="x2, -x1 - s*0.4/(1 + s*(x2 - 0.3))",
        initial="{t: 0, x1: 1, x2: 0}",
        until=60,
    ),
    "rig": WRITTEN.format(
        state="x1, x2, x3, x4",
        surface="x2 - 0.4",
        field="x2, -x1 - (x3 + 0.5*s/(1 + 3*s*(x2 - 0.4)))/2, x4, -3/4*(x1 + 2*x3)",
        initial="{t: 0, x1: 0, x2: 0.4, x3: 0.1, x4: 0}",
        until=60,
    ),
}
"""The first scene of each body as a system, with nothing in it of the effects that are added later."""


@dataclass(frozen=True)
class Step:
    """A scene with the effects up to one of them."""

    body: str
    effect: str
    """The effect that was added last."""
    operations: int
    """Operations on the slip tape."""
    carried: int
    """Operations with all later effects compiled in at zero."""
    per_step_s: float
    """Wall time of one Taylor step of a whole run [s]."""
    carried_per_step_s: float
    to_carried: float
    """Time of a step over that with all later effects at zero, median over the rounds."""
    to_written: float | None
    """The same over :data:`BY_HAND`; None where more effects are in than it has."""


def oscillator(effects: dict[str, str], *, until: float = 60.0) -> Problem:
    """A belt oscillator with these effects; ``z`` is a parameter that is zero."""
    return _problem("belt_oscillator", "{m: 1, z: 0}", effects, "{t: 0, x1: 1, x2: 0}", until)


def rig(effects: dict[str, str], *, until: float = 60.0) -> Problem:
    """A rig with these effects."""
    return _problem(
        "two_dof_rig",
        "{m: 1, k1: 1, k2: 1, a: 1, b: 1, r: 1, z: 0}",
        effects,
        "{t: 0, x1: 0, x2: 0.4, x3: 0.1, x4: 0}",
        until,
    )


def _problem(body: str, parameters: str, effects: dict[str, str], initial: str, until: float) -> Problem:
    lines = "\n".join(f"    {name}: {values}" for name, values in effects.items())
    text = FRAME.format(body=body, parameters=parameters, effects=lines, initial=initial, until=until)
    return parse_case(text).readings[0].problem


def slip_tape(system: FilippovSystem) -> Tape:
    """The tape of a system's slip modes: field and guards."""
    equations = system.shared_equations(frozenset())
    return build_tape(system.states, equations.field, [guard.expression for guard in equations.guards])


def operations(system: FilippovSystem) -> int:
    """Operations on the slip tape, without what is only read."""
    return sum(number for name, number in slip_tape(system).counts.items() if name not in ("state", "constant"))


def effect_costs() -> list[Step]:
    """Add one effect after the other, for both bodies; time both ways in turn."""
    found = []
    for body, make, effects, off, base in (
        ("belt oscillator", oscillator, OSCILLATOR, OFF, 3),
        ("rig", rig, RIG, RIG_OFF, 5),
    ):
        names = list(effects)
        for count in range(base, len(names) + 1):
            own = {name: effects[name] for name in names[:count]}
            all_in = {**own, **{name: off[name] for name in names[count:]}}
            problems = {"own": make(own), "carried": make(all_in)}
            if count == base:
                problems["written"] = parse_case(BY_HAND[body]).readings[0].problem
            runs = {key: HENON_SOLVER.prepare(problem, rtol=RTOL) for key, problem in problems.items()}
            times = in_turn(runs, rounds=ROUNDS)
            steps = {key: run().counts.steps for key, run in runs.items()}
            a_step = {key: times.median(key) / steps[key] for key in runs}
            ratio = {key: times.ratio("own", key) * steps[key] / steps["own"] for key in runs}
            found.append(
                Step(
                    body=body,
                    effect=names[count - 1] if count > base else ", ".join(names[:base]),
                    operations=operations(problems["own"].system),
                    carried=operations(problems["carried"].system),
                    per_step_s=a_step["own"],
                    carried_per_step_s=a_step["carried"],
                    to_carried=ratio["carried"],
                    to_written=ratio.get("written"),
                )
            )
    return found


def table(steps: Sequence[Step]) -> list[tuple[str, ...]]:
    """Rows of text."""
    return [
        (
            step.body,
            step.effect,
            f"{step.operations}",
            f"{step.carried}",
            f"{1e9 * step.per_step_s:.0f} ns",
            f"{1e9 * step.carried_per_step_s:.0f} ns",
            f"{step.to_carried:.2f}",
            "" if step.to_written is None else f"{step.to_written:.2f}",
        )
        for step in steps
    ]
