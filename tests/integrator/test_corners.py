"""Any corner of surfaces, with any numbers: where machine code decides it, it decides as Python does."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np
import pytest
from often import daily
from test_mode_selection import straight

from henon_ref.integrator.integrator import Integrator
from henon_ref.integrator.run import Run
from henon_ref.kernel.library import kernel
from henon_ref.modes.mode import Mode
from henon_ref.modes.selection import after_event

CORNERS = [(2, False), (3, False), (2, True), (3, True)]


class Corner:
    """A point on the surfaces x_i = 0, with x' = a + B s for any numbers a and B: they are states that rest.

    Parameters
    ----------
    acts : sequence of (int, int)
        Which surface's velocity has which one's sign in it.
    """

    def __init__(self, surfaces: int, acts: Sequence[tuple[int, int]]) -> None:
        self.surfaces, self.acts = surfaces, acts
        names = [f"x{i}" for i in range(surfaces)] + [f"a{i}" for i in range(surfaces)]
        names += [f"b{i}_{j}" for i, j in acts]
        field = [f"a{i}" + "".join(f" + b{i}_{j}*s{j}" for k, j in acts if k == i) for i in range(surfaces)]
        field += ["0"] * (len(names) - surfaces)
        names.append("z")  # moved by all: signs that act on one state each are decided each by itself
        field.append(" + ".join(f"s{i}" for i in range(surfaces)))
        problem = straight(names, field, [f"{name}: 1" for name in names], surfaces, 1)
        self.integrator = Integrator(problem.system, 8)
        for mode in product((-1, 0, 1), repeat=surfaces):
            self.integrator.mode_table.row(mode)
        self.start = self.integrator.start(problem, tolerance=1e-6)
        self.constants = self.start.constants

    def both(self, numbers: Sequence[float], mode: Mode, hit: Sequence[int]) -> tuple[Mode | None, Any]:
        """What machine code makes of it (None: left to Python), and what Python does.

        Parameters
        ----------
        numbers : sequence of float
            a, then the entries of B as in ``acts``.
        mode : tuple of int
            Before the surfaces ``hit`` were.
        """
        compiled = self.integrator.mode_table
        x = [0.0] * self.surfaces + [float(v) for v in numbers] + [0.0]
        row, guards = compiled.index[mode], compiled.guards(mode)
        at_zero = [g.kind == "surface" and g.index in hit for g in guards]
        hits = np.zeros(compiled.most_guards, dtype=np.int64)
        hits[: len(guards)] = at_zero
        run = Run(self.integrator, self.start)
        run.x[:], run.row = x, row
        run.hits[: len(hits)] = hits
        found = kernel.test_select_mode(run.workspace.run, self.constants.update().tables)
        asked = [g for g, zero in zip(guards, at_zero, strict=True) if zero]
        theirs = after_event(self.constants.in_doubles.at(0.0, x), mode, asked)
        return compiled.modes[found] if found >= 0 else None, theirs


def assert_decided_as_in_python(corner: Corner, seed: int, always: int | None = None) -> list[Mode]:
    """At random corners, where the surface ``always`` is among those reached; return what machine code decided."""
    random, found = np.random.default_rng(seed), []
    for _ in range(200):
        # ties are frequent
        numbers = [*random.integers(-6, 7, corner.surfaces) / 2, *random.integers(-4, 2, len(corner.acts))]
        mode = tuple(int(s) for s in random.choice([-1, 0, 1], corner.surfaces, p=[0.4, 0.2, 0.4]))
        hit = [i for i in range(corner.surfaces) if mode[i] and (i == always or random.random() < 0.8)]
        if not hit or always not in (None, *hit):
            continue
        ours, theirs = corner.both(numbers, mode, hit)
        if ours is not None:
            found.append(ours)
            assert (theirs.status, theirs.mode) == ("unique", ours), (numbers, mode, hit)
    assert len(found) >= 40
    return found


@pytest.mark.parametrize(
    ("surfaces", "coupled"),
    # 243 and 729 modes, whose equations take as long as all the rest; daily: up to three.
    daily([*CORNERS, (5, False), (6, False)], some=CORNERS[1:3]),
)
def test_any_corner_is_decided_as_in_python(surfaces: int, coupled: bool) -> None:
    every = range(surfaces)
    acts = [(i, j) for i in every for j in every if coupled or i == j]
    assert_decided_as_in_python(Corner(surfaces, acts), surfaces)


def test_a_section_beside_contacts_that_act_on_each_other_is_crossed() -> None:
    """Its sign is in no velocity, but theirs are in its own: no candidate slides on it."""
    acts = [(0, 0), (0, 1), (1, 0), (1, 1), (2, 0), (2, 1)]
    for ours in assert_decided_as_in_python(Corner(3, acts), 3, always=2):
        assert ours[2] != 0
