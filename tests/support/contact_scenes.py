"""Scenes of bodies with dry friction between them, as problems; libraries that run them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import pytest
from problems import read_problem

from henon_ref.modes.problem import Problem

LIBRARIES = [
    ("henon", {"rtol": 1e-13}, 1e-12),
    ("henon-rk4", {"step": 1e-3}, 1e-9),
    ("scipy-dop853", {"rtol": 1e-12}, 1e-9),
    ("cvode-bdf", {"rtol": 1e-10}, 1e-6),
    ("heyoka", {"rtol": 1e-16}, 1e-12),
]
"""Name, options, and how far times may be off [s]."""
ALL_LIBRARIES = pytest.mark.parametrize(("name", "options", "bound"), LIBRARIES, ids=[name for name, *_ in LIBRARIES])
Contact = tuple[str, str, str]
"""Two bodies, and keys of their friction."""


def scene(
    bodies: Mapping[str, str],
    contacts: Sequence[Contact],
    forces: Mapping[str, str],
    until: str,
    *,
    start: str = "0",
    stops: Sequence[str] = (),
    **initial: str,
) -> Problem:
    """Bodies (how they are given), contacts, forces on bodies, stops without restitution at a gap of 0.

    ``initial``: states that are not 0.
    """
    lines = ["scene:", "  bodies:"]
    lines += [f"    {b}: {given}" for b, given in bodies.items()]
    lines += ["  connections:", *(f"    - stop: {{between: {stop}, gap: 0, restitution: 0}}" for stop in stops)]
    lines += [f"    - friction: {{between: [{p}, {q}], law: coulomb, {keys}}}" for p, q, keys in contacts]
    lines += [f'    - force: {{on: {b}, value: "{f}"}}' for b, f in forces.items()]
    states = [f"{x}_{b}" for b, given in bodies.items() if "mass" in given for x in "xv"]
    values = ", ".join(f"{state}: {initial.get(state, '0')}" for state in states)
    return read_problem("\n".join([*lines, f"initial: {{t: {start}, {values}}}", f"until: {until}", ""]))
