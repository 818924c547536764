"""Floating-point operations of a run, and operations and time per step that each effect of a scene adds."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import sympy as sp

from henon_ref.baselines.henon import HENON_SOLVER
from henon_ref.harness.campaign.timing import interleaved
from henon_ref.harness.report.model import mode_tape, operations
from henon_ref.harness.rows import Row
from henon_ref.harness.table import Table
from henon_ref.integrator.integrator import local_error, order_for
from henon_ref.jit.ir_writer import count
from henon_ref.modes.problem import Problem
from henon_ref.simulation.arguments import problem_of
from henon_ref.simulation.scene import Scene
from henon_ref.taylor.llvm.expansion import expansion_ir
from henon_ref.taylor.llvm.step import step_end_ir

RTOL = 1e-12
ROUNDS = 60
"""Number of interleaved rounds; medians of 60 distinguish steps that differ by some percent."""
UNTIL = 600
"""Horizon of the scenes' runs [s]."""
Values = Mapping[str, str]
"""Coefficient of each effect: a number, or a parameter whose value is zero, so that the effect has no influence."""


@dataclass(frozen=True)
class Work(Row):
    """Operations and time of a run."""

    expansion: int
    """Operations of one Taylor expansion in slip."""
    stick: int
    """Operations of one Taylor expansion in stick."""
    closing: int
    """Operations at the end of a step."""
    steps: int
    expansions: int
    in_stick: int
    """Expansions made while the motion sticks."""
    landed: int
    """Evaluations of a guard's polynomial in landings."""
    order: int
    """Degree of the polynomials."""
    wall_s: float
    """Median time of the run [s]."""
    peak: float
    """Rate of operations of a matrix product on one core [1/s]."""

    @property
    def total(self) -> int:
        """Operations of the run: expansions, ends of steps, polynomials (a product and a sum per degree)."""
        slip = self.expansions - self.in_stick
        landing = 2 * self.order * self.landed
        return slip * self.expansion + self.in_stick * self.stick + self.steps * self.closing + landing

    @property
    def rate(self) -> float:
        """Rate of operations [1/s]."""
        return self.total / self.wall_s


def work(problem: Problem) -> Work:
    """Count and time a run of a problem with one surface at tolerance 1e-12."""
    order, system = order_for(local_error(RTOL)), problem.system
    n = len(system.states)
    slip, stick = (count(expansion_ir(mode_tape(system, own), n, order, "expansion")) for own in ((), (0,)))
    size, products = 60, 20  # three matrices of this size fit into the first cache level
    a = np.linspace(0, 1, size * size).reshape(size, size)
    out = np.empty_like(a)

    def product() -> None:
        for _ in range(products):
            np.matmul(a, a, out=out)

    run = HENON_SOLVER.prepare(problem, rtol=RTOL)
    times = interleaved({"run": run, "product": product}, rounds=ROUNDS)
    whole = run()
    shorter = [replace(problem, until=sp.Rational(t.time)) for t in whole.transitions]
    runs = [HENON_SOLVER.prepare(own, rtol=RTOL)() for own in shorter]
    spent = [0, *(own.counts.rhs_evaluations for own in (*runs, whole))]
    stuck = [mode == (0,) for mode in (whole.transitions[0].from_mode, *(t.to_mode for t in whole.transitions))]
    return Work(
        expansion=slip,
        stick=stick,
        closing=count(step_end_ir(n, 1, order, "closing")),
        steps=whole.counts.steps,
        expansions=whole.counts.rhs_evaluations,
        in_stick=int(np.diff(spent)[stuck].sum()),
        landed=whole.counts.event_evaluations,
        order=order,
        wall_s=times.median("run"),
        peak=products * 2 * size**3 / times.median("product"),
    )


@dataclass(frozen=True)
class Body:
    """A scene to which effects are added one by one."""

    name: str
    scene: Callable[[Values, float], Problem]
    """Makes the problem from the effects and the belt's velocity [m/s]."""
    first: str
    """Effects that the scene always has."""
    added: Mapping[str, tuple[str, str]]
    """Coefficient of each effect, and the coefficient with which it has no influence."""

    def with_effects(self, effects: Sequence[str], *, carried: bool = False, belt: float = 9) -> Problem:
        """Make the scene with some effects; with ``carried`` all others are compiled in at zero.

        ``belt``: velocity of the belt [m/s]; at the default the block never sticks.
        """
        values = {name: value if name in effects else zero for name, (value, zero) in self.added.items()}
        return self.scene({name: own for name, own in values.items() if carried or name in effects}, belt)


def oscillator(values: Values, velocity: float) -> Problem:
    """Make a block on a belt with a spring."""
    scene = Scene(parameters={"m": 1, "z": 0})
    block, belt = scene.body("block", "m", ["x1", "x2"]), scene.prescribed("belt", velocity=velocity)
    scene.spring(block, scene.wall, stiffness=1, cubic=values.get("cubic spring"))
    slope = values.get("friction that falls (Stribeck)")
    scene.friction(block, belt, law="stribeck" if slope else "coulomb", force=0.4, slope=slope, name="s")
    if "damper" in values:
        scene.damper(block, scene.wall, coefficient=values["damper"])
    if "force" in values:
        scene.force(block, f"{values['force']}*sin(1.7*t)")
    return problem_of(scene.system(), {"x1": 1, "x2": 0}, until=UNTIL)[1]


