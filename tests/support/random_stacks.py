"""Random stacks of two blocks on a floor, each contact with static friction, and the ends of their runs.

    python -m tests.support.random_stacks [NUMBER] [SEED] [SECONDS]

Block a stands on the floor, b on a, each contact with static above kinetic friction (by a factor of 1 to 3), a harmonic
force on each. Every run of ``henon`` is one line; the last line counts how they end.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from henon_ref.casefile.case import parse_case
from henon_ref.integrator.integrator import Integrator, order_for
from henon_ref.integrator.run import Run
from henon_ref.modes.system import FilippovSystem
from henon_ref.trajectory import Trajectory

STACK = """\
schema: 1
name: stack
title: Two blocks on a floor
scene:
  parameters: {m: 1, Fs: 2, Fk: 1, Gs: 2, Gk: 1, A: 1, u: 1, B: 1, w: 1}
  bodies: {a: {mass: 1}, b: {mass: m}, floor: fixed}
  connections:
    - friction: {between: [a, floor], law: coulomb, force: Fk, static: Fs}
    - friction: {between: [b, a], law: coulomb, force: Gk, static: Gs}
    - force: {on: a, value: A*sin(u*t)}
    - force: {on: b, value: B*cos(w*t)}
initial: {x_a: 0, v_a: 0, x_b: 0, v_b: 0}
until: 20
"""
NUMBER, SEED, SECONDS = 316, 34, 20.0


def stack() -> FilippovSystem:
    """The stack without values of its parameters."""
    return replace(parse_case(STACK).readings[0].problem.system, parameters={})


def draws(number: int, seed: int, seconds: float) -> Iterator[tuple[dict[str, float], tuple[float, float], Run]]:
    """Random stacks: parameters, velocities at the start, and the run."""
    integrator, generator = Integrator(stack(), order_for(1e-13)), np.random.default_rng(seed)
    for _ in range(number):
        draw = generator.uniform
        m, static, upper = draw(0.3, 3), draw(0.5, 3), draw(0.3, 2)
        values = {
            "m": m, "Fs": static, "Fk": static / draw(1, 3), "Gs": upper, "Gk": upper / draw(1, 3),
            "A": draw(0, 4), "u": draw(0.5, 3), "B": draw(0, 3), "w": draw(0.5, 3),
        }  # fmt: skip
        velocities = draw(-2, 2), draw(-2, 2)
        start = integrator.begin(
            tuple(values[p.name] for p in integrator.parameters),
            (0.0, velocities[0], 0.0, velocities[1]),
            until=seconds,
            tolerance=1e-13,
        )
        yield values, velocities, Run(integrator, start)


def runs(number: int = NUMBER, seed: int = SEED, seconds: float = SECONDS) -> Iterator[Trajectory]:
    """Their runs."""
    return (run.to_horizon() for _, _, run in draws(number, seed, seconds))


def main() -> None:
    """Command line; see the docstring of the module."""
    number, seed = (int(v) for v in (*sys.argv[1:3], *map(str, (NUMBER, SEED)[len(sys.argv[1:3]) :])))
    seconds = float(sys.argv[3]) if len(sys.argv) > 3 else SECONDS
    ended = Counter[str]()
    for number_so_far, run in enumerate(runs(number, seed, seconds)):
        print(number_so_far, run.status, len(run.transitions), f"{run.end_time:.6g}", run.reason, flush=True)
        ended[run.status] += 1
    print(f"{number} stacks, seed {seed}, {seconds:g} s:", dict(ended))


if __name__ == "__main__":
    main()
