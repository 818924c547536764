"""Lines of solvers are told apart, in colour and without it; times have units.

Every SVG has the role of an image, a title and a description, and nothing in it that could end either.
"""

from __future__ import annotations

from itertools import pairwise
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.colors import to_rgb

from henon_ref.figures import style
from henon_ref.figures.style import describe, description_of, line_of

SVG = "{http://www.w3.org/2000/svg}"
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


def written(figure) -> ElementTree.Element:
    return ElementTree.fromstring(style.image(figure))


def test_an_svg_is_an_image_with_title_and_description():
    with style.figure(2.0) as figure:
        figure.add_subplot()
        describe(figure, "A < B & C", 'Of <A> and "B",\nin one line.')
    root = written(figure)
    title, description = list(root)[:2]
    assert (title.tag, title.text) == (f"{SVG}title", "A < B & C")
    assert (description.tag, description.text) == (f"{SVG}desc", 'Of <A> and "B", in one line.')
    assert root.get("role") == "img"
    assert root.get("aria-labelledby") == f"{title.get('id')} {description.get('id')}"


def test_figures_in_one_page_do_not_share_names():
    names = set()
    for words in ("one", "another"):
        with style.figure(2.0) as figure:
            describe(figure, "Title", words)
        names |= {element.get("id") for element in list(written(figure))[:2]}
    assert len(names) == 4


def test_a_figure_that_nobody_described_says_what_stands_on_its_axes():
    with style.figure(2.0) as figure:
        left, right = figure.subplots(1, 2)
        left.set_title("a   the fan")
        left.plot([0, 1], [0, 1], label="a curve")
        left.set(xlabel="time [s]", ylabel="h")
        right.set_title("b   near it", loc="center")
    title, description = description_of(figure)
    assert title == "a   the fan; b   near it"
    assert description == "a   the fan, across: time [s], upward: h; shown are a curve."
    with style.figure(2.0) as single:
        single.add_subplot().set(xlabel=r"$\mu_0$ [N]", ylabel=r"$A\,\sin t$ [m$^2$]")
    assert description_of(single) == ("A sin t [m^2] over mu_0 [N]", "Panel, across: mu_0 [N], upward: A sin t [m^2].")
    with style.figure(2.0) as empty:
        assert all(description_of(empty))