def two_blocks(values: Values, velocity: float) -> Problem:
    """Make a block on a belt with a spring and falling friction, and a second block that follows the first."""
    scene = Scene(parameters={"m": 1, "M": 2, "k": 0.5, "kf": 2, "c": 0.01, "z": 0, "y": 0, "w": 0})
    block, follower = scene.body("block", "m", ["x1", "x2"]), scene.body("follower", "M", ["x3", "x4"])
    scene.spring(block, scene.wall, stiffness=1)
    scene.friction(block, scene.prescribed("belt", velocity=velocity), law="stribeck", force=0.4, slope=3, name="s")
    if "spring between the blocks" in values:
        scene.spring(block, follower, stiffness=values["spring between the blocks"])
    if "spring of the follower" in values:
        scene.spring(follower, scene.wall, stiffness=values["spring of the follower"])
    if "damper between the blocks" in values:
        scene.damper(block, follower, coefficient=values["damper between the blocks"])
    return problem_of(scene.system(), {"x1": 0, "x2": 0.4, "x3": 0.1, "x4": 0}, until=UNTIL)[1]


BODIES = (
    Body(
        "belt oscillator",
        oscillator,
        "spring, Coulomb friction",
        {
            "friction that falls (Stribeck)": ("3", "z"),
            "cubic spring": ("0.3", "z"),
            "damper": ("0.05", "z"),
            "force": ("0.2", "z"),
        },
    ),
    Body(
        "two blocks",
        two_blocks,
        "spring, friction",
        {
            "spring between the blocks": ("k", "z"),
            "spring of the follower": ("kf", "y"),
            "damper between the blocks": ("c", "w"),
        },
    ),
)


@dataclass(frozen=True)
class Step(Row):
    """Measurement of a scene with the effects up to one of them."""

    body: str
    effect: str
    """The last added effect; empty for the motion that sticks."""
    operations: int
    """Number of operations on the tape in slip."""
    carried: int | None
    """Operations with all other effects compiled in at zero; None for the motion that sticks."""
    transitions: int
    per_step_s: float
    """Wall time of one Taylor step of a whole run [s]."""
    carried_per_step_s: float | None
    to_carried: float | None
    """Time of a run divided by that with all other effects at zero, median over the rounds."""


def additions(body: Body) -> Iterator[tuple[str, Problem, Problem | None]]:
    """Yield each added effect with the scene up to it, without and with all others at zero.

    The last item is a motion that sticks, with the first effect.
    """
    for k, effect in enumerate((body.first, *body.added)):
        effects = tuple(body.added)[:k]
        yield effect, body.with_effects(effects), body.with_effects(effects, carried=True)
    yield "", body.with_effects(tuple(body.added)[:1], belt=0.3), None


def effect_costs() -> list[Step]:
    """Add the effects one by one for both bodies, and measure each scene."""
    return [_timed(body.name, *own) for body in BODIES for own in additions(body)]


def _timed(body: str, effect: str, own: Problem, carried: Problem | None) -> Step:
    problems = {"own": own} | ({} if carried is None else {"carried": carried})
    runs = {key: HENON_SOLVER.prepare(problem, rtol=RTOL) for key, problem in problems.items()}
    ends = {key: run() for key, run in runs.items()}
    times = interleaved(runs, rounds=ROUNDS)
    operated = {key: operations(mode_tape(problem.system)) for key, problem in problems.items()}
    per_step = {key: times.median(key) / end.counts.steps for key, end in ends.items()}
    return Step(
        body=body,
        effect=effect,
        operations=operated["own"],
        carried=operated.get("carried"),
        transitions=len(ends["own"].transitions),
        per_step_s=per_step["own"],
        carried_per_step_s=per_step.get("carried"),
        to_carried=times.ratio("own", "carried") if carried else None,
    )


def effect_table(steps: Sequence[Step]) -> Table:
    """Table of the operations and times of every effect, and of the scene with all others at zero."""
    headings = (
        "body", "effect added", "operations", "time per step", "increase", "operations, with all effects",
        "time per step, with all effects", "time of a run without / with them",
    )  # fmt: skip
    lines: list[tuple[str, ...]] = []
    for before, step in zip((None, *steps), steps, strict=False):
        increase = ""
        if before is not None and before.body == step.body and step.effect:
            increase = f"{1e9 * (step.per_step_s - before.per_step_s):+.0f} ns"
        lines.append(
            (
                step.body,
                step.effect or "*a motion with sticks*",
                f"{step.operations}",
                f"{1e9 * step.per_step_s:.0f} ns",
                increase,
                "" if step.carried is None else f"{step.carried}",
                "" if step.carried_per_step_s is None else f"{1e9 * step.carried_per_step_s:.0f} ns",
                "" if step.to_carried is None else f"{step.to_carried:.2f}",
            )
        )
    return Table(headings, "llr", lines)
