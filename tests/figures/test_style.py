"""Lines of solvers are told apart, in colour and without it; times have units."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from matplotlib.colors import to_rgb

from henon_ref.figures import style
from henon_ref.figures.style import line_of

SUNDIALS = ("cvode-adams", "cvode-bdf", "ida")
SCIPY = ("scipy-rk45", "scipy-dop853", "scipy-radau", "scipy-bdf", "scipy-lsoda")


@pytest.mark.parametrize("family", [SUNDIALS, SCIPY])
def test_solvers_of_a_family_differ_in_lightness(family):
    lines = [line_of(solver) for solver in family]
    lightness = sorted(_lightness(line.colour) for line in lines)
    assert min(b - a for a, b in pairwise(lightness)) > 10.0
    assert len({(line.marker, line.dashes) for line in lines}) == len(lines)


def test_solvers_of_third_parties_and_variants_are_told_apart():
    third = [f"solver-{k}" for k in range(12)]
    variants = [f"heyoka{variant}" for variant in ("", "+numba", "@offset", "@direction", "@none", "@event-free-step")]
    found = style.lines_of([*third, *variants, "henon", *SUNDIALS, *SCIPY])
    assert len(set(found.values())) == len(found)
    assert all(found[name].colour == line_of("heyoka").colour for name in variants)
    assert len(style.lines_of(f"solver-{k}" for k in range(30))) == 30


def test_a_third_party_is_drawn_alike_whoever_else_is_drawn():
    assert style.lines_of(["henon", "mine", "ida"])["mine"] == line_of("mine")
    both = style.lines_of(["mine", "yours"])
    assert both == style.lines_of(["yours", "mine"])


def _lightness(colour: str) -> float:
    """CIE L* of a colour, 0 to 100."""
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in to_rgb(colour)]
    return 116.0 * float(np.dot([0.2126, 0.7152, 0.0722], linear)) ** (1 / 3) - 16.0
